//! The joint map: which servo follows which channel of a clip, and how, and what keeps the puppet safe.
//!
//! A person writes it as `puppet.toml`; `host-sim` resolves names and units, and the device gets it as
//! [postcard](https://postcard.jamesmunns.com) bytes: the fields of [`Settings`], [`BusSpec`] and [`Joint`] in the order of
//! their declaration, integers as varints. It is checked once, in [`JointMap::parse`] or [`JointMap::new`]; what holds
//! a `JointMap` relies on that.

use crate::clock::MAX_TICK_HZ;
use crate::limits::{FINE_BITS, Limits, MAX_VELOCITY, clamp};
use crate::play_error::PlayError;
use core::ops::Range;
use decoder_core::I16F16;
use heapless::Vec;
use serde::{Deserialize, Serialize};
use servo_wire::dynamixel::MAX_ID;

mod error;

pub use error::MapError;

/// Version of the bytes, their first one.
const VERSION: u8 = 3;

/// Most servos of the maps that this project's host and boards exchange (`N` of [`JointMap`]).
pub const MAX_SERVOS: usize = servo_wire::bus::MAX_SERVOS;

/// Most buses of a puppet.
pub const MAX_BUSES: usize = 4;

/// Bytes that a map of this many joints takes at most: a joint 52, the rest 64.
pub const fn bytes_len(joints: usize) -> usize {
    64 + 52 * joints
}

/// Goals stay within ± this many goal units (256 turns of a Dynamixel X), so that fine ones fit an i32.
pub const GOAL_LIMIT: i32 = (1 << 20) - 1;

/// What the procedural idle layer adds to a joint at most, in goal units; negative reverses it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Idle {
    /// With each breath.
    pub breathing: i16,
    /// In slow shifts of weight.
    pub sway: i16,
    /// Looking about.
    pub gaze: i16,
}

/// A servo and the channel that it follows. Positions are goal units: for Dynamixel X, 4096 a turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Joint {
    /// Column of the clip's frames.
    pub channel: u16,
    /// Number of its bus in the map. Joints are in the order of their buses.
    pub bus: u8,
    /// The servo's id on the bus, 0 to [`MAX_ID`].
    pub id: u8,
    /// Goal at channel value 0, within `min..=max`.
    pub zero: i32,
    /// Goal at rest, within `min..=max`.
    pub home: i32,
    /// Goal units per degree, or per cm; negative reverses the direction. Not 0.
    pub scale: I16F16,
    /// Lowest goal.
    pub min: i32,
    /// Highest goal.
    pub max: i32,
    /// Largest change of the goal in one tick, in 1/1024 goal units, at least 1.
    pub max_velocity: i32,
    /// Largest change of that change from tick to tick, in 1/1024 goal units, at least 1.
    pub max_acceleration: i32,
    /// What the idle layer adds.
    pub idle: Idle,
}

impl Joint {
    /// The goal for a channel value, before limits, in 1/1024 goal units: `zero + value · scale`, rounded down; it saturates
    /// at ±2³⁰, just beyond [`GOAL_LIMIT`].
    ///
    /// Four 32-bit multiplies.
    #[inline]
    pub const fn goal(&self, value: I16F16) -> i32 {
        const MOST: i32 = (GOAL_LIMIT + 1) << FINE_BITS;
        let goal = (self.zero << FINE_BITS).saturating_add(scaled(value.to_bits(), self.scale.to_bits()));
        clamp(goal, -MOST, MOST)
    }

    /// Range, velocity and acceleration of the servo. A 64-bit divide: not for every tick.
    pub const fn limits(&self) -> Limits {
        Limits::new(self.min, self.max, self.max_velocity, self.max_acceleration)
    }
}

/// `⌊value · scale / 2²²⌋`, brought within ±2³⁰.
const fn scaled(value: i32, scale: i32) -> i32 {
    // Cores with atomics multiply to 64 bits in one instruction; those without (ARMv6-M) call a function for it.
    if cfg!(target_has_atomic = "32") { scaled_long(value, scale) } else { scaled_in_halves(value, scale) }
}

/// Product from which [`scaled`] saturates, in its high word.
const MOST_SCALED: i32 = 1 << 20;

const fn scaled_long(value: i32, scale: i32) -> i32 {
    let product = value as i64 * scale as i64;
    let high = (product >> 32) as i32;
    if high >= MOST_SCALED {
        MOST_SCALED << FINE_BITS
    } else if high < -MOST_SCALED {
        -MOST_SCALED << FINE_BITS
    } else {
        (product >> (32 - FINE_BITS)) as i32
    }
}

const fn scaled_in_halves(value: i32, scale: i32) -> i32 {
    let (value_high, value_low) = (value >> 16, value & 0xffff);
    let (scale_high, scale_low) = (scale >> 16, scale & 0xffff);
    let low = ((value_low as u32 * scale_low as u32) >> 16) as i32;
    let middle = [value_high * scale_low, value_low * scale_high];
    // In 1/65536 goal units; at most 3 · 65535.
    let below = (middle[0] & 0xffff) + (middle[1] & 0xffff) + low;
    let whole = value_high * scale_high + (middle[0] >> 16) + (middle[1] >> 16) + (below >> 16);
    if whole >= MOST_SCALED {
        MOST_SCALED << FINE_BITS
    } else if whole < -MOST_SCALED {
        -MOST_SCALED << FINE_BITS
    } else {
        whole << FINE_BITS | (below & 0xffff) >> (16 - FINE_BITS)
    }
}

/// What servos hang on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BusKind {
    /// Dynamixel protocol 2.0.
    Dynamixel,
    /// Dynamixel protocol 1.0 (AX, MX).
    Dynamixel1,
    /// Feetech STS.
    Sts,
    /// Feetech SCS.
    Scs,
    /// Hobby servos on the controller's own timers; ids count its outputs.
    Pwm,
    /// Hobby servos on a PCA9685; ids are its channels.
    Pca9685,
    /// The Blender Servo Animation add-on's live frames.
    Blender,
}

impl BusKind {
    /// Whether servos on such a bus tell where they are.
    pub const fn reads(self) -> bool {
        matches!(self, Self::Dynamixel | Self::Dynamixel1 | Self::Sts | Self::Scs)
    }
}

/// A bus of a puppet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BusSpec {
    /// What it speaks.
    pub kind: BusKind,
    /// Bits per second, not 0; for PWM the pulses per second.
    pub baud: u32,
}

/// How channels are interpolated between frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Interpolation {
    /// On straight lines.
    Linear,
    /// On Catmull-Rom curves.
    #[default]
    CatmullRom,
}

/// What the puppet does after a fault, until it is acknowledged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Policy {
    /// Brakes and holds the pose.
    #[default]
    Hold,
    /// Brakes, then goes to the home pose slowly.
    EaseHome,
    /// Lets go of all servos. A standing puppet falls.
    TorqueOff,
}

/// What holds for the whole puppet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// Goals per second and servo, 1 to [`MAX_TICK_HZ`].
    pub tick_hz: u16,
    /// Between frames.
    pub interpolation: Interpolation,
    /// After a fault.
    pub policy: Policy,
    /// Shortest time in ms in which the puppet is brought to a pose: to a clip's first one, home, back after a fault.
    pub ease_millis: u16,
    /// Highest velocity on such a way, in 1/256 of the servo's `max_velocity`, 1 to 256.
    pub ease_velocity: u16,
    /// Time in ms over which one clip fades into the next.
    pub fade_millis: u16,
    /// Temperature in °C at which a servo is too hot; 0: what the servo itself says alone counts.
    pub temperature_limit: u8,
    /// Supply in mV below which a fault is reported; 0: not looked at.
    pub min_millivolts: u16,
    /// Silence in ms after which servos with a watchdog of their own stop; 0: not armed.
    pub servo_watchdog_millis: u16,
    /// Channels that clips must have, so that one of another skeleton is refused; 0: as many as the joints need, or more.
    pub channels: u16,
}

impl Settings {
    /// What a puppet has that says nothing else: two seconds to ease at a quarter of the velocity, half a second to
    /// fade, servos that stop after 200 ms of silence.
    pub const fn new(tick_hz: u16) -> Self {
        Self {
            tick_hz,
            interpolation: Interpolation::CatmullRom,
            policy: Policy::Hold,
            ease_millis: 2000,
            ease_velocity: 64,
            fade_millis: 500,
            temperature_limit: 70,
            min_millivolts: 0,
            servo_watchdog_millis: 200,
            channels: 0,
        }
    }

    /// Ticks over which one clip fades into the next.
    pub const fn fade_ticks(&self) -> u32 {
        self.ticks(self.fade_millis)
    }

    /// Ticks in `millis`, rounded up.
    pub const fn ticks(&self, millis: u16) -> u32 {
        (millis as u32 * self.tick_hz as u32).div_ceil(1000)
    }
}

/// The servos of a puppet, at most `N`, and their buses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointMap<const N: usize> {
    settings: Settings,
    buses: Vec<BusSpec, MAX_BUSES>,
    joints: Vec<Joint, N>,
}

/// The map as bytes.
#[derive(Serialize, Deserialize)]
struct Wire<const N: usize> {
    version: u8,
    settings: Settings,
    buses: Vec<BusSpec, MAX_BUSES>,
    joints: Vec<Joint, N>,
}

impl<const N: usize> JointMap<N> {
    /// A map of joints on these buses.
    ///
    /// # Errors
    /// [`MapError`], all but its first three variants.
    pub fn new(
        settings: Settings,
        buses: Vec<BusSpec, MAX_BUSES>,
        joints: Vec<Joint, N>,
    ) -> Result<Self, MapError> {
        if settings.tick_hz == 0 || settings.tick_hz > MAX_TICK_HZ {
            return Err(MapError::TickRate { found: settings.tick_hz });
        }
        if settings.ease_velocity == 0 || settings.ease_velocity > 256 {
            return Err(MapError::EaseVelocity { found: settings.ease_velocity });
        }
        if buses.iter().any(|bus| bus.baud == 0) {
            return Err(MapError::Baud);
        }
        if joints.is_empty() {
            return Err(MapError::Empty);
        }
        let mut last_bus = 0;
        for (index, joint) in joints.iter().enumerate() {
            let id = joint.id;
            if id > MAX_ID {
                return Err(MapError::Id { found: id });
            }
            if usize::from(joint.bus) >= buses.len() || joint.bus < last_bus {
                return Err(MapError::Bus { id, found: joint.bus, buses: buses.len() });
            }
            last_bus = joint.bus;
            if joints.iter().take(index).any(|earlier| (earlier.bus, earlier.id) == (joint.bus, id)) {
                return Err(MapError::DuplicateId { id });
            }
            if joint.scale == I16F16::ZERO {
                return Err(MapError::Scale { id });
            }
            if joint.min < -GOAL_LIMIT || joint.max > GOAL_LIMIT {
                return Err(MapError::Range { id, min: joint.min, found: joint.zero, max: joint.max });
            }
            for found in [joint.zero, joint.home] {
                if found < joint.min || found > joint.max {
                    return Err(MapError::Range { id, min: joint.min, found, max: joint.max });
                }
            }
            for found in [joint.max_velocity, joint.max_acceleration] {
                if !(1..=MAX_VELOCITY).contains(&found) {
                    return Err(MapError::Velocity { id, found });
                }
            }
        }
        Ok(Self { settings, buses, joints })
    }

    /// Reads and checks the bytes of a map, all of them.
    ///
    /// # Errors
    /// [`MapError`].
    pub fn parse(bytes: &[u8]) -> Result<Self, MapError> {
        match bytes.first() {
            Some(&VERSION) => {}
            Some(&found) => return Err(MapError::Version { found }),
            None => return Err(MapError::Malformed { capacity: N }),
        }
        let malformed = MapError::Malformed { capacity: N };
        let (wire, rest) = postcard::take_from_bytes::<Wire<N>>(bytes).map_err(|_| malformed)?;
        if !rest.is_empty() {
            return Err(MapError::TrailingBytes { found: rest.len() });
        }
        Self::new(wire.settings, wire.buses, wire.joints)
    }

    /// Writes the bytes of the map to the front of `buffer` and returns them; [`bytes_len`] bytes are enough.
    ///
    /// # Errors
    /// [`MapError::BufferTooSmall`].
    pub fn to_bytes<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b mut [u8], MapError> {
        let wire = Wire {
            version: VERSION,
            settings: self.settings,
            buses: self.buses.clone(),
            joints: self.joints.clone(),
        };
        postcard::to_slice(&wire, buffer).map_err(|_| MapError::BufferTooSmall)
    }

    /// What holds for the whole puppet.
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Goals per second and servo, 1 to [`MAX_TICK_HZ`].
    pub const fn tick_hz(&self) -> u16 {
        self.settings.tick_hz
    }

    /// The buses.
    pub fn buses(&self) -> &[BusSpec] {
        &self.buses
    }

    /// The joints, at least one, in the order of their buses.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Whether a clip of so many channels can be played.
    ///
    /// # Errors
    /// [`PlayError::Channels`], [`PlayError::Channel`].
    pub fn check_channels(&self, channels: usize) -> Result<(), PlayError> {
        let expected = self.settings.channels;
        if expected > 0 && usize::from(expected) != channels {
            return Err(PlayError::Channels { found: channels as u32, expected });
        }
        let missing = self.joints.iter().find(|joint| usize::from(joint.channel) >= channels);
        missing.map_or(Ok(()), |joint| {
            Err(PlayError::Channel { id: joint.id, channel: joint.channel, channels: channels as u32 })
        })
    }

    /// Whether the servo of joint `index` tells where it is.
    pub fn reads(&self, index: usize) -> bool {
        let bus = self.joints.get(index).and_then(|joint| self.buses.get(usize::from(joint.bus)));
        bus.is_some_and(|bus| bus.kind.reads())
    }

    /// The numbers of the joints on a bus.
    pub fn on_bus(&self, bus: u8) -> Range<usize> {
        let start = self.joints.partition_point(|joint| joint.bus < bus);
        start..self.joints.partition_point(|joint| joint.bus <= bus)
    }

    /// The time of a tick after tick 0, in microseconds, rounded down: no error adds up over ticks.
    pub fn tick_micros(&self, tick: u32) -> u64 {
        u64::from(tick) * 1_000_000 / u64::from(self.settings.tick_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ELBOW: Joint = Joint {
        channel: 9,
        bus: 0,
        id: 3,
        zero: 2048,
        home: 2000,
        scale: I16F16::lit("11.378"),
        min: 1000,
        max: 3000,
        max_velocity: 40 << 10,
        max_acceleration: 4 << 10,
        idle: Idle { breathing: 3, sway: -4, gaze: 0 },
    };

    fn one_bus() -> Vec<BusSpec, MAX_BUSES> {
        [BusSpec { kind: BusKind::Dynamixel, baud: 1_000_000 }].into_iter().collect()
    }

    fn map(joints: &[Joint]) -> Result<JointMap<4>, MapError> {
        JointMap::new(Settings::new(100), one_bus(), joints.iter().copied().collect())
    }

    #[test]
    fn bytes_give_the_map_back() {
        let map = map(&[ELBOW, Joint { id: 4, scale: I16F16::MIN, ..ELBOW }]).unwrap();
        let mut buffer = [0; bytes_len(2)];
        assert_eq!(JointMap::<4>::parse(map.to_bytes(&mut buffer).unwrap()), Ok(map));
    }

    #[test]
    fn the_largest_joints_fit_the_stated_bytes() {
        let far = Joint {
            channel: u16::MAX,
            bus: 3,
            id: 252,
            zero: -GOAL_LIMIT,
            home: GOAL_LIMIT,
            scale: I16F16::MIN,
            min: -GOAL_LIMIT,
            max: GOAL_LIMIT,
            max_velocity: MAX_VELOCITY,
            max_acceleration: MAX_VELOCITY,
            idle: Idle { breathing: i16::MIN, sway: i16::MIN, gaze: i16::MIN },
        };
        let most = u16::MAX;
        let settings = Settings {
            tick_hz: 1000,
            interpolation: Interpolation::CatmullRom,
            policy: Policy::TorqueOff,
            ease_millis: most,
            ease_velocity: 256,
            fade_millis: most,
            temperature_limit: 255,
            min_millivolts: most,
            servo_watchdog_millis: most,
            channels: most,
        };
        let bus = BusSpec { kind: BusKind::Blender, baud: u32::MAX };
        let buses = [bus; MAX_BUSES].into_iter().collect();
        let map = JointMap::<4>::new(settings, buses, [far].into_iter().collect()).unwrap();
        assert!(map.to_bytes(&mut [0; bytes_len(1)]).is_ok());
    }

    #[test]
    fn a_faulty_joint_is_named() {
        let cases = [
            (vec![], MapError::Empty),
            (vec![Joint { id: 253, ..ELBOW }], MapError::Id { found: 253 }),
            (vec![ELBOW, Joint { id: 2, ..ELBOW }, ELBOW], MapError::DuplicateId { id: 3 }),
            (vec![Joint { bus: 1, ..ELBOW }], MapError::Bus { id: 3, found: 1, buses: 1 }),
            (vec![Joint { scale: I16F16::ZERO, ..ELBOW }], MapError::Scale { id: 3 }),
            (vec![Joint { zero: 999, ..ELBOW }], MapError::Range { id: 3, min: 1000, found: 999, max: 3000 }),
            (
                vec![Joint { home: 3001, ..ELBOW }],
                MapError::Range { id: 3, min: 1000, found: 3001, max: 3000 },
            ),
            (
                vec![Joint { max: i32::MAX, ..ELBOW }],
                MapError::Range { id: 3, min: 1000, found: 2048, max: i32::MAX },
            ),
            (vec![Joint { max_velocity: 0, ..ELBOW }], MapError::Velocity { id: 3, found: 0 }),
            (vec![Joint { max_acceleration: -1, ..ELBOW }], MapError::Velocity { id: 3, found: -1 }),
        ];
        for (joints, error) in cases {
            assert_eq!(map(&joints), Err(error));
        }
        let with = |settings| JointMap::<4>::new(settings, one_bus(), [ELBOW].into_iter().collect());
        for tick_hz in [0, 1001] {
            assert_eq!(with(Settings::new(tick_hz)), Err(MapError::TickRate { found: tick_hz }));
        }
        for ease_velocity in [0, 257] {
            let settings = Settings { ease_velocity, ..Settings::new(50) };
            assert_eq!(with(settings), Err(MapError::EaseVelocity { found: ease_velocity }));
        }
        let dead = [BusSpec { kind: BusKind::Pwm, baud: 0 }].into_iter().collect();
        assert_eq!(JointMap::<4>::new(Settings::new(50), dead, Vec::new()), Err(MapError::Baud));
    }

    #[test]
    fn joints_of_a_bus_are_side_by_side() {
        let on = |bus, id| Joint { bus, id, ..ELBOW };
        let two = |joints: &[Joint]| {
            let bus = one_bus()[0];
            JointMap::<4>::new(
                Settings::new(50),
                [bus; 3].into_iter().collect(),
                joints.iter().copied().collect(),
            )
        };
        let map = two(&[on(0, 3), on(2, 3), on(2, 4)]).unwrap();
        assert_eq!([0, 1, 2].map(|bus| map.on_bus(bus)), [0..1, 1..1, 1..3]);
        assert_eq!(two(&[on(2, 3), on(0, 4)]), Err(MapError::Bus { id: 4, found: 0, buses: 3 }));
    }

    #[test]
    fn bytes_of_another_kind_are_refused() {
        let mut buffer = [0; bytes_len(2)];
        let map = map(&[ELBOW, Joint { id: 4, ..ELBOW }]).unwrap();
        let bytes = map.to_bytes(&mut buffer).unwrap();
        for length in 0..bytes.len() {
            assert!(JointMap::<4>::parse(&bytes[..length]).is_err(), "cut after {length} bytes");
        }
        assert_eq!(JointMap::<1>::parse(bytes), Err(MapError::Malformed { capacity: 1 }));
        let mut longer = bytes.to_vec();
        longer.push(0);
        assert_eq!(JointMap::<4>::parse(&longer), Err(MapError::TrailingBytes { found: 1 }));
        bytes[0] = 1;
        assert_eq!(JointMap::<4>::parse(bytes), Err(MapError::Version { found: 1 }));
    }

    #[test]
    fn tick_times_do_not_drift() {
        let map = JointMap::<4>::new(Settings::new(60), one_bus(), [ELBOW].into_iter().collect()).unwrap();
        assert_eq!([0, 1, 2, 3].map(|tick| map.tick_micros(tick)), [0, 16_666, 33_333, 50_000]);
        assert_eq!(map.tick_micros(60 * 3600), 3_600_000_000);
    }

    fn slow(value: i32, scale: i32) -> i128 {
        let exact = (i128::from(value) * i128::from(scale)).div_euclid(1 << 22);
        exact.clamp(-(1 << 30), 1 << 30)
    }

    #[test]
    fn the_extremes_scale_exactly() {
        let values = [i32::MIN, i32::MIN + 1, -65_536, -1, 0, 1, 65_535, 65_536, i32::MAX];
        for value in values {
            for scale in values {
                assert_eq!(i128::from(scaled_long(value, scale)), slow(value, scale), "{value} · {scale}");
                assert_eq!(
                    i128::from(scaled_in_halves(value, scale)),
                    slow(value, scale),
                    "{value} · {scale}"
                );
                for zero in [-GOAL_LIMIT, GOAL_LIMIT] {
                    let joint = Joint { zero, scale: I16F16::from_bits(scale), ..ELBOW };
                    let expected = i128::from(zero << 10) + slow(value, scale);
                    let expected = expected.clamp(-(1 << 30), 1 << 30);
                    assert_eq!(i128::from(joint.goal(I16F16::from_bits(value))), expected);
                }
            }
        }
    }

    proptest! {
        #[test]
        fn scaling_equals_the_wide_reference(value: i32, scale: i32) {
            prop_assert_eq!(i128::from(scaled_long(value, scale)), slow(value, scale));
            prop_assert_eq!(i128::from(scaled_in_halves(value, scale)), slow(value, scale));
        }

        #[test]
        fn any_bytes_are_a_map_or_an_error(mut bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            if let Some(version) = bytes.first_mut() {
                *version = VERSION;
            }
            if let Ok(map) = JointMap::<4>::parse(&bytes) {
                prop_assert!(map.joints().iter().all(|joint| joint.min <= joint.zero && joint.zero <= joint.max));
            }
        }
    }
}

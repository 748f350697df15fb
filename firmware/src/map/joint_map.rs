//! The joints of a puppet and their buses, checked.

use super::bus::{BusSpec, MAX_BUSES};
use super::error::MapError;
use super::joint::{GOAL_LIMIT, Joint};
use super::settings::Settings;
use super::wire::{MapBytes, OLD_VERSION, VERSION};
use crate::clock::MAX_TICK_HZ;
use crate::collect::numbered;
use crate::demands::Demands;
use crate::limits::MAX_VELOCITY;
use core::ops::Range;
use decoder_core::I16F16;
use heapless::Vec;
use servo_wire::dynamixel::MAX_ID;

/// Most servos of the maps that this project's host and boards exchange (`N` of [`JointMap`]).
pub const MAX_SERVOS: usize = servo_wire::bus::MAX_SERVOS;

/// The servos of a puppet, at most `N`, and their buses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointMap<const N: usize> {
    settings: Settings,
    buses: Vec<BusSpec, MAX_BUSES>,
    joints: Vec<Joint, N>,
    /// Digest of the names of a clip's channels; 0: not known.
    names: u32,
}

impl<const N: usize> JointMap<N> {
    /// A map of joints on these buses.
    ///
    /// # Errors
    /// [`MapError`], all but its first three variants.
    // Once, at the start: as a part of its caller, it takes registers from the loop over ticks there.
    #[inline(never)]
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
        for (index, joint) in numbered(&joints) {
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
                return Err(MapError::Range { id, min: joint.min, found: joint.home, max: joint.max });
            }
            for (found, min, max) in
                [(joint.home, joint.min, joint.max), (joint.zero, -GOAL_LIMIT, GOAL_LIMIT)]
            {
                if found < min || found > max {
                    return Err(MapError::Range { id, min, found, max });
                }
            }
            for found in [joint.max_velocity, joint.max_acceleration] {
                if !(1..=MAX_VELOCITY).contains(&found) {
                    return Err(MapError::Velocity { id, found });
                }
            }
        }
        Ok(Self { settings, buses, joints, names: 0 })
    }

    /// Reads and checks the bytes of a map, all of them.
    ///
    /// # Errors
    /// [`MapError`].
    pub fn parse(bytes: &[u8]) -> Result<Self, MapError> {
        match bytes.first() {
            Some(&(VERSION | OLD_VERSION)) => {}
            Some(&found) => return Err(MapError::Version { found }),
            None => return Err(MapError::Malformed { capacity: N }),
        }
        let malformed = MapError::Malformed { capacity: N };
        let (map, rest) = postcard::take_from_bytes::<MapBytes<N>>(bytes).map_err(|_| malformed)?;
        // What came with a version stands behind what was there before.
        let (names, rest) = match map.version {
            OLD_VERSION => (0, rest),
            _ => postcard::take_from_bytes::<u32>(rest).map_err(|_| malformed)?,
        };
        if !rest.is_empty() {
            return Err(MapError::TrailingBytes { found: rest.len() });
        }
        Ok(Self::new(map.settings, map.buses, map.joints)?.with_names(names))
    }

    /// Writes the bytes of the map to the front of `buffer` and returns them.
    ///
    /// [`bytes_len`](super::bytes_len) bytes are enough.
    ///
    /// # Errors
    /// [`MapError::BufferTooSmall`].
    pub fn to_bytes<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b mut [u8], MapError> {
        let map = MapBytes {
            version: VERSION,
            settings: self.settings,
            buses: self.buses.clone(),
            joints: self.joints.clone(),
        };
        postcard::to_slice(&(map, self.names), buffer).map_err(|_| MapError::BufferTooSmall)
    }

    /// The same map, for clips whose channels' names have this digest
    /// ([`names_digest`](decoder_core::mclip::Header::names_digest)); 0: it is not known.
    #[must_use]
    pub fn with_names(self, names: u32) -> Self {
        Self { names, ..self }
    }

    /// Digest of the names of a clip's channels; 0: it is not known.
    pub const fn names(&self) -> u32 {
        self.names
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

    /// What a clip must be to be played.
    pub fn demands(&self) -> Demands {
        let joints = self.joints.iter().map(|joint| (joint.channel, joint.id));
        let (furthest_channel, furthest_id) = joints.max_by_key(|(channel, _)| *channel).unwrap_or_default();
        Demands {
            channels: self.settings.channels,
            names: self.names,
            furthest_channel,
            furthest_id,
            tick_hz: self.settings.tick_hz,
        }
    }

    /// Whether the servo of joint `index` tells where it is.
    pub fn reads(&self, index: usize) -> bool {
        let bus = self.joints.get(index).and_then(|joint| self.buses.get(usize::from(joint.bus)));
        bus.is_some_and(|bus| bus.kind.reads())
    }

    /// The hertz of its PCA9685's oscillator, where the puppet says them.
    pub fn oscillator_hz(&self) -> Option<u32> {
        self.buses.iter().find_map(|bus| bus.oscillator_hz())
    }

    /// The numbers of the joints on a bus.
    pub fn on_bus(&self, bus: u8) -> Range<usize> {
        let start = self.joints.partition_point(|joint| joint.bus < bus);
        start..self.joints.partition_point(|joint| joint.bus <= bus)
    }

    /// The time of a tick after tick 0, in microseconds, rounded down: no error adds up over ticks.
    pub fn tick_micros(&self, tick: u32) -> u64 {
        let micros = u64::from(tick).wrapping_mul(1_000_000);
        micros.checked_div(self.settings.tick_hz.into()).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::bus::BusKind;
    use super::super::joint::Idle;
    use super::super::settings::{Interpolation, Policy};
    use super::super::wire::bytes_len;
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
            (
                vec![Joint { zero: GOAL_LIMIT + 1, ..ELBOW }],
                MapError::Range { id: 3, min: -GOAL_LIMIT, found: GOAL_LIMIT + 1, max: GOAL_LIMIT },
            ),
            (
                vec![Joint { home: 3001, ..ELBOW }],
                MapError::Range { id: 3, min: 1000, found: 3001, max: 3000 },
            ),
            (
                vec![Joint { max: i32::MAX, ..ELBOW }],
                MapError::Range { id: 3, min: 1000, found: 2000, max: i32::MAX },
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

    proptest! {
        #[test]
        fn any_bytes_are_a_map_or_an_error(mut bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            if let Some(version) = bytes.first_mut() {
                *version = VERSION;
            }
            if let Ok(map) = JointMap::<4>::parse(&bytes) {
                prop_assert!(map.joints().iter().all(|joint| joint.min <= joint.home && joint.home <= joint.max));
            }
        }
    }
}

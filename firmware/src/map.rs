//! The joint map: which servo follows which channel of a clip, and how.
//!
//! A person writes it as `puppet.toml`; `host-sim` resolves names and units, and the device gets it as
//! [postcard](https://postcard.jamesmunns.com) bytes: the fields of [`Joint`] and of the map in the order of their
//! declaration, integers as varints. It is checked once, in [`JointMap::parse`] or [`JointMap::new`]; what holds
//! a `JointMap` relies on that.

use crate::clock::MAX_TICK_HZ;
use crate::dynamixel::MAX_ID;
use crate::limits::Limits;
use core::fmt;
use decoder_core::I16F16;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Version of the bytes, their first one.
const VERSION: u8 = 1;

/// Most servos of the maps that this project's host and boards exchange (`N` of [`JointMap`]).
pub const MAX_SERVOS: usize = 32;

/// Bytes that a map of this many joints takes at most: a joint 29, the rest 10.
pub const fn bytes_len(joints: usize) -> usize {
    10 + 29 * joints
}

/// Goals stay within ± this many goal units, so that no sum of a zero and a scaled channel leaves an i32.
pub const GOAL_LIMIT: i32 = (1 << 30) - 1;

/// A servo and the channel that it follows. Positions are goal units: for Dynamixel X, 4096 a turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Joint {
    /// Column of the clip's frames.
    pub channel: u16,
    /// The servo's id on the bus, 0 to [`MAX_ID`].
    pub id: u8,
    /// Goal at channel value 0, within `min..=max`. Also where the servo starts from: the first goals move away
    /// from it by at most `max_step` a tick.
    pub zero: i32,
    /// Goal units per degree, or per cm; negative reverses the direction. Not 0.
    pub scale: I16F16,
    /// Lowest goal.
    pub min: i32,
    /// Highest goal.
    pub max: i32,
    /// Largest change of the goal in one tick, at least 1.
    pub max_step: i32,
}

impl Joint {
    /// The goal for a channel value, before limits: `zero + value · scale`, rounded to the nearest goal unit
    /// (halves up). Exact, and never overflows for a joint that the map has checked.
    ///
    /// Four 32-bit multiplies.
    pub const fn goal(&self, value: I16F16) -> i32 {
        self.zero + scaled(value.to_bits(), self.scale.to_bits())
    }

    /// Range and speed of the servo.
    pub const fn limits(&self) -> Limits {
        Limits { min: self.min, max: self.max, max_step: self.max_step }
    }
}

/// `⌊value · scale / 2³² + ½⌋`, in products of 16-bit halves. At most 2³⁰ in size.
const fn scaled(value: i32, scale: i32) -> i32 {
    let (value_high, value_low) = (value >> 16, value & 0xffff);
    let (scale_high, scale_low) = (scale >> 16, scale & 0xffff);
    let low = (value_low as u32 * scale_low as u32) >> 16;
    let middle = [value_high * scale_low, value_low * scale_high];
    let carry = ((middle[0] & 0xffff) + (middle[1] & 0xffff) + low as i32 + 0x8000) >> 16;
    value_high * scale_high + (middle[0] >> 16) + (middle[1] >> 16) + carry
}

/// The servos of a puppet, at most `N`, and the pace of their bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointMap<const N: usize> {
    tick_hz: u16,
    baud: u32,
    joints: Vec<Joint, N>,
}

/// The map as bytes.
#[derive(Serialize, Deserialize)]
struct Wire<const N: usize> {
    version: u8,
    tick_hz: u16,
    baud: u32,
    joints: Vec<Joint, N>,
}

impl<const N: usize> JointMap<N> {
    /// A map of the given joints, which get a goal `tick_hz` times a second over a bus of `baud` bits per second.
    ///
    /// # Errors
    /// [`MapError`], all but its first three variants.
    pub fn new(tick_hz: u16, baud: u32, joints: Vec<Joint, N>) -> Result<Self, MapError> {
        if tick_hz == 0 || tick_hz > MAX_TICK_HZ {
            return Err(MapError::TickRate { found: tick_hz });
        }
        if baud == 0 {
            return Err(MapError::Baud);
        }
        if joints.is_empty() {
            return Err(MapError::Empty);
        }
        for (index, joint) in joints.iter().enumerate() {
            let id = joint.id;
            if id > MAX_ID {
                return Err(MapError::Id { found: id });
            }
            if joints.iter().take(index).any(|earlier| earlier.id == id) {
                return Err(MapError::DuplicateId { id });
            }
            if joint.scale == I16F16::ZERO {
                return Err(MapError::Scale { id });
            }
            let ordered = joint.min <= joint.zero && joint.zero <= joint.max;
            if !ordered || joint.min < -GOAL_LIMIT || joint.max > GOAL_LIMIT {
                return Err(MapError::Range { id, min: joint.min, zero: joint.zero, max: joint.max });
            }
            if joint.max_step < 1 || joint.max_step > GOAL_LIMIT {
                return Err(MapError::Step { id, found: joint.max_step });
            }
        }
        Ok(Self { tick_hz, baud, joints })
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
        Self::new(wire.tick_hz, wire.baud, wire.joints)
    }

    /// Writes the bytes of the map to the front of `buffer` and returns them; [`bytes_len`] bytes are enough.
    ///
    /// # Errors
    /// [`MapError::BufferTooSmall`].
    pub fn to_bytes<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b mut [u8], MapError> {
        let wire =
            Wire { version: VERSION, tick_hz: self.tick_hz, baud: self.baud, joints: self.joints.clone() };
        postcard::to_slice(&wire, buffer).map_err(|_| MapError::BufferTooSmall)
    }

    /// Goals per second and servo, 1 to [`MAX_TICK_HZ`].
    pub const fn tick_hz(&self) -> u16 {
        self.tick_hz
    }

    /// Bits per second on the bus, not 0.
    pub const fn baud(&self) -> u32 {
        self.baud
    }

    /// The joints, at least one.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// The time of a tick after tick 0, in microseconds, rounded down: no error adds up over ticks.
    pub fn tick_micros(&self, tick: u32) -> u64 {
        u64::from(tick) * 1_000_000 / u64::from(self.tick_hz)
    }
}

/// Why a joint map cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum MapError {
    /// The first byte names another version of the bytes.
    Version {
        /// The version.
        found: u8,
    },
    /// The bytes are no map, or a map of more joints than there is memory for.
    Malformed {
        /// Most joints here.
        capacity: usize,
    },
    /// Bytes follow the map.
    TrailingBytes {
        /// How many.
        found: usize,
    },
    /// The tick rate is out of range.
    TickRate {
        /// Ticks per second.
        found: u16,
    },
    /// The baud rate is 0.
    Baud,
    /// There are no joints.
    Empty,
    /// An id that no servo has.
    Id {
        /// The id.
        found: u8,
    },
    /// Two joints have one id.
    DuplicateId {
        /// The id.
        id: u8,
    },
    /// The scale is 0.
    Scale {
        /// The servo.
        id: u8,
    },
    /// Not `min ≤ zero ≤ max`, or not within [`GOAL_LIMIT`].
    Range {
        /// The servo.
        id: u8,
        /// Lowest goal.
        min: i32,
        /// Goal at channel value 0.
        zero: i32,
        /// Highest goal.
        max: i32,
    },
    /// The largest change a tick is out of range.
    Step {
        /// The servo.
        id: u8,
        /// The change.
        found: i32,
    },
    /// The buffer that was lent does not hold the map's bytes.
    BufferTooSmall,
}

impl fmt::Display for MapError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Version { found } => write!(f, "the joint map has version {found}, expected {VERSION}"),
            Self::Malformed { capacity } => {
                write!(f, "the bytes are not a joint map of at most {capacity} joints")
            }
            Self::TrailingBytes { found } => write!(f, "{found} bytes follow the joint map"),
            Self::TickRate { found } => {
                write!(f, "the servo rate is {found} Hz, expected 1 to {MAX_TICK_HZ}")
            }
            Self::Baud => f.write_str("the baud rate is 0"),
            Self::Empty => f.write_str("the joint map has no joints"),
            Self::Id { found } => write!(f, "servo id {found} is out of range, expected 0 to {MAX_ID}"),
            Self::DuplicateId { id } => write!(f, "two joints have servo id {id}"),
            Self::Scale { id } => write!(f, "servo {id}: the scale is 0"),
            Self::Range { id, min, zero, max } => write!(
                f,
                "servo {id}: zero is {zero}, expected it from min {min} to max {max}, all within {GOAL_LIMIT}"
            ),
            Self::Step { id, found } => {
                write!(f, "servo {id}: the largest step is {found} goal units a tick, expected 1 or more")
            }
            Self::BufferTooSmall => f.write_str("the buffer does not hold the joint map"),
        }
    }
}

impl core::error::Error for MapError {}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ELBOW: Joint = Joint {
        channel: 9,
        id: 3,
        zero: 2048,
        scale: I16F16::lit("11.378"),
        min: 1000,
        max: 3000,
        max_step: 40,
    };

    fn map(joints: &[Joint]) -> Result<JointMap<4>, MapError> {
        JointMap::new(100, 1_000_000, joints.iter().copied().collect())
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
            id: 252,
            zero: GOAL_LIMIT,
            scale: I16F16::MIN,
            min: -GOAL_LIMIT,
            max: GOAL_LIMIT,
            max_step: GOAL_LIMIT,
        };
        let map = JointMap::<4>::new(1000, u32::MAX, [far].into_iter().collect()).unwrap();
        assert!(map.to_bytes(&mut [0; bytes_len(1)]).is_ok());
    }

    #[test]
    fn a_faulty_joint_is_named() {
        let cases = [
            (vec![], MapError::Empty),
            (vec![Joint { id: 253, ..ELBOW }], MapError::Id { found: 253 }),
            (vec![ELBOW, Joint { id: 2, ..ELBOW }, ELBOW], MapError::DuplicateId { id: 3 }),
            (vec![Joint { scale: I16F16::ZERO, ..ELBOW }], MapError::Scale { id: 3 }),
            (vec![Joint { zero: 999, ..ELBOW }], MapError::Range { id: 3, min: 1000, zero: 999, max: 3000 }),
            (
                vec![Joint { max: i32::MAX, ..ELBOW }],
                MapError::Range { id: 3, min: 1000, zero: 2048, max: i32::MAX },
            ),
            (vec![Joint { max_step: 0, ..ELBOW }], MapError::Step { id: 3, found: 0 }),
        ];
        for (joints, error) in cases {
            assert_eq!(map(&joints), Err(error));
        }
        assert_eq!(JointMap::<4>::new(0, 1, Vec::new()), Err(MapError::TickRate { found: 0 }));
        assert_eq!(JointMap::<4>::new(1001, 1, Vec::new()), Err(MapError::TickRate { found: 1001 }));
        assert_eq!(JointMap::<4>::new(100, 0, Vec::new()), Err(MapError::Baud));
    }

    #[test]
    fn bytes_of_another_kind_are_refused() {
        let mut buffer = [0; 64];
        let map = map(&[ELBOW, Joint { id: 4, ..ELBOW }]).unwrap();
        let bytes = map.to_bytes(&mut buffer).unwrap();
        for length in 0..bytes.len() {
            assert!(JointMap::<4>::parse(&bytes[..length]).is_err(), "cut after {length} bytes");
        }
        assert_eq!(JointMap::<1>::parse(bytes), Err(MapError::Malformed { capacity: 1 }));
        let mut longer = bytes.to_vec();
        longer.push(0);
        assert_eq!(JointMap::<4>::parse(&longer), Err(MapError::TrailingBytes { found: 1 }));
        bytes[0] = 2;
        assert_eq!(JointMap::<4>::parse(bytes), Err(MapError::Version { found: 2 }));
    }

    #[test]
    fn tick_times_do_not_drift() {
        let map = JointMap::<4>::new(60, 1_000_000, [ELBOW].into_iter().collect()).unwrap();
        assert_eq!([0, 1, 2, 3].map(|tick| map.tick_micros(tick)), [0, 16_666, 33_333, 50_000]);
        assert_eq!(map.tick_micros(60 * 3600), 3_600_000_000);
    }

    fn slow(value: i32, scale: i32) -> i128 {
        (i128::from(value) * i128::from(scale) + (1 << 31)).div_euclid(1 << 32)
    }

    #[test]
    fn the_extremes_scale_exactly() {
        let values = [i32::MIN, i32::MIN + 1, -65_536, -1, 0, 1, 65_535, 65_536, i32::MAX];
        for value in values {
            for scale in values {
                assert_eq!(i128::from(scaled(value, scale)), slow(value, scale), "{value} · {scale}");
                for zero in [-GOAL_LIMIT, GOAL_LIMIT] {
                    let joint = Joint { zero, scale: I16F16::from_bits(scale), ..ELBOW };
                    let expected = i128::from(zero) + slow(value, scale);
                    assert_eq!(i128::from(joint.goal(I16F16::from_bits(value))), expected);
                }
            }
        }
    }

    proptest! {
        #[test]
        fn scaling_equals_the_wide_reference(value: i32, scale: i32) {
            prop_assert_eq!(i128::from(scaled(value, scale)), slow(value, scale));
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

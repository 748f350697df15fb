//! Why a joint map cannot be used.

use super::joint::GOAL_LIMIT;
use super::wire::VERSION;
use crate::clock::MAX_TICK_HZ;
use crate::limits::MAX_VELOCITY;
use core::fmt;
use servo_wire::dynamixel::MAX_ID;

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
    /// The velocity of easing is out of range.
    EaseVelocity {
        /// In 1/256.
        found: u16,
    },
    /// The baud rate of a bus is 0.
    Baud,
    /// There are no joints.
    Empty,
    /// An id that no servo has.
    Id {
        /// The id.
        found: u8,
    },
    /// A joint is on a bus that there is not, or after one on a later bus.
    Bus {
        /// The servo.
        id: u8,
        /// Number of the bus.
        found: u8,
        /// Buses of the map.
        buses: usize,
    },
    /// Two joints of a bus have one id.
    DuplicateId {
        /// The id.
        id: u8,
    },
    /// The scale is 0.
    Scale {
        /// The servo.
        id: u8,
    },
    /// Home not within `min..=max`, or zero or these not within [`GOAL_LIMIT`].
    Range {
        /// The servo.
        id: u8,
        /// Lowest goal.
        min: i32,
        /// Zero or home.
        found: i32,
        /// Highest goal.
        max: i32,
    },
    /// The largest velocity or acceleration is out of range.
    Velocity {
        /// The servo.
        id: u8,
        /// In 1/1024 goal units a tick.
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
            Self::EaseVelocity { found } => {
                write!(f, "the velocity of easing is {found}/256, expected 1 to 256")
            }
            Self::Bus { id, found, buses } => write!(
                f,
                "servo {id} is on bus {found} (from 0) of {buses}; joints are in the order of their buses"
            ),
            Self::Baud => f.write_str("the baud rate is 0"),
            Self::Empty => f.write_str("the joint map has no joints"),
            Self::Id { found } => write!(f, "servo id {found} is out of range, expected 0 to {MAX_ID}"),
            Self::DuplicateId { id } => write!(f, "two joints have servo id {id}"),
            Self::Scale { id } => write!(f, "servo {id}: the scale is 0"),
            Self::Range { id, min, found, max } => write!(
                f,
                "servo {id}: zero or home is {found}, expected it from min {min} to max {max}, all within {GOAL_LIMIT}"
            ),
            Self::Velocity { id, found } => write!(
                f,
                "servo {id}: a velocity or acceleration of {found}/1024 goal units a tick, expected 1 to {MAX_VELOCITY}"
            ),
            Self::BufferTooSmall => f.write_str("the buffer does not hold the joint map"),
        }
    }
}

impl core::error::Error for MapError {}

//! What servos are when their power comes on.

use servo_wire::dynamixel::MAX_ID;
use thiserror::Error;

/// How a servo is when its power comes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ServoConfig {
    /// Id, 0 to 252.
    pub id: u8,
    /// Position at the start in goal units, from 0 to the highest of such a servo (of a Dynamixel X 4095).
    pub position: i32,
    /// Lowest position that the servo takes as a goal, in goal units, 0 or more.
    pub min_position: i32,
    /// Highest position that the servo takes as a goal, in goal units, at most the highest of such a servo.
    pub max_position: i32,
}

impl ServoConfig {
    /// A Dynamixel X at the middle of its turn, with the limits of the factory.
    #[must_use]
    pub const fn new(id: u8) -> Self {
        Self { id, position: 2048, min_position: 0, max_position: 4095 }
    }
}

/// Why servos cannot be on a bus.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ConfigError {
    /// An id that no servo can have.
    #[error("servo id {0} is out of range, expected 0 to 252")]
    Id(u8),
    /// Two servos with one id, which would answer at once.
    #[error("servo id {0} is used twice")]
    Duplicate(u8),
    /// A servo that something should happen to, and that is not there.
    #[error("there is no servo {0} for something to happen to")]
    Absent(u8),
    /// Limits that leave no position, or none that the servo has.
    #[error("servo {id} has the position limits {min} to {max}, expected a range within 0 to {most}")]
    Limits {
        /// Id of the servo.
        id: u8,
        /// Its lower limit.
        min: i32,
        /// Its upper limit.
        max: i32,
        /// The highest position that such a servo has.
        most: i32,
    },
}

/// Whether servos with positions from 0 to `most` can be as they are described.
pub(crate) fn check(servos: &[ServoConfig], most: i32) -> Result<(), ConfigError> {
    let mut used = [false; MAX_ID as usize + 1];
    for &ServoConfig { id, min_position: min, max_position: max, .. } in servos {
        let used = used.get_mut(usize::from(id)).ok_or(ConfigError::Id(id))?;
        if std::mem::replace(used, true) {
            return Err(ConfigError::Duplicate(id));
        }
        if min < 0 || max > most || min > max {
            return Err(ConfigError::Limits { id, min, max, most });
        }
    }
    Ok(())
}

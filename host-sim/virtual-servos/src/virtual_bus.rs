//! What all virtual servos have in common, whatever they speak.

use crate::config::ConfigError;
use servo_wire::dynamixel::ErrorNumber;

/// What is seen of a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A servo took a goal position.
    Goal {
        /// The time given to [`VirtualBus::receive`], in microseconds.
        time_us: u64,
        /// Id of the servo.
        id: u8,
        /// Goal position, in the servo's goal units: of a Dynamixel X 4096 a turn.
        position: i32,
    },
    /// A servo refused an instruction; after a sync write nobody else learns of it.
    Refused {
        /// The time given to [`VirtualBus::receive`], in microseconds.
        time_us: u64,
        /// Id of the servo.
        id: u8,
        /// Why.
        error: ErrorNumber,
    },
}

/// What happens to servos from outside, apart from what is said on their bus.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Deserialize),
    serde(tag = "what", rename_all = "kebab-case", deny_unknown_fields)
)]
pub enum Disturbance {
    /// The servo's supply breaks in: the servo forgets its RAM, lets go, and is gone for [`START_US`].
    Restart {
        /// Id of the servo.
        servo: u8,
    },
    /// The servo neither hears nor says anything.
    Silence {
        /// Id of the servo.
        servo: u8,
        /// For how long.
        seconds: f64,
    },
    /// Nothing goes over the bus.
    Cut {
        /// For how long.
        seconds: f64,
    },
    /// Somebody turns the servo's shaft, which a servo whose torque is on does not let happen.
    Turn {
        /// Id of the servo.
        servo: u8,
        /// To this position, in the servo's goal units.
        position: i32,
    },
    /// Somebody else writes a value into the servo's table, whatever the servo itself would take: a wrong operating mode,
    /// an old firmware, another model.
    Set {
        /// Id of the servo.
        servo: u8,
        /// Address of the value's first byte.
        address: u16,
        /// The value, cut to the length of the register.
        value: i64,
    },
}

/// Microseconds that a servo takes to start.
pub const START_US: u64 = 300_000;

impl Disturbance {
    /// The servo that it happens to, if it does not happen to all.
    #[must_use]
    pub const fn servo(&self) -> Option<u8> {
        match *self {
            Self::Restart { servo } | Self::Silence { servo, .. } | Self::Turn { servo, .. } => Some(servo),
            Self::Set { servo, .. } => Some(servo),
            Self::Cut { .. } => None,
        }
    }
}

/// Servos on one bus: bytes and the time go in, bytes come out.
pub trait VirtualBus: Send {
    /// Takes bytes that arrive at `now_us` (microseconds since power on, never going back), and returns what the
    /// servos answer. `tap` is told of every goal position and every refusal, in order.
    fn receive(&mut self, bytes: &[u8], now_us: u64, tap: &mut dyn FnMut(Event)) -> Vec<u8>;

    /// Has something happen at `at_us`, or as soon as time passes where that is over.
    ///
    /// # Errors
    /// [`ConfigError::Absent`] for a servo that is not on this bus.
    fn schedule(&mut self, at_us: u64, disturbance: Disturbance) -> Result<(), ConfigError>;
}

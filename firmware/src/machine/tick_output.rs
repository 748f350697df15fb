//! What a tick of the machine asks of the buses.

use servo_wire::bus::Goal;

/// One thing besides goals and readings that a bus is asked in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Action {
    /// Is this servo there?
    Ping {
        /// The servo, as numbered in the map.
        servo: usize,
    },
    /// Turn a servo on where it is.
    TorqueOn {
        /// The servo.
        servo: usize,
    },
    /// Let all servos go.
    TorqueOff,
    /// Let one servo go.
    LetGo {
        /// The servo.
        servo: usize,
    },
    /// Restart a servo that says it has a hardware error.
    Reboot {
        /// The servo.
        servo: usize,
    },
    /// Set the servos' own watchdogs, 0 to disarm them.
    Watchdog {
        /// Silence that they bear, in ms.
        millis: u16,
    },
}

/// What a tick asks of the buses.
#[derive(Debug)]
pub struct TickOutput<'a> {
    /// To send, one a servo in the map's order; empty while the servos are looked for.
    pub goals: &'a [Goal],
    /// To do after the goals were sent.
    pub action: Option<Action>,
}

//! Servo buses: what the player asks of servos, whatever wire they hang on.
//!
//! [`ServoBus`] is implemented for Dynamixel protocol 2.0 and 1.0, Feetech, hobby servos by PWM and by PCA9685, and
//! the Blender live frame; [`JoinedBuses`](crate::joined::JoinedBuses) makes one bus of several.

use core::fmt;

/// Most servos on one bus of this crate.
pub const MAX_SERVOS: usize = 32;

/// Bit of [`Reading::hardware_error`]: the supply is outside its limits.
pub const ERROR_VOLTAGE: u8 = 1 << 0;
/// Bit of [`Reading::hardware_error`]: too hot.
pub const ERROR_HEAT: u8 = 1 << 2;
/// Bit of [`Reading::hardware_error`]: the position sensor fails.
pub const ERROR_ENCODER: u8 = 1 << 3;
/// Bit of [`Reading::hardware_error`]: electrical shock, too much current, or too little to move.
pub const ERROR_SHOCK: u8 = 1 << 4;
/// Bit of [`Reading::hardware_error`]: the load stayed above its limit.
pub const ERROR_OVERLOAD: u8 = 1 << 5;
/// Bit of [`Reading::hardware_error`]: the servo's own watchdog found the bus silent and refuses goals until
/// [`ServoBus::set_watchdog`] is called again. No bit of the servo's register 70.
pub const ERROR_WATCHDOG: u8 = 1 << 6;
/// Bit of [`Reading::hardware_error`]: the servo raised its alert without saying why. No bit of register 70.
pub const ERROR_ALERT: u8 = 1 << 7;

/// Where a servo shall go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Goal {
    /// Id of the servo, 0 to 252.
    pub id: u8,
    /// Goal position in the servo's goal units: 4096 a turn for Dynamixel X, MX(2.0) and Feetech STS; 1024 in 300° for
    /// AX and SCS; microseconds of pulse for hobby servos.
    pub position: i32,
}

/// What a servo told of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reading {
    /// Present position, in goal units of the servo.
    pub position: i32,
    /// Degrees Celsius.
    pub temperature: Option<u8>,
    /// Supply voltage.
    pub millivolts: Option<u16>,
    /// Load with its sign as the servo gives it: of a Dynamixel X its current in 2.69 mA (1 mA for XL330; load in
    /// 0.1 % for XL430), of all others load in 0.1 % of the greatest.
    pub load: Option<i16>,
    /// Bits `ERROR_*`: those of the Dynamixel register 70 and two more; 0 is none.
    pub hardware_error: u8,
    /// Whether the motor holds; after a servo's restart it does not.
    pub torque: Option<bool>,
}

/// Why an operation on a bus failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BusError {
    /// The port (UART, I2C, PWM) failed.
    Port,
    /// No answer within the reply timeout.
    NoReply,
    /// Bytes came, but no whole answer of the servo that was asked.
    Corrupt,
    /// The servo refused; its error number.
    Refused(u8),
    /// This bus or servo cannot do that.
    Unsupported,
    /// More servos than the bus has room for, or an index beyond them.
    TooMany,
}

impl fmt::Display for BusError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Port => f.write_str("the port of the servo bus failed"),
            Self::NoReply => f.write_str("the servo did not answer in time"),
            Self::Corrupt => f.write_str("the servo's answer was garbled"),
            Self::Refused(error) => write!(f, "the servo refused with error number {error}"),
            Self::Unsupported => f.write_str("this servo bus cannot do that"),
            Self::TooMany => f.write_str("more servos than this bus has room for"),
        }
    }
}

impl core::error::Error for BusError {}

/// A bus of servos.
///
/// `ids` are always the ids of all servos of this bus in the order of the joint map, and `index` counts into them:
/// joined buses may hold the same id twice. Every method returns
/// within a time that the bus states, however the wire behaves; after an error the next call finds the bus usable.
/// A cancelled call (a dropped future) leaves the bus usable too.
///
/// What is written here is a bus that only takes goals: it is not read, restarted or watched.
#[allow(async_fn_in_trait, reason = "one task owns the bus; nothing needs these futures to be Send")]
pub trait ServoBus {
    /// Whether this servo can be read back (hobby servos cannot). Where not, its readings stay `None`.
    fn reads(&self, _index: usize) -> bool {
        false
    }

    /// Asks one servo whether it is there. Where there is no reading back: always.
    ///
    /// # Errors
    /// [`BusError::NoReply`] when it is not.
    async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), BusError>;

    /// Turns the motor of one servo on or off; off, a joint falls. Confirmed by the servo where it can be.
    ///
    /// # Errors
    /// [`BusError`]; [`BusError::Refused`] is what a servo in hardware error says to "on".
    async fn set_torque(&mut self, ids: &[u8], index: usize, on: bool) -> Result<(), BusError>;

    /// Sends every servo its goal, in the order of `ids`; one packet where the protocol has one. Nothing answers.
    ///
    /// # Errors
    /// [`BusError::Port`] and [`BusError::TooMany`]: not all goals were sent.
    async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError>;

    /// Reads all servos. Every entry of `readings` (as long as `ids`) is overwritten, whatever is returned: a servo
    /// that kept silent or was garbled is `None`, the good answers of the others stay.
    ///
    /// # Errors
    /// Why, when servos that can be read were asked and none answered.
    async fn read_all(&mut self, _ids: &[u8], readings: &mut [Option<Reading>]) -> Result<(), BusError> {
        readings.fill(None);
        Ok(())
    }

    /// Restarts one servo, which clears its hardware errors. Its torque is then off and it stays silent for
    /// some 0.3 to 1 s; [`ping`](Self::ping) until it answers.
    ///
    /// # Errors
    /// [`BusError::Unsupported`] where servos cannot be restarted over the bus.
    async fn reboot(&mut self, _ids: &[u8], _index: usize) -> Result<(), BusError> {
        Err(BusError::Unsupported)
    }

    /// Sets the servos' own watchdog: after this long without a packet they stop by themselves. 0 disarms, and
    /// setting it revives those that have stopped. Rounded up to what the servo can count.
    ///
    /// # Errors
    /// [`BusError::Unsupported`] where servos have none.
    async fn set_watchdog(&mut self, _ids: &[u8], _millis: u16) -> Result<(), BusError> {
        Err(BusError::Unsupported)
    }

    /// Disarms the watchdog of one servo; confirmed by the servo.
    ///
    /// # Errors
    /// [`BusError::Unsupported`] where the servo has none.
    async fn disarm_watchdog(&mut self, _ids: &[u8], _index: usize) -> Result<(), BusError> {
        Err(BusError::Unsupported)
    }
}

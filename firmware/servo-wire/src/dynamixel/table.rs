//! Control table of the X series: where each value is and how many bytes it takes.
//!
//! Source: e-Manual, "XM430-W350", sections "Control Table of EEPROM Area" and "... of RAM Area". Values are little
//! endian; negative ones two's complement.

/// A value of the control table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Register {
    /// Address of the first byte.
    pub address: u16,
    /// Bytes: 1, 2 or 4.
    pub len: u16,
}

impl Register {
    const fn new(address: u16, len: u16) -> Self {
        Self { address, len }
    }
}

/// First address of the RAM area; below it is EEPROM, which cannot be written while torque is on.
pub const RAM_START: u16 = 64;

/// Positions in one turn.
pub const POSITIONS_PER_TURN: i32 = 4096;

/// Address of the first of 28 indirect addresses, 2 bytes each.
pub const INDIRECT_ADDRESS: u16 = 168;

/// Address of the first of 28 bytes that stand for what the indirect addresses name.
pub const INDIRECT_DATA: u16 = 224;

/// The same of the series XL330 and XC330, which have 20 indirect addresses.
pub(crate) const INDIRECT_DATA_X330: u16 = 208;

macro_rules! registers {
    ($($(#[$doc:meta])* $name:ident = $address:literal, $len:literal;)*) => {
        $($(#[$doc])* pub const $name: Register = Register::new($address, $len);)*
    };
}

registers! {
    /// Model number; 1020 is an XM430-W350.
    MODEL_NUMBER = 0, 2;
    /// Information about the model; undocumented.
    MODEL_INFORMATION = 2, 4;
    /// Version of the servo's firmware.
    FIRMWARE_VERSION = 6, 1;
    /// Id, 0 to 252.
    ID = 7, 1;
    /// Baud rate: 0 to 7 for 9600, 57600, 115200 bit/s, 1, 2, 3, 4, 4.5 Mbit/s.
    BAUD_RATE = 8, 1;
    /// Delay before an answer in 2 us.
    RETURN_DELAY_TIME = 9, 1;
    /// Bit 0 reverse direction, bit 2 time-based profile, bit 3 torque on by goal update.
    DRIVE_MODE = 10, 1;
    /// 0 current, 1 velocity, 3 position, 4 extended position, 5 current-based position, 16 PWM.
    OPERATING_MODE = 11, 1;
    /// Second id that is obeyed but does not answer; 253 and above: none.
    SECONDARY_ID = 12, 1;
    /// Protocol version.
    PROTOCOL_TYPE = 13, 1;
    /// Added to the measured position to give Present Position, in positions.
    HOMING_OFFSET = 20, 4;
    /// Velocity above which Moving is 1, in 0.229 rev/min.
    MOVING_THRESHOLD = 24, 4;
    /// Highest temperature in degrees Celsius.
    TEMPERATURE_LIMIT = 31, 1;
    /// Highest input voltage in 0.1 V.
    MAX_VOLTAGE_LIMIT = 32, 2;
    /// Lowest input voltage in 0.1 V.
    MIN_VOLTAGE_LIMIT = 34, 2;
    /// Highest PWM in 0.113 %.
    PWM_LIMIT = 36, 2;
    /// Highest current in 2.69 mA.
    CURRENT_LIMIT = 38, 2;
    /// Highest velocity in 0.229 rev/min.
    VELOCITY_LIMIT = 44, 4;
    /// Highest goal position in position mode.
    MAX_POSITION_LIMIT = 48, 4;
    /// Lowest goal position in position mode.
    MIN_POSITION_LIMIT = 52, 4;
    /// Which hardware errors turn torque off, a bit each.
    SHUTDOWN = 63, 1;
    /// 1: the motor holds and moves.
    TORQUE_ENABLE = 64, 1;
    /// 1: the light is on.
    LED = 65, 1;
    /// 0: only ping is answered, 1: ping and reads, 2: everything.
    STATUS_RETURN_LEVEL = 68, 1;
    /// 1: a Reg Write waits for its Action.
    REGISTERED_INSTRUCTION = 69, 1;
    /// Hardware errors: bit 0 voltage, 2 heat, 3 encoder, 4 electrical shock, 5 overload.
    HARDWARE_ERROR_STATUS = 70, 1;
    /// Integral gain of the velocity controller.
    VELOCITY_I_GAIN = 76, 2;
    /// Proportional gain of the velocity controller.
    VELOCITY_P_GAIN = 78, 2;
    /// Derivative gain of the position controller.
    POSITION_D_GAIN = 80, 2;
    /// Integral gain of the position controller.
    POSITION_I_GAIN = 82, 2;
    /// Proportional gain of the position controller.
    POSITION_P_GAIN = 84, 2;
    /// Feed-forward gain of the acceleration.
    FEEDFORWARD_2ND_GAIN = 88, 2;
    /// Feed-forward gain of the velocity.
    FEEDFORWARD_1ST_GAIN = 90, 2;
    /// Silence on the bus after which the servo stops, in 20 ms; 0 off, -1 it has stopped for this.
    BUS_WATCHDOG = 98, 1;
    /// Wanted PWM in 0.113 %.
    GOAL_PWM = 100, 2;
    /// Wanted current in 2.69 mA.
    GOAL_CURRENT = 102, 2;
    /// Wanted velocity in 0.229 rev/min.
    GOAL_VELOCITY = 104, 4;
    /// Acceleration of a move in 214.577 rev/min^2 (time-based: its time in ms); 0 is infinite.
    PROFILE_ACCELERATION = 108, 4;
    /// Velocity of a move in 0.229 rev/min (time-based: the move's time in ms); 0 is infinite.
    PROFILE_VELOCITY = 112, 4;
    /// Wanted position, 4096 a turn.
    GOAL_POSITION = 116, 4;
    /// Milliseconds, 0 to 32767 and round again.
    REALTIME_TICK = 120, 2;
    /// 1: faster than Moving Threshold.
    MOVING = 122, 1;
    /// Bit 0 in position, bit 1 profile under way, bits 4 and 5 kind of profile.
    MOVING_STATUS = 123, 1;
    /// Measured PWM.
    PRESENT_PWM = 124, 2;
    /// Measured current.
    PRESENT_CURRENT = 126, 2;
    /// Measured velocity in 0.229 rev/min.
    PRESENT_VELOCITY = 128, 4;
    /// Measured position, 4096 a turn.
    PRESENT_POSITION = 132, 4;
    /// Velocity that the profile wants now.
    VELOCITY_TRAJECTORY = 136, 4;
    /// Position that the profile wants now.
    POSITION_TRAJECTORY = 140, 4;
    /// Measured voltage in 0.1 V.
    PRESENT_INPUT_VOLTAGE = 144, 2;
    /// Measured temperature in degrees Celsius.
    PRESENT_TEMPERATURE = 146, 1;
}

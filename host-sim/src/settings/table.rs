//! The registers that decide how a servo moves, by what each one does.
//!
//! Sources: e-Manual, "XM430-W350", "XL330-M288", "AX-12A" and "MX-28" (protocol 1.0), sections "Control Table"; Feetech,
//! memory tables of "STS3215" and "SCSCL".

use firmware::map::BusKind;

/// What a register does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// How the servo is rated on its bus, as a number of its own.
    Baud,
    /// Delay before an answer, in 2 µs.
    ReturnDelay,
    /// What a goal is: a position, a velocity and so on.
    Mode,
    /// Which way is positive, and how a move is timed.
    Drive,
    /// A second id that it obeys.
    SecondaryId,
    /// What is added to its positions.
    Homing,
    /// The lowest position that it takes.
    MinPosition,
    /// The highest position that it takes.
    MaxPosition,
    /// Highest supply; of no servo 0.
    MaxVoltage,
    /// The torque that it may use from power on.
    MaxTorque,
    /// The torque that it may use now.
    TorqueLimit,
    /// The power that it may use in each goal.
    PwmLimit,
    /// The power that it may use now.
    GoalPwm,
    /// The greatest current.
    CurrentLimit,
    /// The current that it may use now, in modes that have one.
    GoalCurrent,
    /// Which instructions it answers.
    ReturnLevel,
    /// Whether the motor holds.
    Torque,
    /// What it has stopped for.
    HardwareError,
    /// Gain of the position controller; of a servo that has one never 0.
    Gain,
    /// Silence after which it stops.
    Watchdog,
    /// Acceleration of a move.
    Acceleration,
    /// Velocity of a move.
    Velocity,
    /// Time of a move.
    Time,
    /// Whether its EEPROM can be written.
    Lock,
    /// Where it is.
    Position,
}

/// How a register writes numbers below 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// It has none.
    None,
    /// As two's complement.
    Complement,
    /// By the bit with this number, and the size below it.
    Bit(u32),
}

/// A register.
#[derive(Clone, Copy, Debug)]
pub struct Register {
    /// What it does.
    pub role: Role,
    /// Its name in the manual.
    pub name: &'static str,
    /// Address of its first byte.
    pub address: u16,
    /// Bytes.
    pub len: u16,
    /// How it writes negative numbers.
    pub sign: Sign,
}

const fn plain(role: Role, name: &'static str, address: u16, len: u16) -> Register {
    Register { role, name, address, len, sign: Sign::None }
}

const fn signed(role: Role, name: &'static str, address: u16, len: u16, sign: Sign) -> Register {
    Register { role, name, address, len, sign }
}

/// Dynamixel X, and MX with protocol 2.0.
const X: [Register; 20] = [
    plain(Role::Baud, "Baud Rate", 8, 1),
    plain(Role::ReturnDelay, "Return Delay Time", 9, 1),
    plain(Role::Drive, "Drive Mode", 10, 1),
    plain(Role::Mode, "Operating Mode", 11, 1),
    plain(Role::SecondaryId, "Secondary ID", 12, 1),
    signed(Role::Homing, "Homing Offset", 20, 4, Sign::Complement),
    plain(Role::PwmLimit, "PWM Limit", 36, 2),
    plain(Role::CurrentLimit, "Current Limit", 38, 2),
    plain(Role::MaxPosition, "Max Position Limit", 48, 4),
    plain(Role::MinPosition, "Min Position Limit", 52, 4),
    plain(Role::Torque, "Torque Enable", 64, 1),
    plain(Role::ReturnLevel, "Status Return Level", 68, 1),
    plain(Role::HardwareError, "Hardware Error Status", 70, 1),
    plain(Role::Gain, "Position P Gain", 84, 2),
    plain(Role::Watchdog, "Bus Watchdog", 98, 1),
    plain(Role::GoalPwm, "Goal PWM", 100, 2),
    signed(Role::GoalCurrent, "Goal Current", 102, 2, Sign::Complement),
    plain(Role::Acceleration, "Profile Acceleration", 108, 4),
    plain(Role::Velocity, "Profile Velocity", 112, 4),
    signed(Role::Position, "Present Position", 132, 4, Sign::Complement),
];

/// Dynamixel AX, and MX with protocol 1.0.
const DYNAMIXEL1: [Register; 11] = [
    plain(Role::Baud, "Baud Rate", 4, 1),
    plain(Role::ReturnDelay, "Return Delay Time", 5, 1),
    plain(Role::MinPosition, "CW Angle Limit", 6, 2),
    plain(Role::MaxPosition, "CCW Angle Limit", 8, 2),
    plain(Role::MaxTorque, "Max Torque", 14, 2),
    plain(Role::ReturnLevel, "Status Return Level", 16, 1),
    plain(Role::Torque, "Torque Enable", 24, 1),
    plain(Role::Velocity, "Moving Speed", 32, 2),
    plain(Role::TorqueLimit, "Torque Limit", 34, 2),
    signed(Role::Position, "Present Position", 36, 2, Sign::Complement),
    plain(Role::Lock, "Lock", 47, 1),
];

/// Feetech STS and SMS.
const STS: [Register; 16] = [
    plain(Role::Baud, "Baud Rate", 6, 1),
    plain(Role::ReturnDelay, "Return Delay", 7, 1),
    plain(Role::ReturnLevel, "Response Status Level", 8, 1),
    signed(Role::MinPosition, "Min Angle Limit", 9, 2, Sign::Bit(15)),
    signed(Role::MaxPosition, "Max Angle Limit", 11, 2, Sign::Bit(15)),
    plain(Role::MaxVoltage, "Max Input Voltage", 14, 1),
    plain(Role::MaxTorque, "Max Torque", 16, 2),
    signed(Role::Homing, "Position Correction", 31, 2, Sign::Bit(11)),
    plain(Role::Mode, "Operation Mode", 33, 1),
    plain(Role::Torque, "Torque Enable", 40, 1),
    plain(Role::Acceleration, "Acceleration", 41, 1),
    plain(Role::Time, "Goal Time", 44, 2),
    signed(Role::Velocity, "Goal Speed", 46, 2, Sign::Bit(15)),
    plain(Role::TorqueLimit, "Torque Limit", 48, 2),
    plain(Role::Lock, "Lock", 55, 1),
    signed(Role::Position, "Present Position", 56, 2, Sign::Bit(15)),
];

/// Feetech SCS, whose numbers have their high byte first.
const SCS: [Register; 12] = [
    plain(Role::Baud, "Baud Rate", 6, 1),
    plain(Role::ReturnDelay, "Return Delay", 7, 1),
    plain(Role::ReturnLevel, "Response Status Level", 8, 1),
    plain(Role::MinPosition, "Min Angle Limit", 9, 2),
    plain(Role::MaxPosition, "Max Angle Limit", 11, 2),
    plain(Role::MaxVoltage, "Max Input Voltage", 14, 1),
    plain(Role::MaxTorque, "Max Torque", 16, 2),
    plain(Role::Torque, "Torque Enable", 40, 1),
    plain(Role::Time, "Goal Time", 44, 2),
    plain(Role::Velocity, "Goal Speed", 46, 2),
    plain(Role::Lock, "Lock", 48, 1),
    plain(Role::Position, "Present Position", 56, 2),
];

/// The registers of the servos on a kind of bus; none where they cannot be read.
#[must_use]
pub const fn registers(kind: BusKind) -> &'static [Register] {
    match kind {
        BusKind::Dynamixel => &X,
        BusKind::Dynamixel1 => &DYNAMIXEL1,
        BusKind::Sts => &STS,
        BusKind::Scs => &SCS,
        BusKind::Pwm | BusKind::Pca9685 | BusKind::Blender => &[],
    }
}

/// What tells who a servo is: its model number and its firmware.
const fn identity(kind: BusKind) -> [(&'static str, u16); 2] {
    const MODEL: &str = "Model Number";
    const FIRMWARE: &str = "Firmware Version";
    match kind {
        BusKind::Dynamixel => [(MODEL, 0), (FIRMWARE, 6)],
        BusKind::Dynamixel1 => [(MODEL, 0), (FIRMWARE, 2)],
        _ => [(MODEL, 3), (FIRMWARE, 0)],
    }
}

/// The registers that have a name here, as words joined by "-" in small letters.
pub fn register_names(kind: BusKind) -> impl Iterator<Item = String> {
    named(kind).map(|(name, _)| name)
}

fn named(kind: BusKind) -> impl Iterator<Item = (String, u16)> {
    let settings = registers(kind).iter().map(|register| (register.name, register.address));
    let all = identity(kind).into_iter().chain(settings);
    all.map(|(name, address)| (name.to_lowercase().replace(' ', "-"), address))
}

/// The address of a register by its name, or by the address itself.
#[must_use]
pub fn address_of(kind: BusKind, register: &str) -> Option<u16> {
    let wanted = register.to_lowercase().replace([' ', '_'], "-");
    let found = named(kind).find(|(name, _)| *name == wanted).map(|(_, address)| address);
    found.or_else(|| wanted.parse().ok())
}

/// What is read of a servo at once: first address and bytes.
pub(super) const fn blocks(kind: BusKind) -> &'static [(u16, u16)] {
    match kind {
        BusKind::Dynamixel => &[(0, 64), (64, 72)],
        BusKind::Dynamixel1 => &[(0, 50)],
        BusKind::Sts | BusKind::Scs => &[(0, 40), (40, 18)],
        BusKind::Pwm | BusKind::Pca9685 | BusKind::Blender => &[],
    }
}

/// Where the EEPROM ends, which keeps its values without power.
pub(super) const fn eeprom_end(kind: BusKind) -> u16 {
    match kind {
        BusKind::Dynamixel => 64,
        BusKind::Dynamixel1 => 24,
        _ => 40,
    }
}

impl Register {
    /// The number in its bytes.
    pub(super) fn value(&self, kind: BusKind, bytes: &[u8]) -> i64 {
        let join = |value: i64, byte: &u8| value << 8 | i64::from(*byte);
        let value = match kind {
            BusKind::Scs => bytes.iter().fold(0, join),
            _ => bytes.iter().rev().fold(0, join),
        };
        let bits = 8 * u32::from(self.len);
        match self.sign {
            Sign::None => value,
            Sign::Complement if value >> (bits - 1) != 0 => value - (1 << bits),
            Sign::Complement => value,
            Sign::Bit(bit) if value >> bit & 1 != 0 => -(value & ((1 << bit) - 1)),
            Sign::Bit(bit) => value & ((1 << bit) - 1),
        }
    }

    /// The bytes of a number that is 0 or more.
    pub(super) fn bytes(&self, kind: BusKind, value: i64) -> Vec<u8> {
        let mut bytes = value.to_le_bytes()[..usize::from(self.len)].to_vec();
        if kind == BusKind::Scs {
            bytes.reverse();
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each register lies within what is read at once.
    #[test]
    fn the_blocks_hold_the_registers() {
        for kind in [BusKind::Dynamixel, BusKind::Dynamixel1, BusKind::Sts, BusKind::Scs] {
            for Register { name, address, len, .. } in registers(kind) {
                let within =
                    |(start, count): &(u16, u16)| *address >= *start && address + len <= start + count;
                assert!(blocks(kind).iter().any(within), "{name} of {kind:?}");
            }
        }
    }

    #[test]
    fn numbers_have_the_order_and_the_sign_of_their_servo() {
        let find = |kind, role| registers(kind).iter().find(|register| register.role == role).unwrap();
        let homing = find(BusKind::Dynamixel, Role::Homing);
        assert_eq!(homing.value(BusKind::Dynamixel, &[0xFE, 0xFF, 0xFF, 0xFF]), -2);
        let correction = find(BusKind::Sts, Role::Homing);
        assert_eq!(correction.value(BusKind::Sts, &[5, 8]), -5);
        let limit = find(BusKind::Scs, Role::MaxPosition);
        assert_eq!(
            (limit.value(BusKind::Scs, &[3, 255]), limit.bytes(BusKind::Scs, 1023)),
            (1023, vec![3, 255])
        );
    }
}

//! Control table of an XM430-W350: what each value is at first, what it may be and who may write it.
//!
//! Source: e-Manual, "XM430-W350", sections "Control Table of EEPROM Area" and "... of RAM Area".

use servo_wire::dynamixel::table::{self, Register};

/// Addresses `0..SIZE` can be read.
pub(crate) const SIZE: usize = 662;

/// First firmware that has fast sync read is 45.
const FIRMWARE_VERSION: i64 = 46;

/// No-load speed at 12 V, 46 rev/min, in positions per second.
pub(crate) const MOTOR_SPEED: f64 = 46.0 / 60.0 * 4096.0;

/// One unit of velocity, 0.229 rev/min, in positions per second.
pub(crate) const VELOCITY_UNIT: f64 = 0.229 / 60.0 * 4096.0;

/// One unit of acceleration, 214.577 rev/min^2, in positions per second squared.
pub(crate) const ACCELERATION_UNIT: f64 = 214.577 / 3600.0 * 4096.0;

/// Voltage at the servo, in 0.1 V.
pub(crate) const INPUT_VOLTAGE: i64 = 120;

/// Temperature of the servo in degrees Celsius.
pub(crate) const TEMPERATURE: i64 = 30;

/// Farthest goal in extended and current-based position mode: 256 turns.
pub(crate) const MULTI_TURN_LIMIT: i64 = 1_048_575;

/// One value of the control table.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Entry {
    pub register: Register,
    pub writable: bool,
    /// Value at the factory; RAM returns to it at every start.
    pub default: i64,
    /// Values that may be written; a register is signed when `min` is negative.
    pub min: i64,
    pub max: i64,
}

const fn rw(register: Register, default: i64, min: i64, max: i64) -> Entry {
    Entry { register, writable: true, default, min, max }
}

/// Read only; signed values have a negative `min`.
const fn ro(register: Register, default: i64, min: i64) -> Entry {
    Entry { register, writable: false, default, min, max: i64::MAX }
}

const SIGNED: i64 = i32::MIN as i64;

/// Current control (mode 0) and PWM control (mode 16) are not simulated and cannot be chosen; limits that refer to
/// other registers are checked in `servo`. The manual gives 110 to 300 for the voltage limits, which excludes its
/// own defaults; here it is the servo's range of 9.5 to 16 V.
const ENTRIES: &[Entry] = &[
    ro(table::MODEL_NUMBER, 1020, 0),
    ro(table::MODEL_INFORMATION, 0, 0),
    ro(table::FIRMWARE_VERSION, FIRMWARE_VERSION, 0),
    rw(table::ID, 1, 0, 252),
    rw(table::BAUD_RATE, 1, 0, 7),
    rw(table::RETURN_DELAY_TIME, 250, 0, 254),
    rw(table::DRIVE_MODE, 0, 0, 13),
    rw(table::OPERATING_MODE, 3, 1, 5),
    rw(table::SECONDARY_ID, 255, 0, 255),
    rw(table::PROTOCOL_TYPE, 2, 2, 2),
    rw(table::HOMING_OFFSET, 0, -1_044_479, 1_044_479),
    rw(table::MOVING_THRESHOLD, 10, 0, 1023),
    rw(table::TEMPERATURE_LIMIT, 80, 0, 100),
    rw(table::MAX_VOLTAGE_LIMIT, 160, 95, 160),
    rw(table::MIN_VOLTAGE_LIMIT, 95, 95, 160),
    rw(table::PWM_LIMIT, 885, 0, 885),
    rw(table::CURRENT_LIMIT, 1193, 0, 1193),
    rw(table::VELOCITY_LIMIT, 200, 0, 1023),
    rw(table::MAX_POSITION_LIMIT, 4095, 0, 4095),
    rw(table::MIN_POSITION_LIMIT, 0, 0, 4095),
    rw(table::SHUTDOWN, 52, 0, 63),
    rw(table::TORQUE_ENABLE, 0, 0, 1),
    rw(table::LED, 0, 0, 1),
    rw(table::STATUS_RETURN_LEVEL, 2, 0, 2),
    ro(table::REGISTERED_INSTRUCTION, 0, 0),
    ro(table::HARDWARE_ERROR_STATUS, 0, 0),
    rw(table::VELOCITY_I_GAIN, 1920, 0, 16_383),
    rw(table::VELOCITY_P_GAIN, 100, 0, 16_383),
    rw(table::POSITION_D_GAIN, 0, 0, 16_383),
    rw(table::POSITION_I_GAIN, 0, 0, 16_383),
    rw(table::POSITION_P_GAIN, 800, 0, 16_383),
    rw(table::FEEDFORWARD_2ND_GAIN, 0, 0, 16_383),
    rw(table::FEEDFORWARD_1ST_GAIN, 0, 0, 16_383),
    rw(table::BUS_WATCHDOG, 0, 0, 127),
    rw(table::GOAL_PWM, 885, -885, 885),
    rw(table::GOAL_CURRENT, 1193, -1193, 1193),
    rw(table::GOAL_VELOCITY, 0, -1023, 1023),
    rw(table::PROFILE_ACCELERATION, 0, 0, 32_767),
    rw(table::PROFILE_VELOCITY, 0, 0, 32_767),
    rw(table::GOAL_POSITION, 0, -MULTI_TURN_LIMIT, MULTI_TURN_LIMIT),
    ro(table::REALTIME_TICK, 0, 0),
    ro(table::MOVING, 0, 0),
    ro(table::MOVING_STATUS, 0, 0),
    ro(table::PRESENT_PWM, 0, SIGNED),
    ro(table::PRESENT_CURRENT, 0, SIGNED),
    ro(table::PRESENT_VELOCITY, 0, SIGNED),
    ro(table::PRESENT_POSITION, 0, SIGNED),
    ro(table::VELOCITY_TRAJECTORY, 0, SIGNED),
    ro(table::POSITION_TRAJECTORY, 0, SIGNED),
    ro(table::PRESENT_INPUT_VOLTAGE, INPUT_VOLTAGE, 0),
    ro(table::PRESENT_TEMPERATURE, TEMPERATURE, 0),
];

/// Indirect addresses (2 bytes each) from the first number on, and the data (1 byte each) from the second on that they
/// lead to: so many.
type Indirect = (u16, u16, u16);

/// Which table a servo has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Layout {
    /// That of an XM430-W350, and of most of the X series.
    X,
    /// That of XL330 and XC330, whose indirect data lie elsewhere. What else is different is not simulated.
    X330,
}

impl Layout {
    /// The table of the servos with this model number.
    pub const fn of(model: i64) -> Self {
        match model {
            1190 | 1200 | 1210 | 1220 | 1230 | 1240 => Self::X330,
            _ => Self::X,
        }
    }

    const fn indirect(self) -> &'static [Indirect] {
        match self {
            Self::X => &[(168, 224, 28), (578, 634, 28)],
            Self::X330 => &[(168, 208, 20)],
        }
    }

    /// All values of the table, in order of address within each kind.
    pub fn entries(self) -> impl Iterator<Item = Entry> {
        let indirect = self.indirect().iter().flat_map(|&(addresses, data, count)| {
            (0..count).flat_map(move |i| {
                let address = Register { address: addresses + 2 * i, len: 2 };
                let byte = Register { address: data + i, len: 1 };
                [rw(address, i64::from(data + i), 64, 661), rw(byte, 0, 0, 255)]
            })
        });
        ENTRIES.iter().copied().chain(indirect)
    }

    /// The value whose first byte is at `address`.
    pub fn entry_at(self, address: u16) -> Option<Entry> {
        self.entries().find(|entry| entry.register.address == address)
    }

    /// The register that says which address the indirect data at `address` stands for.
    pub fn indirect_address(self, address: u16) -> Option<Register> {
        self.indirect()
            .iter()
            .find(|&&(_, data, count)| (data..data + count).contains(&address))
            .map(|&(addresses, data, _)| Register { address: addresses + 2 * (address - data), len: 2 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_do_not_overlap_and_hold_their_defaults() {
        for layout in [Layout::X, Layout::X330] {
            let mut used = [false; SIZE];
            for entry in layout.entries() {
                let Register { address, len } = entry.register;
                for byte in address..address + len {
                    assert!(!std::mem::replace(&mut used[usize::from(byte)], true), "{byte} is used twice");
                }
                let in_range = (entry.min..=entry.max).contains(&entry.default);
                assert!(in_range, "the default at {address} is out of range");
            }
        }
    }

    #[test]
    fn indirect_data_stand_for_themselves_at_first() {
        for (data, register) in [(224, 168), (251, 222), (634, 578), (661, 632)] {
            assert_eq!(Layout::X.indirect_address(data).map(|register| register.address), Some(register));
            assert_eq!(Layout::X.entry_at(register).unwrap().default, i64::from(data));
        }
        assert_eq!(Layout::X.indirect_address(252), None);
        let of_x330 = |data| Layout::X330.indirect_address(data).map(|register| register.address);
        assert_eq!([208, 227, 228].map(of_x330), [Some(168), Some(206), None]);
    }
}

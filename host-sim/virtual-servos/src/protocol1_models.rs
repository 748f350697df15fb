//! The control tables of servos that speak the frame of protocol 1.0.
//!
//! Sources: e-Manual, "AX-12A" and "MX-28" (protocol 1.0); Feetech, memory tables of "STS3215" and of the SCS
//! series, whose lock is at 48. What nothing here acts on (gains, speeds, a torque limit above 0) can be written and
//! read, and has no effect.

/// Registers that lie one behind the other: where, how many bytes each, what they are at first.
pub(crate) struct Register {
    pub at: u8,
    pub len: u8,
    pub value: u16,
    pub writable: bool,
}

const fn ro(at: u8, len: u8, value: u16) -> Register {
    Register { at, len, value, writable: false }
}

const fn rw(at: u8, len: u8, value: u16) -> Register {
    Register { at, len, value, writable: true }
}

/// Kinds of servos of which each has a protocol of its own in the frame of protocol 1.0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol1Family {
    /// Dynamixel AX, and MX with protocol 1.0.
    AxMx,
    /// Feetech STS and SMS.
    Sts,
    /// Feetech SCS.
    Scs,
}

/// A model of servo.
pub(crate) struct Model {
    /// Its model number unless a bus is told another one.
    pub number: u16,
    /// Positions are 0 to this.
    pub most: i32,
    /// Positions a second at full speed.
    pub speed: f64,
    /// Whether numbers have their high byte first.
    pub big_endian: bool,
    /// Whether it is one of Feetech's: it can be restarted, its error byte never says that it was asked wrongly, and
    /// goals beyond its limits are brought to them.
    pub feetech: bool,
    /// Whether several can be read at once.
    pub sync_read: bool,
    /// Bytes of the table, and where those begin that are forgotten without power.
    pub len: usize,
    pub ram: usize,
    pub model_at: u8,
    pub id_at: u8,
    /// Status return level, and which one has it answer writes as well.
    pub level_at: u8,
    pub level_all: u8,
    /// Lowest and highest position.
    pub limits_at: u8,
    pub torque_at: u8,
    /// Where it says how much of its torque it may use.
    pub torque_limit_at: u8,
    /// Where it says whether it takes positions, by 0; `None` where position limits of 0 and 0 say that it does not.
    pub mode_at: Option<u8>,
    pub goal_at: u8,
    pub present_at: u8,
    pub moving_at: u8,
    /// Where it says, by 1, that what is written to the EEPROM is forgotten without power; `None` where it is always kept.
    pub lock_at: Option<u8>,
    pub registers: &'static [Register],
}

const DYNAMIXEL: [Register; 27] = [
    ro(0, 2, 0),
    ro(2, 1, 24),
    rw(3, 1, 1),
    rw(4, 1, 1),
    rw(5, 1, 250),
    rw(6, 2, 0),
    rw(8, 2, 0),
    rw(11, 1, 70),
    rw(12, 1, 60),
    rw(13, 1, 140),
    rw(14, 2, 1023),
    rw(16, 1, 2),
    rw(17, 1, 36),
    rw(18, 1, 36),
    rw(24, 1, 0),
    rw(25, 1, 0),
    // Margins and slopes of an AX, gains of an MX.
    rw(26, 4, 0),
    rw(30, 2, 0),
    rw(32, 2, 0),
    rw(34, 2, 1023),
    ro(36, 6, 0),
    ro(42, 1, 120),
    ro(43, 1, 30),
    ro(44, 1, 0),
    ro(46, 1, 0),
    rw(47, 1, 0),
    rw(48, 2, 32),
];

const AX: Model = Model {
    number: 12,
    most: 1023,
    // 59 turns a minute at 12 V, 1024 in 300°.
    speed: 59.0 / 60.0 * 1024.0 * 1.2,
    big_endian: false,
    feetech: false,
    sync_read: false,
    len: 50,
    ram: 24,
    model_at: 0,
    id_at: 3,
    level_at: 16,
    level_all: 2,
    limits_at: 6,
    torque_at: 24,
    torque_limit_at: 34,
    mode_at: None,
    goal_at: 30,
    present_at: 36,
    moving_at: 46,
    lock_at: None,
    registers: &DYNAMIXEL,
};

/// 55 turns a minute at 12 V.
const MX: Model = Model { number: 29, most: 4095, speed: 55.0 / 60.0 * 4096.0, ..AX };

const STS_TABLE: [Register; 24] = [
    ro(0, 1, 3),
    ro(1, 1, 10),
    ro(2, 1, 0),
    ro(3, 2, 0),
    rw(5, 1, 1),
    rw(6, 1, 0),
    rw(7, 1, 0),
    rw(8, 1, 1),
    rw(9, 2, 0),
    rw(11, 2, 0),
    rw(13, 1, 70),
    rw(14, 1, 80),
    rw(15, 1, 40),
    rw(16, 2, 1000),
    rw(33, 1, 0),
    rw(40, 2, 0),
    rw(42, 2, 0),
    rw(44, 2, 0),
    rw(46, 2, 0),
    rw(48, 2, 1000),
    rw(55, 1, 1),
    ro(56, 6, 0),
    ro(62, 1, 74),
    ro(63, 7, 30),
];

const SCS_TABLE: [Register; 23] = [
    ro(0, 1, 3),
    ro(1, 1, 10),
    ro(2, 1, 0),
    ro(3, 2, 0),
    rw(5, 1, 1),
    rw(6, 1, 0),
    rw(7, 1, 0),
    rw(8, 1, 1),
    rw(9, 2, 0),
    rw(11, 2, 0),
    rw(13, 1, 70),
    rw(14, 1, 80),
    rw(15, 1, 40),
    rw(16, 2, 1000),
    rw(33, 1, 0),
    rw(40, 2, 0),
    rw(42, 2, 0),
    rw(44, 2, 0),
    rw(46, 2, 0),
    rw(48, 1, 1),
    ro(56, 6, 0),
    ro(62, 1, 74),
    ro(63, 7, 30),
];

const STS: Model = Model {
    number: 777,
    most: 4095,
    // 60° in 0.222 s at 6 V.
    speed: 4096.0 / 6.0 / 0.222,
    big_endian: false,
    feetech: true,
    sync_read: true,
    len: 71,
    ram: 40,
    model_at: 3,
    id_at: 5,
    level_at: 8,
    level_all: 1,
    limits_at: 9,
    torque_at: 40,
    torque_limit_at: 48,
    mode_at: Some(33),
    goal_at: 42,
    present_at: 56,
    moving_at: 66,
    lock_at: Some(55),
    registers: &STS_TABLE,
};

/// An SCS0009 but for its number: 60° in 0.1 s at 6 V. The usual SCS has 1024 in 200°, and its number is not known here.
const SCS: Model = Model {
    number: 0,
    most: 1023,
    speed: 1024.0 / 5.0 / 0.1,
    big_endian: true,
    sync_read: false,
    // It has no other: its Max Torque.
    torque_limit_at: 16,
    mode_at: None,
    lock_at: Some(48),
    registers: &SCS_TABLE,
    ..STS
};

impl Protocol1Family {
    /// Highest position of a servo of this family with this model number: positions are 0 to this.
    #[must_use]
    pub const fn max_position(self, number: Option<u16>) -> i32 {
        Model::of(self, number).most
    }
}

impl Model {
    /// The model of this family with this model number; without one, the usual model of the family.
    pub const fn of(family: Protocol1Family, number: Option<u16>) -> &'static Self {
        match (family, number) {
            (Protocol1Family::AxMx, Some(29 | 310 | 320 | 360)) => &MX,
            (Protocol1Family::AxMx, _) => &AX,
            (Protocol1Family::Sts, _) => &STS,
            (Protocol1Family::Scs, _) => &SCS,
        }
    }

    /// A number as the servo writes it.
    pub const fn bytes(&self, value: u16) -> [u8; 2] {
        if self.big_endian { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    /// A number that the servo was written.
    pub const fn value(&self, bytes: [u8; 2]) -> u16 {
        if self.big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) }
    }
}

//! Instruction codes, error numbers and ids (e-Manual, "Instruction Packet" and "Status Packet").

/// Highest id that a servo can have.
pub const MAX_ID: u8 = 252;

/// Id that addresses every servo on the bus.
pub const BROADCAST_ID: u8 = 254;

/// Bit of the error byte that says "read Hardware Error Status (70)"; the other seven are the error number.
pub const ALERT: u8 = 0x80;

/// What a packet asks for, or [`Instruction::Status`] for an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Instruction {
    /// Is there a servo; answers model number (2 bytes) and firmware version (1 byte).
    Ping = 0x01,
    /// Address (2), length (2); answers the bytes.
    Read = 0x02,
    /// Address (2), bytes.
    Write = 0x03,
    /// As write, but carried out by [`Instruction::Action`].
    RegWrite = 0x04,
    /// Carry out what [`Instruction::RegWrite`] registered.
    Action = 0x05,
    /// Back to factory defaults: 0xFF all, 0x01 all but the id, 0x02 all but id and baud rate.
    FactoryReset = 0x06,
    /// Restart; the RAM area returns to its defaults.
    Reboot = 0x08,
    /// 0x01 and a fixed key: bring Present Position back into one turn.
    Clear = 0x10,
    /// An answer: error byte, then parameters.
    Status = 0x55,
    /// Address (2), length (2), ids; each servo answers in this order.
    SyncRead = 0x82,
    /// Address (2), length (2), then id and bytes per servo; no answer.
    SyncWrite = 0x83,
    /// As sync read, answered by one joint status packet without byte stuffing.
    FastSyncRead = 0x8A,
    /// Id (1), address (2), length (2) per servo; each servo answers in this order.
    BulkRead = 0x92,
    /// Id (1), address (2), length (2), bytes per servo; no answer.
    BulkWrite = 0x93,
    /// As bulk read, answered by one joint status packet without byte stuffing.
    FastBulkRead = 0x9A,
}

impl Instruction {
    /// The instruction with this code, if protocol 2.0 has one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Self> {
        use Instruction::*;
        const ALL: [Instruction; 15] = [
            Ping,
            Read,
            Write,
            RegWrite,
            Action,
            FactoryReset,
            Reboot,
            Clear,
            Status,
            SyncRead,
            SyncWrite,
            FastSyncRead,
            BulkRead,
            BulkWrite,
            FastBulkRead,
        ];
        ALL.into_iter().find(|instruction| *instruction as u8 == code)
    }
}

/// Why a servo did not do what it was told; 0 in the packet means that it did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum ErrorNumber {
    /// The instruction could not be processed.
    ResultFail = 1,
    /// Unknown instruction, or Action without a registered write.
    Instruction = 2,
    /// The packet's checksum does not match.
    Crc = 3,
    /// A value outside the range of its address.
    DataRange = 4,
    /// Fewer bytes than the address holds.
    DataLength = 5,
    /// A value outside a configured limit (position, velocity, current, PWM).
    DataLimit = 6,
    /// No such address, a read-only address, or EEPROM while torque is on.
    Access = 7,
}

impl ErrorNumber {
    /// The error in an error byte, whatever its [`ALERT`] bit; `None` for 0 and for numbers that do not exist.
    #[must_use]
    pub fn from_error_byte(byte: u8) -> Option<Self> {
        use ErrorNumber::*;
        const ALL: [ErrorNumber; 7] =
            [ResultFail, Instruction, Crc, DataRange, DataLength, DataLimit, Access];
        ALL.into_iter().find(|number| *number as u8 == byte & !ALERT)
    }
}

#[cfg(test)]
mod tests {
    use super::{ALERT, ErrorNumber, Instruction};

    #[test]
    fn codes_go_there_and_back() {
        let known: Vec<Instruction> = (0..=255).filter_map(Instruction::from_code).collect();
        assert_eq!(known.len(), 15);
        assert!(known.iter().all(|&i| Instruction::from_code(i as u8) == Some(i)));
        assert_eq!(Instruction::from_code(0x20), None);
    }

    #[test]
    fn the_alert_bit_is_not_an_error() {
        assert_eq!(ErrorNumber::from_error_byte(ALERT), None);
        assert_eq!(ErrorNumber::from_error_byte(ALERT | 7), Some(ErrorNumber::Access));
        assert_eq!(ErrorNumber::from_error_byte(8), None);
    }
}

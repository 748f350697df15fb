//! The control table as bytes, with its rules for reading and writing.

use crate::control_table::{Entry, Layout, SIZE};
use servo_wire::dynamixel::ErrorNumber;
use servo_wire::dynamixel::table::{RAM_START, Register};

/// One servo's control table.
#[derive(Clone)]
pub(crate) struct Memory {
    bytes: [u8; SIZE],
    layout: Layout,
}

/// A value about to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Change {
    pub register: Register,
    pub value: i64,
}

impl Memory {
    /// As it leaves the factory.
    pub fn new(layout: Layout) -> Self {
        let mut memory = Self { bytes: [0; SIZE], layout };
        for entry in layout.entries() {
            memory.set(entry.register, entry.default);
        }
        memory
    }

    /// The same values in the table of another model.
    pub fn in_layout(&self, layout: Layout) -> Self {
        let mut memory = Self::new(layout);
        memory.bytes[..168].copy_from_slice(&self.bytes[..168]);
        memory
    }

    /// Which table it is.
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// RAM as after power on; EEPROM as it was.
    pub fn restart(&mut self) {
        let start = usize::from(RAM_START);
        self.bytes[start..].copy_from_slice(&Self::new(self.layout).bytes[start..]);
    }

    /// The value of a register, signed where the model says so.
    pub fn get(&self, register: Register) -> i64 {
        let signed = self.layout.entry_at(register.address).is_some_and(|entry| entry.min < 0);
        value(self.raw(register.address, register.len), signed)
    }

    /// Sets a register, whatever its access; the value is cut to its length.
    pub fn set(&mut self, register: Register, value: i64) {
        let start = usize::from(register.address);
        let len = usize::from(register.len);
        self.bytes[start..start + len].copy_from_slice(&value.to_le_bytes()[..len]);
    }

    fn raw(&self, address: u16, len: u16) -> &[u8] {
        &self.bytes[usize::from(address)..usize::from(address + len)]
    }

    /// Where the byte at `address` really is: indirect data may lie elsewhere.
    fn resolve(&self, address: u16) -> u16 {
        match self.layout.indirect_address(address) {
            Some(register) => {
                u16::from_le_bytes([self.raw(register.address, 2)[0], self.raw(register.address, 2)[1]])
            }
            None => address,
        }
    }

    /// The bytes `address..address + len`.
    ///
    /// Bytes between registers read as 0, as when a client reads a whole block.
    ///
    /// # Errors
    /// `Access` beyond the table or where no byte belongs to a register, `DataLength` for no bytes.
    pub fn read(&self, address: u16, len: u16) -> Result<Vec<u8>, ErrorNumber> {
        if len == 0 {
            return Err(ErrorNumber::DataLength);
        }
        let end = usize::from(address) + usize::from(len);
        if end > SIZE {
            return Err(ErrorNumber::Access);
        }
        let range = address..address + len;
        let defined = self.layout.entries().any(|Entry { register, .. }| {
            register.address < range.end && range.start < register.address + register.len
        });
        if !defined {
            return Err(ErrorNumber::Access);
        }
        Ok(range.map(|address| self.bytes[usize::from(self.resolve(address))]).collect())
    }

    /// The registers that writing `data` at `address` changes, in order. `locked`: EEPROM may not be written.
    ///
    /// # Errors
    /// `Access` for an address that is no register's first, is read only, or is locked; `DataLength` when `data` ends
    /// within a register; `DataRange` for a value outside the register's range.
    pub fn changes(&self, address: u16, data: &[u8], locked: bool) -> Result<Vec<Change>, ErrorNumber> {
        if data.is_empty() {
            return Err(ErrorNumber::DataLength);
        }
        if usize::from(address) + data.len() > SIZE {
            return Err(ErrorNumber::Access);
        }
        let targets: Vec<u16> = (address..).take(data.len()).map(|address| self.resolve(address)).collect();
        let mut changes = Vec::new();
        let mut at = 0;
        while let Some(&target) = targets.get(at) {
            let entry = self.layout.entry_at(target).ok_or(ErrorNumber::Access)?;
            if !entry.writable || (locked && target < RAM_START) {
                return Err(ErrorNumber::Access);
            }
            let len = usize::from(entry.register.len);
            let span = targets.get(at..at + len).ok_or(ErrorNumber::DataLength)?;
            if !span.iter().copied().eq(target..target + entry.register.len) {
                return Err(ErrorNumber::DataLength);
            }
            let value = value(&data[at..at + len], entry.min < 0);
            if !(entry.min..=entry.max).contains(&value) {
                return Err(ErrorNumber::DataRange);
            }
            changes.push(Change { register: entry.register, value });
            at += len;
        }
        Ok(changes)
    }
}

/// Little-endian bytes as a number.
fn value(bytes: &[u8], signed: bool) -> i64 {
    let unsigned = bytes.iter().rev().fold(0_i64, |value, &byte| value << 8 | i64::from(byte));
    let bits = 8 * bytes.len();
    if signed && unsigned >> (bits - 1) != 0 { unsigned - (1 << bits) } else { unsigned }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servo_wire::dynamixel::table::{
        GOAL_POSITION, HARDWARE_ERROR_STATUS, ID, LED, PRESENT_POSITION, PROFILE_ACCELERATION,
        PROFILE_VELOCITY, TORQUE_ENABLE,
    };

    #[test]
    fn values_keep_their_sign() {
        let mut memory = Memory::new(Layout::X);
        for position in [0, -1, 1_048_575, -1_048_575] {
            memory.set(PRESENT_POSITION, position);
            assert_eq!(memory.get(PRESENT_POSITION), position);
        }
        memory.set(TORQUE_ENABLE, 255);
        assert_eq!(memory.get(TORQUE_ENABLE), 255);
    }

    #[test]
    fn reads_gaps_as_zero_but_not_a_gap_alone() {
        let memory = Memory::new(Layout::X);
        assert_eq!(memory.read(65, 4), Ok(vec![0, 0, 0, 2]));
        assert_eq!(memory.read(66, 2), Err(ErrorNumber::Access));
        assert_eq!(memory.read(661, 1), Ok(vec![0]));
        assert_eq!(memory.read(661, 2), Err(ErrorNumber::Access));
        assert_eq!(memory.read(0xFFFF, 0xFFFF), Err(ErrorNumber::Access));
        assert_eq!(memory.read(0, 0), Err(ErrorNumber::DataLength));
    }

    #[test]
    fn a_write_must_fit_its_registers() {
        let memory = Memory::new(Layout::X);
        let change = |register, value| Change { register, value };
        assert_eq!(memory.changes(116, &[1, 0, 0, 0], true), Ok(vec![change(GOAL_POSITION, 1)]));
        assert_eq!(
            memory.changes(108, &[1, 0, 0, 0, 2, 0, 0, 0], true),
            Ok(vec![change(PROFILE_ACCELERATION, 1), change(PROFILE_VELOCITY, 2)])
        );
        assert_eq!(memory.changes(116, &[1, 0], true), Err(ErrorNumber::DataLength));
        assert_eq!(memory.changes(117, &[1, 0, 0, 0], true), Err(ErrorNumber::Access));
        assert_eq!(memory.changes(HARDWARE_ERROR_STATUS.address, &[0], true), Err(ErrorNumber::Access));
        assert_eq!(memory.changes(66, &[0], true), Err(ErrorNumber::Access));
        assert_eq!(memory.changes(64, &[2], true), Err(ErrorNumber::DataRange));
        assert_eq!(memory.changes(ID.address, &[3], true), Err(ErrorNumber::Access));
        assert_eq!(memory.changes(ID.address, &[3], false), Ok(vec![change(ID, 3)]));
        assert_eq!(memory.changes(ID.address, &[253], false), Err(ErrorNumber::DataRange));
        assert_eq!(memory.changes(661, &[0, 0], false), Err(ErrorNumber::Access));
        assert_eq!(memory.changes(64, &[], false), Err(ErrorNumber::DataLength));
    }

    #[test]
    fn indirect_data_stand_for_other_addresses() {
        // The manual's two examples: LED at indirect data 1, Goal Position at 2 to 5.
        let mut memory = Memory::new(Layout::X);
        for (i, target) in [65, 116, 117, 118, 119].into_iter().enumerate() {
            memory.set(Register { address: 168 + 2 * i as u16, len: 2 }, target);
        }
        let change = |register, value| Change { register, value };
        assert_eq!(
            memory.changes(224, &[1, 0, 4, 0, 0], true),
            Ok(vec![change(LED, 1), change(GOAL_POSITION, 1024)])
        );
        assert_eq!(memory.changes(224, &[1, 0, 4], true), Err(ErrorNumber::DataLength));
        memory.set(GOAL_POSITION, 0x0102_0304);
        assert_eq!(memory.read(224, 6), Ok(vec![0, 4, 3, 2, 1, 0]));
        assert_eq!(memory.changes(168, &[63, 0], true), Err(ErrorNumber::DataRange));
    }

    #[test]
    fn a_restart_forgets_ram_only() {
        let mut memory = Memory::new(Layout::X);
        memory.set(ID, 9);
        memory.set(LED, 1);
        memory.restart();
        assert_eq!((memory.get(ID), memory.get(LED)), (9, 0));
    }
}

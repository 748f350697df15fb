//! Sync Write: one packet that sets the same value on many servos at once.
//!
//! The player sends one of these every tick, so nothing here loops twice over the servos.

use super::instruction::{BROADCAST_ID, Instruction};
use super::packet::{PacketWriter, WriteError, max_packet_len};
use super::table::GOAL_POSITION;
use crate::bus::Goal;

/// Bytes that [`goal_positions`] takes at most for this many servos, stuffing included.
#[must_use]
pub const fn goal_positions_len(servos: usize) -> usize {
    max_packet_len(servos.saturating_mul(5).saturating_add(4))
}

/// Writes the packet that gives each servo its goal position and returns it.
///
/// `buffer`: [`goal_positions_len`] bytes are enough. Cost: a pass over the bytes and one for the checksum.
///
/// # Errors
/// [`WriteError`] when the buffer is too small.
pub fn goal_positions<'b>(buffer: &'b mut [u8], goals: &[Goal]) -> Result<&'b [u8], WriteError> {
    sync_write(buffer, GOAL_POSITION.address, goals.iter().map(|goal| (goal.id, goal.position.to_le_bytes())))
}

/// Writes the packet that gives each servo (id, little-endian value) `LEN` bytes from `address` on and returns it.
///
/// `LEN` is the length of one register, or of several that follow each other.
///
/// # Errors
/// [`WriteError`] when the buffer is too small or `LEN` does not fit in 16 bits.
pub fn sync_write<const LEN: usize>(
    buffer: &mut [u8],
    address: u16,
    values: impl IntoIterator<Item = (u8, [u8; LEN])>,
) -> Result<&[u8], WriteError> {
    let mut writer = PacketWriter::new(buffer, BROADCAST_ID, Instruction::SyncWrite)?;
    writer.push(&address.to_le_bytes())?;
    writer.push(&u16::try_from(LEN).map_err(|_| WriteError::TooLong)?.to_le_bytes())?;
    for (id, value) in values {
        writer.push_value(id, value)?;
    }
    writer.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamixel::Framer;
    use crate::dynamixel::table::TORQUE_ENABLE;

    #[test]
    fn writes_the_example_of_the_manual() {
        let mut buffer = [0; goal_positions_len(2)];
        let goals = [Goal { id: 1, position: 150 }, Goal { id: 2, position: 170 }];
        let packet = goal_positions(&mut buffer, &goals).unwrap();
        let expected = [
            0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x11, 0x00, 0x83, 0x74, 0x00, 0x04, 0x00, 0x01, 0x96, 0x00, 0x00,
            0x00, 0x02, 0xAA, 0x00, 0x00, 0x00, 0x82, 0x87,
        ];
        assert_eq!(packet, expected);
    }

    #[test]
    fn the_stated_length_suffices_for_the_worst_positions() {
        // Every position holds `FF FF FD`, every id follows one.
        let goals: Vec<Goal> = (0..=252).map(|id| Goal { id, position: 0x00FD_FFFF }).collect();
        let mut buffer = [0; goal_positions_len(253)];
        let packet = goal_positions(&mut buffer, &goals).unwrap().to_vec();
        assert_eq!(packet.len(), 10 + 4 + 253 * 6);
        let mut framer = Framer::<{ goal_positions_len(253) }>::new();
        let mut bytes = &packet[..];
        let read = framer.feed(&mut bytes).unwrap().unwrap();
        let ids: Vec<u8> = read.parameters[4..].chunks(5).map(|entry| entry[0]).collect();
        assert_eq!(ids, (0..=252).collect::<Vec<u8>>());
        assert!(read.parameters[4..].chunks(5).all(|entry| entry[1..] == [0xFF, 0xFF, 0xFD, 0x00]));
    }

    #[test]
    fn writes_other_registers_too() {
        let mut buffer = [0; 32];
        let packet = sync_write(&mut buffer, TORQUE_ENABLE.address, [(3, [1]), (4, [0])]).unwrap();
        assert_eq!(packet[5..16], [11, 0, 0x83, 64, 0, 1, 0, 3, 1, 4, 0]);
    }

    #[test]
    fn a_small_buffer_is_an_error() {
        let goals = [Goal { id: 1, position: 0 }];
        let mut buffer = [0; 18];
        assert_eq!(goal_positions(&mut buffer, &goals), Err(WriteError::BufferTooSmall));
        assert!(goal_positions(&mut [0; 19], &goals).is_ok());
    }
}

//! One packet: `FF FF FD 00`, id, length, instruction, parameters, checksum.
//!
//! Length counts from the instruction to the checksum. Where instruction and parameters hold `FF FF FD`, a
//! further `FD` is stuffed in so that a header cannot appear inside a packet; length and checksum are those of
//! the stuffed bytes (e-Manual, "Packet Process").

use super::crc;
use super::instruction::{ErrorNumber, Instruction};
use core::fmt;

/// First bytes of every packet: the header and the reserved byte.
pub const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];

/// Bytes of a packet without parameters.
pub const OVERHEAD: usize = 10;

/// Bytes before the ones that length counts: header, id, length.
pub(super) const PREFIX: usize = 7;

/// Bytes of the checksum.
const CHECKSUM: usize = 2;

/// Position of the first parameter.
const PARAMETERS: usize = 8;

/// Bytes that a packet with this many bytes of parameters takes at most, stuffing included.
#[must_use]
pub const fn max_packet_len(parameters: usize) -> usize {
    (parameters / 3).saturating_add(parameters).saturating_add(OVERHEAD)
}

/// A received packet whose checksum was right, with stuffing removed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet<'a> {
    /// Addressee of an instruction, sender of a status; 0 to 252, or 254 for all.
    pub id: u8,
    /// Code of an [`Instruction`]; unknown codes are passed on.
    pub instruction: u8,
    /// Parameters; of a status packet its error byte first.
    pub parameters: &'a [u8],
}

impl<'a> Packet<'a> {
    /// This packet as an answer; `None` for an instruction or where the error byte is missing.
    #[must_use]
    pub fn status(&self) -> Option<Status<'a>> {
        if self.instruction != Instruction::Status as u8 {
            return None;
        }
        let (&error, parameters) = self.parameters.split_first()?;
        Some(Status { id: self.id, error, parameters })
    }
}

/// A servo's answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Status<'a> {
    /// Id of the servo that answers.
    pub id: u8,
    /// Error number in the low seven bits, [`ALERT`](super::instruction::ALERT) above.
    pub error: u8,
    /// What was asked for; empty after an error.
    pub parameters: &'a [u8],
}

impl Status<'_> {
    /// Whether the servo reports a hardware error, whatever became of the instruction.
    #[must_use]
    pub fn alert(&self) -> bool {
        self.error & super::instruction::ALERT != 0
    }

    /// Why the instruction was not carried out.
    #[must_use]
    pub fn error_number(&self) -> Option<ErrorNumber> {
        ErrorNumber::from_error_byte(self.error)
    }
}

/// Why a packet could not be written; the buffer then holds part of one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum WriteError {
    /// The buffer ends before the packet; [`max_packet_len`] says what suffices.
    BufferTooSmall,
    /// More bytes than the two bytes of length can count.
    TooLong,
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BufferTooSmall => "the buffer is too small for the Dynamixel packet",
            Self::TooLong => "a Dynamixel packet cannot be longer than 65542 bytes",
        })
    }
}

impl core::error::Error for WriteError {}

/// Writes one packet into a caller's buffer.
pub struct PacketWriter<'b> {
    buffer: &'b mut [u8],
    len: usize,
    /// How many `FF` the bytes so far end with; two and an `FD` is what must be stuffed.
    run: u32,
}

impl<'b> PacketWriter<'b> {
    /// Starts a packet to (or, for a status, from) `id`.
    ///
    /// # Errors
    /// [`WriteError::BufferTooSmall`] below [`OVERHEAD`] bytes.
    pub fn new(buffer: &'b mut [u8], id: u8, instruction: Instruction) -> Result<Self, WriteError> {
        let Some(start) = buffer.first_chunk_mut::<PARAMETERS>() else {
            return Err(WriteError::BufferTooSmall);
        };
        let [h0, h1, h2, reserved] = HEADER;
        *start = [h0, h1, h2, reserved, id, 0, 0, instruction as u8];
        Ok(Self { buffer, len: PARAMETERS, run: 0 })
    }

    /// Appends parameters, stuffing them; cost is one pass.
    ///
    /// # Errors
    /// [`WriteError::BufferTooSmall`] when they do not fit.
    #[inline(never)]
    pub fn push(&mut self, parameters: &[u8]) -> Result<(), WriteError> {
        for &byte in parameters {
            self.put(byte)?;
            if byte == 0xFF {
                self.run = self.run.saturating_add(1);
                continue;
            }
            if byte == 0xFD && self.run >= 2 {
                self.put(0xFD)?;
            }
            self.run = 0;
        }
        Ok(())
    }

    /// Appends a servo's id and its value, as [`push`](Self::push) does; what needs no stuffing at a copy's cost.
    ///
    /// # Errors
    /// [`WriteError::BufferTooSmall`] when they do not fit.
    #[inline(always)]
    pub fn push_value<const N: usize>(&mut self, id: u8, value: [u8; N]) -> Result<(), WriteError> {
        // Stuffing begins with an FD, or with an FF that has one behind it.
        let has_fd = value.iter().fold(id == 0xFD, |any, &byte| any | (byte == 0xFD));
        if has_fd || value.last().unwrap_or(&id) == &0xFF {
            self.push(&[id])?;
            return self.push(&value);
        }
        let Some([first, rest @ ..]) = self.buffer.get_mut(self.len..) else {
            return Err(WriteError::BufferTooSmall);
        };
        *first = id;
        *rest.first_chunk_mut::<N>().ok_or(WriteError::BufferTooSmall)? = value;
        self.len = self.len.wrapping_add(N).wrapping_add(1);
        self.run = 0;
        Ok(())
    }

    fn put(&mut self, byte: u8) -> Result<(), WriteError> {
        let slot = self.buffer.get_mut(self.len).ok_or(WriteError::BufferTooSmall)?;
        *slot = byte;
        self.len = self.len.wrapping_add(1);
        Ok(())
    }

    /// Fills in length and checksum and returns the packet; cost is one pass.
    ///
    /// # Errors
    /// [`WriteError`] when the checksum does not fit or the length does not fit in 16 bits.
    pub fn finish(self) -> Result<&'b [u8], WriteError> {
        let Self { buffer, len, .. } = self;
        let end = len.saturating_add(CHECKSUM);
        let length = u16::try_from(end.saturating_sub(PREFIX)).map_err(|_| WriteError::TooLong)?;
        let packet = buffer.get_mut(..end).ok_or(WriteError::BufferTooSmall)?;
        if let [_, _, _, _, _, low, high, ..] = packet {
            [*low, *high] = length.to_le_bytes();
        }
        if let Some((body, checksum)) = packet.split_last_chunk_mut::<CHECKSUM>() {
            *checksum = crc::update(0, body).to_le_bytes();
        }
        Ok(packet)
    }
}

/// Removes stuffing in place and returns how many bytes are left.
pub(super) fn unstuff(bytes: &mut [u8]) -> usize {
    let mut run = 0_u32;
    let mut stuffed = false;
    let mut kept = 0;
    for read in 0..bytes.len() {
        let Some(&byte) = bytes.get(read) else { break };
        if core::mem::take(&mut stuffed) && byte == 0xFD {
            continue;
        }
        if let Some(slot) = bytes.get_mut(kept) {
            *slot = byte;
            kept = usize::wrapping_add(kept, 1);
        }
        stuffed = byte == 0xFD && run >= 2;
        run = if byte == 0xFF { run.saturating_add(1) } else { 0 };
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(id: u8, instruction: Instruction, parameters: &[u8]) -> Vec<u8> {
        let mut buffer = vec![0; max_packet_len(parameters.len())];
        let mut writer = PacketWriter::new(&mut buffer, id, instruction).unwrap();
        writer.push(parameters).unwrap();
        writer.finish().unwrap().to_vec()
    }

    fn hex(text: &str) -> Vec<u8> {
        text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
    }

    /// Every example of the e-Manual's page "DYNAMIXEL Protocol 2.0" that is a stuffed packet. (Its example of
    /// a Fast Bulk Read instruction prints the checksum of its Fast Sync Read example and is left out.)
    #[test]
    fn writes_the_examples_of_the_manual() {
        use Instruction::*;
        for (id, instruction, parameters, packet) in [
            (1, Ping, "", "FF FF FD 00 01 03 00 01 19 4E"),
            (1, Status, "00 06 04 26", "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D"),
            (0xFE, Ping, "", "FF FF FD 00 FE 03 00 01 31 42"),
            (2, Status, "00 06 04 26", "FF FF FD 00 02 07 00 55 00 06 04 26 6F 6D"),
            (1, Read, "84 00 04 00", "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"),
            (1, Status, "00 A6 00 00 00", "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0"),
            (1, Write, "74 00 00 02 00 00", "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89"),
            (1, Status, "00", "FF FF FD 00 01 04 00 55 00 A1 0C"),
            (1, RegWrite, "68 00 C8 00 00 00", "FF FF FD 00 01 09 00 04 68 00 C8 00 00 00 AE 8E"),
            (1, Action, "", "FF FF FD 00 01 03 00 05 02 CE"),
            (1, FactoryReset, "01", "FF FF FD 00 01 04 00 06 01 A1 E6"),
            (1, Reboot, "", "FF FF FD 00 01 03 00 08 2F 4E"),
            (1, Clear, "01 44 58 4C 22", "FF FF FD 00 01 08 00 10 01 44 58 4C 22 B1 DC"),
            (0xFE, SyncRead, "84 00 04 00 01 02", "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA"),
            (2, Status, "00 1F 08 00 00", "FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE"),
            (
                0xFE,
                FastSyncRead,
                "84 00 04 00 03 07 04",
                "FF FF FD 00 FE 0A 00 8A 84 00 04 00 03 07 04 20 F2",
            ),
            (
                0xFE,
                BulkRead,
                "01 90 00 02 00 02 92 00 01 00",
                "FF FF FD 00 FE 0D 00 92 01 90 00 02 00 02 92 00 01 00 1A 05",
            ),
            (1, Status, "00 77 00", "FF FF FD 00 01 06 00 55 00 77 00 C3 69"),
            (2, Status, "00 24", "FF FF FD 00 02 05 00 55 00 24 8B A9"),
            (
                0xFE,
                BulkWrite,
                "01 20 00 02 00 A0 00 02 1F 00 01 00 50",
                "FF FF FD 00 FE 10 00 93 01 20 00 02 00 A0 00 02 1F 00 01 00 50 B7 68",
            ),
        ] {
            assert_eq!(
                written(id, instruction, &hex(parameters)),
                hex(packet),
                "{instruction:?} {parameters}"
            );
        }
    }

    #[test]
    fn stuffs_wherever_the_header_would_appear() {
        let parameters = |packet: &[u8]| packet[PARAMETERS..packet.len() - 2].to_vec();
        for (plain, stuffed) in [
            ("FF FF FD", "FF FF FD FD"),
            ("FF FF FD FD", "FF FF FD FD FD"),
            ("FF FF FF FD 00", "FF FF FF FD FD 00"),
            ("FF FD FF FF FD FF FF FD", "FF FD FF FF FD FD FF FF FD FD"),
            ("FF FF 00 FD", "FF FF 00 FD"),
        ] {
            let packet = written(1, Instruction::Write, &hex(plain));
            assert_eq!(parameters(&packet), hex(stuffed), "{plain}");
            assert_eq!(usize::from(packet[5]) + PREFIX, packet.len());
            let mut back = hex(stuffed);
            let kept = unstuff(&mut back);
            assert_eq!(back[..kept], hex(plain)[..]);
        }
    }

    #[test]
    fn stuffing_does_not_depend_on_how_parameters_are_pushed() {
        let bytes = hex("FF FF FD FD FF FF FF FD FF FF FD");
        let whole = written(7, Instruction::Write, &bytes);
        let mut buffer = [0; 64];
        let mut writer = PacketWriter::new(&mut buffer, 7, Instruction::Write).unwrap();
        for byte in bytes {
            writer.push(&[byte]).unwrap();
        }
        assert_eq!(writer.finish().unwrap(), whole);
    }

    #[test]
    fn a_buffer_that_is_too_small_is_an_error() {
        let whole = written(1, Instruction::Write, &hex("FF FF FD"));
        for len in 0..whole.len() {
            let mut buffer = vec![0; len];
            let result = PacketWriter::new(&mut buffer, 1, Instruction::Write)
                .and_then(|mut writer| writer.push(&[0xFF, 0xFF, 0xFD]).map(|()| writer))
                .and_then(|writer| writer.finish().map(<[u8]>::len));
            assert_eq!(result, Err(WriteError::BufferTooSmall), "{len} bytes");
        }
        let mut buffer = vec![0; 70_000];
        let mut writer = PacketWriter::new(&mut buffer, 1, Instruction::Write).unwrap();
        writer.push(&[0; 65_533]).unwrap();
        assert_eq!(writer.finish(), Err(WriteError::TooLong));
    }

    #[test]
    fn only_a_status_packet_has_a_status() {
        let packet = |instruction, parameters| Packet { id: 3, instruction, parameters };
        let status = packet(0x55, &[0x87, 9]).status().unwrap();
        assert_eq!((status.id, status.parameters), (3, &[9][..]));
        assert!(status.alert());
        assert_eq!(status.error_number(), Some(ErrorNumber::Access));
        assert_eq!(packet(0x55, &[]).status(), None);
        assert_eq!(packet(0x02, &[0]).status(), None);
    }
}

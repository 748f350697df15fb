//! Frames out of a stream of bytes, and into one: COBS, a sequence number and a CRC.
//!
//! A frame is a sequence number, a message ([`wire`](super::wire)) and a CRC-32; COBS
//! (Cheshire and Baker 1999) frees it of zeros, and a zero ends it. So after any noise the next zero is where a frame
//! begins, and what was damaged is found by its CRC (1 damage in 4·10⁹ is not).

use super::cobs_writer::{CRC_BYTES, CobsWriter};
use super::wire::{Decode, Encode};
use cobs::{DecodeResult, DecoderState};
use core::fmt;
use decoder_core::mclip::digest;
use heapless::Vec;

/// The CRC-32 of bytes that come in parts, of frames and of uploads: that of .mclip, zlib and PNG.
pub fn crc32<'b>(parts: impl IntoIterator<Item = &'b [u8]>) -> u32 {
    let mut digest = digest();
    parts.into_iter().for_each(|part| digest.update(part));
    digest.finalize()
}

/// Bytes that frames take besides their message, decoded: three of the sequence number, and the CRC.
pub const OVERHEAD: usize = 3 + CRC_BYTES;

/// Bytes on the wire that a message of so many bytes takes at most, with the zero at its end.
pub const fn wire_len(message: usize) -> usize {
    cobs::max_encoding_length(message.saturating_add(OVERHEAD)).saturating_add(1)
}

/// Writes a frame, and gives its bytes with the zero; `None` where the buffer is too small for it.
///
/// Takes a pass over the message, a table look-up a byte.
pub fn write<'b>(sequence: u16, message: &impl Encode, buffer: &'b mut [u8]) -> Option<&'b mut [u8]> {
    let mut writer = CobsWriter::new(buffer);
    sequence.encode(&mut writer);
    message.encode(&mut writer);
    writer.finish()
}

/// A frame that arrived whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Its number.
    pub sequence: u16,
    /// The message's bytes.
    pub message: &'a [u8],
}

/// Why bytes between two zeros are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FrameError {
    /// It was cut: COBS promised more bytes.
    Cut,
    /// It is longer than any message.
    TooLong,
    /// It is shorter than any message, or its number is none.
    TooShort,
    /// Its CRC is wrong.
    Damaged,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cut => "a frame was cut",
            Self::TooLong => "a frame is longer than any message",
            Self::TooShort => "a frame is shorter than any message",
            Self::Damaged => "a frame was damaged",
        })
    }
}

impl core::error::Error for FrameError {}

/// Finds frames in a stream that begins and breaks anywhere. `N` decoded bytes fit.
#[derive(Debug)]
pub struct Deframer<const N: usize> {
    cobs: DecoderState,
    bytes: Vec<u8, N>,
    too_long: bool,
    /// Whether `bytes` are a frame that was given already.
    given: bool,
}

impl<const N: usize> Default for Deframer<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Deframer<N> {
    /// Before the first byte.
    pub const fn new() -> Self {
        Self { cobs: DecoderState::Idle, bytes: Vec::new(), too_long: false, given: false }
    }

    /// Takes bytes off the front of `bytes` until a frame ends; `None` once all of them were taken.
    ///
    /// A byte costs a step of the COBS decoder, a frame's end a pass over the frame.
    pub fn feed(&mut self, bytes: &mut &[u8]) -> Option<Result<Frame<'_>, FrameError>> {
        if self.given {
            self.forget();
        }
        while let Some((&byte, rest)) = bytes.split_first() {
            *bytes = rest;
            let whole = match self.cobs.feed(byte) {
                Ok(DecodeResult::NoData) => continue,
                Ok(DecodeResult::DataContinue(byte)) => {
                    self.too_long |= self.bytes.push(byte).is_err();
                    continue;
                }
                Ok(DecodeResult::DataComplete) => true,
                Err(_) => false,
            };
            self.given = true;
            return Some(match (self.too_long, whole) {
                (true, _) => Err(FrameError::TooLong),
                (_, false) => Err(FrameError::Cut),
                _ => self.open(),
            });
        }
        None
    }

    /// Gives up what has arrived of a frame.
    pub fn forget(&mut self) {
        *self = Self::new();
    }

    fn open(&self) -> Result<Frame<'_>, FrameError> {
        let (body, crc) = self.bytes.split_last_chunk::<CRC_BYTES>().ok_or(FrameError::TooShort)?;
        if crc32([body]) != u32::from_le_bytes(*crc) {
            return Err(FrameError::Damaged);
        }
        let mut message = body;
        let sequence = u16::decode(&mut message).ok_or(FrameError::TooShort)?;
        Ok(Frame { sequence, message })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::wire::decode_all;
    use proptest::prelude::*;

    type Found = std::vec::Vec<Result<(u16, std::vec::Vec<u8>), FrameError>>;

    fn read<const N: usize>(chunks: &[&[u8]]) -> Found {
        let mut deframer = Deframer::<N>::new();
        let mut found = Found::new();
        for mut chunk in chunks.iter().copied() {
            while let Some(frame) = deframer.feed(&mut chunk) {
                found.push(frame.map(|frame| (frame.sequence, frame.message.to_vec())));
            }
        }
        found
    }

    fn written(sequence: u16, message: &[u8]) -> std::vec::Vec<u8> {
        let mut buffer = std::vec![0; wire_len(message.len() + 3)];
        write(sequence, &message, &mut buffer).unwrap().to_vec()
    }

    /// CRC of an empty message with number 0, by hand: 0x00, 0x00 has the CRC-32 0x41d912ff (zlib).
    #[test]
    fn the_bytes_are_those_of_the_document() {
        assert_eq!(crc32([&b"1234"[..], b"56789"]), 0xcbf4_3926, "the check value of CRC-32/ISO-HDLC");
        assert_eq!(crc32([&[0, 0][..]]), 0x41d9_12ff);
        assert_eq!(written(0, &[]), [1, 1, 5, 0xff, 0x12, 0xd9, 0x41, 0]);
    }

    #[test]
    fn a_buffer_that_is_too_small_is_told() {
        let message = [7u8; 40];
        let len = written(300, &message).len();
        for short in 0..len {
            assert!(write(300, &message.as_slice(), &mut std::vec![0; short]).is_none(), "{short}");
        }
    }

    #[test]
    fn what_is_wrong_is_told_and_the_next_frame_is_found() {
        let frame = written(300, b"message");
        let right = Ok((300, [&[7], &b"message"[..]].concat()));
        let after = |bytes: &[u8]| read::<40>(&[bytes, &frame]);
        assert_eq!(after(&[]), std::slice::from_ref(&right));
        // Zeros between frames are nothing.
        assert_eq!(after(&[0, 0, 0]), std::slice::from_ref(&right));
        assert_eq!(after(&[frame[0], frame[1], 0]), [Err(FrameError::Cut), right.clone()]);
        assert_eq!(after(&[3, 7, 7, 0]), [Err(FrameError::TooShort), right.clone()]);
        assert_eq!(after(&written(1, &[9; 40])), [Err(FrameError::TooLong), right.clone()]);
        let mut damaged = frame.clone();
        damaged[3] ^= 1;
        assert_eq!(after(&damaged), [Err(FrameError::Damaged), right.clone()]);
        // Without its zero the one before takes the next with it.
        assert_eq!(read::<40>(&[&frame[..5], &frame, &frame])[1..], [right]);
        // The number has no end, and the CRC is right.
        let mut raw = std::vec![0xff; 4];
        raw.extend(crc32([&raw[..]]).to_le_bytes());
        let mut wire = std::vec![0; 20];
        let len = cobs::encode(&raw, &mut wire);
        assert_eq!(read::<40>(&[&wire[..=len]]), [Err(FrameError::TooShort)]);
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_however_it_is_cut(
            sent in prop::collection::vec((any::<u16>(), prop::collection::vec(prop_oneof![Just(0), Just(1), any::<u8>()], 0..600)), 1..4),
            cuts in prop::collection::vec(0usize..2000, 0..8),
        ) {
            let wire: std::vec::Vec<u8> = sent.iter().flat_map(|(sequence, message)| written(*sequence, message)).collect();
            let mut ends: std::vec::Vec<usize> = cuts.iter().map(|cut| cut % wire.len()).collect();
            ends.extend([0, wire.len()]);
            ends.sort_unstable();
            let chunks: std::vec::Vec<&[u8]> = ends.windows(2).map(|pair| &wire[pair[0]..pair[1]]).collect();
            let found = read::<610>(&chunks);
            prop_assert_eq!(found.len(), sent.len());
            for (found, (sequence, message)) in found.into_iter().zip(&sent) {
                let (number, bytes) = found.unwrap();
                prop_assert_eq!(number, *sequence);
                prop_assert_eq!(decode_all::<&[u8]>(&bytes).unwrap(), &message[..]);
            }
        }

        #[test]
        fn any_bytes_are_taken_and_a_frame_behind_them_is_found(noise in prop::collection::vec(any::<u8>(), 0..300)) {
            let frame = written(5, b"after");
            let found = read::<40>(&[&noise, &[0], &frame]);
            prop_assert_eq!(found.last().unwrap().as_ref().unwrap().0, 5);
            prop_assert!(found.len() <= 2 + noise.len());
        }
    }
}

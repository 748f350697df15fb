//! Writes a frame byte by byte: COBS over the bytes, and their CRC behind them.
//!
//! COBS by Cheshire and Baker 1999, "Consistent Overhead Byte Stuffing". The libraries that write it byte by byte panic where
//! the buffer is too small; this notes it.

use crc::Digest;
use decoder_core::mclip::digest;

/// Bytes of the CRC.
pub(super) const CRC_BYTES: usize = 4;

/// Most bytes behind a code: then comes another code, and no zero is meant.
const LONGEST: u8 = 0xff;

/// A frame that is being written.
pub struct CobsWriter<'b> {
    buffer: &'b mut [u8],
    /// Bytes written, and where the code of those behind it is.
    length: usize,
    code_at: usize,
    /// One more than the bytes since the code.
    code: u8,
    digest: Digest<'static, u32>,
    /// Whether a byte did not fit.
    full: bool,
}

impl<'b> CobsWriter<'b> {
    /// An empty frame.
    pub(super) fn new(buffer: &'b mut [u8]) -> Self {
        let mut writer = Self { buffer, length: 0, code_at: 0, code: 1, digest: digest(), full: false };
        writer.push(0);
        writer
    }

    /// Writes a byte of the frame.
    pub fn put(&mut self, byte: u8) {
        self.digest.update(&[byte]);
        self.stuff(byte);
    }

    /// Writes the CRC of all bytes and the zero that ends the frame; `None` where they did not fit.
    pub(super) fn finish(mut self) -> Option<&'b mut [u8]> {
        let crc: [u8; CRC_BYTES] = self.digest.clone().finalize().to_le_bytes();
        crc.into_iter().for_each(|byte| self.stuff(byte));
        self.close();
        self.push(0);
        if self.full {
            return None;
        }
        self.buffer.get_mut(..self.length)
    }

    fn stuff(&mut self, byte: u8) {
        if byte != 0 {
            self.push(byte);
            self.code = self.code.saturating_add(1);
        }
        if byte == 0 || self.code == LONGEST {
            self.open();
        }
    }

    /// Ends the bytes behind a code, and begins those behind the next.
    fn open(&mut self) {
        self.close();
        (self.code_at, self.code) = (self.length, 1);
        self.push(0);
    }

    fn close(&mut self) {
        if let Some(code) = self.buffer.get_mut(self.code_at) {
            *code = self.code;
        }
    }

    fn push(&mut self, byte: u8) {
        match self.buffer.get_mut(self.length) {
            Some(place) => {
                *place = byte;
                self.length = self.length.saturating_add(1);
            }
            None => self.full = true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::wire::Encode;
    use postcard::ser_flavors::crc::CrcModifier;
    use postcard::ser_flavors::{Cobs, Slice};
    use proptest::prelude::*;

    proptest! {
        /// Against postcard, which wrote the frames of the first version.
        #[test]
        fn the_bytes_are_those_of_postcard(
            bytes in prop::collection::vec(1u8.., 0..900),
            zeros in prop::collection::vec(any::<prop::sample::Index>(), 0..6),
        ) {
            let mut bytes = bytes;
            if !bytes.is_empty() {
                zeros.iter().for_each(|at| { let at = at.index(bytes.len()); bytes[at] = 0 });
            }
            let bytes = bytes.as_slice();
            let mut buffer = [0xaa; 1000];
            let mut writer = CobsWriter::new(&mut buffer);
            bytes.encode(&mut writer);
            let found = writer.finish().unwrap().to_vec();
            let mut room = [0x55; 1000];
            let cobs = Cobs::try_new(Slice::new(&mut room)).unwrap();
            let expected = postcard::serialize_with_flavor(&bytes, CrcModifier::new(cobs, digest())).unwrap();
            prop_assert_eq!(&*found, &*expected);
            for short in [0, 1, found.len() / 2, found.len() - 1] {
                let mut writer = CobsWriter::new(&mut buffer[..short]);
                bytes.encode(&mut writer);
                prop_assert!(writer.finish().is_none());
            }
        }
    }
}

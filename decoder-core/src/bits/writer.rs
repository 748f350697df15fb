//! Bits into bytes: what [`BitReader`](super::reader::BitReader) reads.

/// Bytes that are written bit by bit, into anything that takes bytes: a `Vec<u8>`, or a sink of the caller's.
///
/// ```
/// use decoder_core::bits::{BitReader, BitWriter};
/// let mut writer = BitWriter::new(Vec::new());
/// writer.put(0b101, 3);
/// writer.put_signed(-2, 7);
/// let bytes = writer.finish();
/// let mut reader = BitReader::new(&bytes);
/// assert_eq!((reader.take(3), reader.take_signed(7)), (0b101, -2));
/// ```
#[derive(Clone, Debug, Default)]
pub struct BitWriter<B> {
    bytes: B,
    /// The last bits, fewer than eight, in the low bits.
    rest: u32,
    /// Bits so far.
    length: usize,
}

impl<B: Extend<u8>> BitWriter<B> {
    /// Before the first bit. Bytes are appended to `bytes` as they become whole.
    pub const fn new(bytes: B) -> Self {
        Self { bytes, rest: 0, length: 0 }
    }

    /// Appends the low `count` bits of `value`, at most 32.
    pub fn put(&mut self, value: u32, count: u32) {
        for bit in (0..count).rev() {
            self.rest = self.rest.wrapping_shl(1) | value.wrapping_shr(bit) & 1;
            self.length = self.length.wrapping_add(1);
            if self.held() == 0 {
                self.bytes.extend([self.rest as u8]);
                self.rest = 0;
            }
        }
    }

    /// Appends a number in two's complement of `count` bits, at most 32.
    pub fn put_signed(&mut self, value: i32, count: u32) {
        self.put(value.cast_unsigned(), count);
    }

    /// Appends zeros up to a whole byte.
    pub fn align(&mut self) {
        self.put(0, 8u32.wrapping_sub(self.held()) & 7);
    }

    /// Appends all bits of `other`.
    pub fn append<O: AsRef<[u8]>>(&mut self, other: &BitWriter<O>) {
        for &byte in other.bytes.as_ref() {
            self.put(byte.into(), 8);
        }
        self.put(other.rest, (other.length & 7) as u32);
    }

    /// Bits so far.
    pub const fn length(&self) -> usize {
        self.length
    }

    /// The bytes, the last one filled up with zeros.
    pub fn finish(mut self) -> B {
        self.align();
        self.bytes
    }

    /// The bytes, the last one filled up with zeros; nothing is left.
    pub fn take(&mut self) -> B
    where
        B: Default,
    {
        self.align();
        self.length = 0;
        core::mem::take(&mut self.bytes)
    }

    /// Bits that are no whole byte yet.
    const fn held(&self) -> u32 {
        (self.length & 7) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bits::reader::BitReader;
    use std::vec::Vec;

    #[test]
    fn what_is_written_is_read() {
        let mut all = BitWriter::new(Vec::new());
        for count in 0..=16u32 {
            let mut part = BitWriter::new(Vec::new());
            part.put(0x1_5555 & ((1 << count) - 1), count);
            all.append(&part);
        }
        assert_eq!(all.length(), 16 * 17 / 2);
        let bytes = all.take();
        assert_eq!((bytes.len(), all.length()), (17, 0));
        let mut reader = BitReader::new(&bytes);
        for count in 0..=16u32 {
            assert_eq!(reader.take(count), 0x1_5555 & ((1 << count) - 1));
        }
        assert!(!reader.overrun());
        all.put_signed(-3, 5);
        all.align();
        assert_eq!(all.length(), 8);
        all.put_signed(-1, 1);
        assert_eq!(all.take(), [0b1110_1000, 0b1000_0000]);
        all.put(u32::MAX, 32);
        assert_eq!(all.finish(), [0xff; 4]);
    }

    #[test]
    fn whole_bytes_need_no_filling() {
        let mut writer = BitWriter::new(Vec::new());
        writer.put(0xa5, 8);
        writer.align();
        assert_eq!((writer.length(), writer.finish()), (8, std::vec![0xa5]));
    }
}

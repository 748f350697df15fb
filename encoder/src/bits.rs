//! Bits into bytes, the most significant first.

/// Bytes that are written bit by bit.
#[derive(Clone, Debug, Default)]
pub(crate) struct BitWriter {
    bytes: Vec<u8>,
    length: usize,
}

impl BitWriter {
    /// Appends the low `count` bits of `value`, at most 32.
    pub fn put(&mut self, value: u32, count: u32) {
        for bit in (0..count).rev() {
            if self.length.is_multiple_of(8) {
                self.bytes.push(0);
            }
            if let Some(last) = self.bytes.last_mut() {
                *last |= ((value >> bit & 1) as u8) << (7 - self.length % 8);
            }
            self.length += 1;
        }
    }

    /// Appends a number in two's complement of `count` bits.
    pub fn put_signed(&mut self, value: i32, count: u32) {
        self.put(value.cast_unsigned(), count);
    }

    /// Appends zeros up to a whole byte.
    pub const fn align(&mut self) {
        self.length = self.length.next_multiple_of(8);
    }

    /// Appends all of `other`.
    pub fn append(&mut self, other: &Self) {
        for (index, &byte) in other.bytes.iter().enumerate() {
            let count = (other.length - index * 8).min(8);
            self.put(u32::from(byte) >> (8 - count), count as u32);
        }
    }

    /// Bits so far.
    pub const fn length(&self) -> usize {
        self.length
    }

    /// The bytes, filled up with zeros; nothing is left.
    pub fn take(&mut self) -> Vec<u8> {
        self.length = 0;
        std::mem::take(&mut self.bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoder_core::bits::BitReader;

    #[test]
    fn what_is_written_is_read() {
        let mut all = BitWriter::default();
        for count in 0..=16u32 {
            let mut part = BitWriter::default();
            part.put(0x1_5555 & ((1 << count) - 1), count);
            all.append(&part);
        }
        assert_eq!(all.length(), 16 * 17 / 2);
        let bytes = all.take();
        let mut reader = BitReader::new(&bytes);
        for count in 0..=16u32 {
            assert_eq!(reader.take(count), 0x1_5555 & ((1 << count) - 1));
        }
        all.put_signed(-3, 5);
        all.align();
        all.put_signed(-1, 1);
        assert!(!reader.overrun());
        assert_eq!(all.take(), [0b1110_1000, 0b1000_0000]);
    }
}

//! Bits out of bytes, the most significant first.
//!
//! Reading past the end is defined: it gives zeros, and [`BitReader::overrun`] tells. So a loop over a frame's
//! codes needs one check at its end instead of one at every code.

/// Most bits that one call takes.
pub const MAX_TAKE: u32 = 16;

/// A position in a slice of bytes.
///
/// Up to four bytes are held in a word, two of which are fetched at a time, so that a code costs two shifts, and every
/// second byte a branch and a load.
#[derive(Clone, Debug)]
pub struct BitReader<'a> {
    rest: &'a [u8],
    /// The next bits, left-aligned; zeros below those that are held.
    window: u32,
    /// Bits in `window`, those past the end included.
    held: u32,
    /// Bits past the end that were fetched.
    missing: usize,
    /// Bits that there are.
    length: usize,
}

impl<'a> BitReader<'a> {
    /// Before the first bit of `bytes`.
    pub const fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, window: 0, held: 0, missing: 0, length: bytes.len().saturating_mul(8) }
    }

    /// Before bit `position` of `bytes`; past the end where there are not so many.
    pub fn at(bytes: &'a [u8], position: usize) -> Self {
        let whole = position >> 3;
        let rest = bytes.get(whole..).unwrap_or_default();
        let missing = position.saturating_sub(bytes.len().saturating_mul(8)) & !7;
        let mut reader = Self { rest, missing, ..Self::new(bytes) };
        reader.take((position & 7) as u32);
        reader
    }

    /// The next `count` bits, at most [`MAX_TAKE`], as a number; they are taken.
    #[inline(always)]
    pub fn take(&mut self, count: u32) -> u32 {
        let value = self.peek(count);
        self.skip(count);
        value
    }

    /// The next `count` bits, at most [`MAX_TAKE`]; they stay.
    #[inline(always)]
    pub fn peek(&mut self, count: u32) -> u32 {
        if self.held < count {
            self.fetch();
        }
        // In two shifts, since none is as wide as the word.
        (self.window >> 1).wrapping_shr(31u32.wrapping_sub(count))
    }

    /// Takes `count` bits that were peeked at.
    #[inline(always)]
    pub fn skip(&mut self, count: u32) {
        self.window = self.window.wrapping_shl(count);
        self.held = self.held.wrapping_sub(count);
    }

    /// Bits taken since the start, those past the end included.
    pub const fn position(&self) -> usize {
        let fetched = self.length.wrapping_sub(self.rest.len().wrapping_mul(8)).wrapping_add(self.missing);
        fetched.wrapping_sub(self.held as usize)
    }

    /// Whether more bits were taken than there are.
    pub const fn overrun(&self) -> bool {
        self.position() > self.length
    }

    /// Adds 16 bits to a window that holds fewer.
    #[inline(always)]
    fn fetch(&mut self) {
        let bits = match self.rest.split_first_chunk::<2>() {
            Some((&bytes, rest)) => {
                self.rest = rest;
                u16::from_be_bytes(bytes)
            }
            None => self.fetch_last(),
        };
        self.window |= u32::from(bits).wrapping_shl(16u32.wrapping_sub(self.held));
        self.held = self.held.wrapping_add(16);
    }

    /// The last byte and zeros, or zeros alone.
    #[cold]
    #[inline(never)]
    fn fetch_last(&mut self) -> u16 {
        let last = self.rest.first().copied();
        self.rest = &[];
        self.missing = self.missing.saturating_add(if last.is_some() { 8 } else { 16 });
        u16::from_be_bytes([last.unwrap_or(0), 0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, stride, times};
    use std::vec::Vec;

    /// Bit by bit, from a string of digits.
    fn reference(bytes: &[u8], position: usize, count: u32) -> u32 {
        (position..position + count as usize).fold(0, |value, bit| {
            let byte = bytes.get(bit / 8).copied().unwrap_or(0);
            value << 1 | u32::from(byte >> (7 - bit % 8) & 1)
        })
    }

    #[test]
    fn every_width_at_every_position() {
        let mut random = Random(1);
        let bytes: Vec<u8> = (0..9).map(|_| random.next() as u8).collect();
        for position in (0..100).step_by(stride(7)) {
            for count in 0..=MAX_TAKE {
                let mut reader = BitReader::at(&bytes, position);
                assert_eq!(reader.position(), position);
                assert_eq!(reader.peek(count), reference(&bytes, position, count));
                assert_eq!(reader.take(count), reference(&bytes, position, count), "{position} {count}");
                assert_eq!(reader.position(), position + count as usize);
                assert_eq!(reader.overrun(), position + count as usize > 72, "{position} {count}");
            }
        }
    }

    #[test]
    fn any_sequence_of_widths() {
        let mut random = Random(2);
        let bytes: Vec<u8> = (0..times(1000, 100)).map(|_| random.next() as u8).collect();
        let mut reader = BitReader::new(&bytes);
        let mut position = 0;
        let end = 8 * bytes.len();
        while position < end + 100 {
            let count = random.below(MAX_TAKE as usize + 1) as u32;
            assert_eq!(reader.take(count), reference(&bytes, position, count));
            position += count as usize;
            assert_eq!((reader.position(), reader.overrun()), (position, position > end));
        }
    }

    #[test]
    fn a_position_far_beyond_the_end_is_an_overrun() {
        assert!(BitReader::at(&[1, 2], 1 << 40).overrun());
        assert!(!BitReader::at(&[1, 2], 16).overrun());
        assert!(!BitReader::new(&[]).overrun());
    }
}

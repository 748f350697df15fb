//! Bits out of bytes, the most significant first.
//!
//! Reading past the end is defined: it gives zeros, and [`BitReader::overrun`] tells. So a loop over a frame's
//! codes needs one check at its end instead of one at every code.

use core::hint::cold_path;
use core::slice;

/// Most bits that one call takes.
pub const MAX_TAKE: u32 = 16;

/// A position in a slice of bytes.
///
/// There are always [`MAX_TAKE`] bits in a word, so that looking at the next ones is one shift, and taking them a shift
/// and a subtraction; every second byte costs a branch and a load. Methods on the hot path take the reader apart or
/// are inlined, so that what changes stays in registers: no more than the window, the bits in it, and where the next two bytes are.
#[derive(Clone, Debug)]
pub struct BitReader<'a> {
    bytes: &'a [u8],
    /// Whole pairs that are to be fetched, up to the last byte.
    pairs: slice::Iter<'a, [u8; 2]>,
    /// The next bits, left-aligned; zeros below those that are held.
    window: u32,
    /// Bits held beyond [`MAX_TAKE`]: 0 to 15 between calls, as long as there are that many; below 0 after that.
    spare: i32,
}

impl<'a> BitReader<'a> {
    /// Before the first bit of `bytes`.
    #[inline(always)]
    pub fn new(bytes: &'a [u8]) -> Self {
        Self::at(bytes, 0)
    }

    /// Before bit `position` of `bytes`; past the end where there are not so many.
    #[inline(always)]
    pub fn at(bytes: &'a [u8], position: usize) -> Self {
        let rest = bytes.get(position >> 3..).unwrap_or_default();
        let (odd, pairs) = rest.as_rchunks::<2>();
        let window = odd.first().map_or(0, |&byte| u32::from(byte).wrapping_shl(24));
        let mut reader = Self { bytes, pairs: pairs.iter(), window, spare: 0 };
        // As many as make the position that of the byte.
        let far = bytes.len().wrapping_mul(8).wrapping_add(FARTHEST);
        reader.spare = reader.position().wrapping_sub(position.min(far) & !7) as i32;
        reader.fetch();
        reader.skip((position & 7) as u32);
        reader
    }

    /// The next `count` bits, at most [`MAX_TAKE`], as a number; they are taken.
    #[inline(always)]
    pub fn take(&mut self, count: u32) -> u32 {
        // In two shifts, since none is as wide as the word.
        let value = (self.window >> 1).wrapping_shr(31u32.wrapping_sub(count));
        self.skip(count);
        value
    }

    /// The next bit, which is taken.
    #[inline(always)]
    pub fn take_bit(&mut self) -> u32 {
        let bit = self.window >> 31;
        if !self.skip_held(1) {
            // Every sixteenth; so that the others go straight on.
            cold_path();
            self.fetch();
        }
        bit
    }

    /// The next `count` bits, 1 to [`MAX_TAKE`], as a number in two's complement; they are taken.
    #[inline(always)]
    pub fn take_signed(&mut self, count: u32) -> i32 {
        let value = self.window.cast_signed().wrapping_shr(32u32.wrapping_sub(count));
        self.skip(count);
        value
    }

    /// The next 8 bits; they stay.
    #[inline(always)]
    pub const fn peek_byte(&self) -> u8 {
        (self.window >> 24) as u8
    }

    /// Takes `count` bits, at most [`MAX_TAKE`].
    #[inline(always)]
    pub fn skip(&mut self, count: u32) {
        if !self.skip_held(count) {
            self.fetch();
        }
    }

    /// Takes `count` bits, at most [`MAX_TAKE`], and gives whether as many as a call may take are held still.
    /// Otherwise [`fetch`](Self::fetch) must follow.
    #[inline(always)]
    pub const fn skip_held(&mut self, count: u32) -> bool {
        self.window = self.window.wrapping_shl(count);
        self.spare = self.spare.wrapping_sub(count.cast_signed());
        self.spare >= 0
    }

    /// Goes on at the next whole byte, unless this is one.
    #[inline(always)]
    pub fn align(&mut self) {
        // Bytes are fetched whole: what is held ends on one.
        self.skip((self.spare & 7).cast_unsigned());
    }

    /// Bits taken since the start, those past the end included.
    #[inline(always)]
    pub fn position(&self) -> usize {
        let fetched = self.bytes.len().wrapping_mul(8).wrapping_sub(self.pairs.len().wrapping_mul(16));
        fetched.wrapping_sub(16).wrapping_sub(self.spare as usize)
    }

    /// Whether more bits were taken than there are.
    #[inline(always)]
    pub fn overrun(&self) -> bool {
        self.position().cast_signed() > self.bytes.len().wrapping_mul(8).cast_signed()
    }

    /// Adds 16 bits to a window that holds fewer.
    #[inline(always)]
    pub fn fetch(&mut self) {
        if let Some(&pair) = self.pairs.next() {
            self.spare = self.spare.wrapping_add(16);
            // Behind those that are held, which are as many.
            let bits = u32::from(u16::from_le_bytes(pair)).swap_bytes();
            self.window |= bits.wrapping_shr(self.spare.cast_unsigned());
        } else {
            // The bits held stay too few, so this comes with each call from here on.
            self.window = last(self.bytes, self.position());
        }
    }
}

/// Bits past the end up to which a position is told.
const FARTHEST: usize = 1 << 20;

/// The bits from `position` on, as far as there are any. Not a method: a reader whose address is taken does not stay in registers.
#[cold]
#[inline(never)]
fn last(bytes: &[u8], position: usize) -> u32 {
    let rest = bytes.get(position >> 3..).unwrap_or_default();
    let mut word = [0; 4];
    word.iter_mut().zip(rest).for_each(|(slot, &byte)| *slot = byte);
    u32::from_be_bytes(word).wrapping_shl((position & 7) as u32)
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
        let mut random = Random::new(1);
        let bytes: Vec<u8> = (0..9).map(|_| random.next() as u8).collect();
        for position in (0..100).step_by(stride(7)) {
            for count in 0..=MAX_TAKE {
                let mut reader = BitReader::at(&bytes, position);
                assert_eq!(reader.position(), position);
                let expected = reference(&bytes, position, count);
                let signed = expected as i32 - ((expected >> (count.max(1) - 1) & 1) << count) as i32;
                if count > 0 {
                    assert_eq!(reader.clone().take_signed(count), signed);
                }
                assert_eq!(u32::from(reader.peek_byte()), reference(&bytes, position, 8));
                if count == 1 {
                    assert_eq!(reader.clone().take_bit(), expected);
                }
                assert_eq!(reader.take(count), expected, "{position} {count}");
                assert_eq!(reader.position(), position + count as usize);
                assert_eq!(reader.overrun(), position + count as usize > 72, "{position} {count}");
            }
        }
    }

    #[test]
    fn any_sequence_of_widths() {
        let mut random = Random::new(2);
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
    fn aligning_goes_to_the_next_whole_byte() {
        let bytes: Vec<u8> = (0..20).collect();
        for position in 0..160 {
            let mut reader = BitReader::at(&bytes, position);
            reader.align();
            assert_eq!(reader.position(), position.next_multiple_of(8));
            assert_eq!(reader.take(8), reference(&bytes, position.next_multiple_of(8), 8));
        }
    }

    #[test]
    fn a_position_far_beyond_the_end_is_an_overrun() {
        assert!(BitReader::at(&[1, 2], usize::MAX / 16).overrun());
        assert!(!BitReader::at(&[1, 2], 16).overrun());
        assert!(!BitReader::new(&[]).overrun());
    }
}

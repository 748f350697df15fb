//! Codes of each channel's own width, in two's complement, eight channels from one whole byte to another.

use super::stage::{FrameLoops, Stage};
use crate::arithmetic::BYTES_ONLY;
use crate::error::{Error, Field};

/// Channels of a byte group, whose codes begin on a whole byte: eight codes of a width take whole bytes.
pub const GROUP: usize = 8;

/// The stage, which keeps nothing.
#[derive(Clone, Copy, Debug)]
pub struct FixedWidth;

impl<'s> Stage<'s> for FixedWidth {
    const BYTE_GROUPS: bool = true;

    fn check(tables: &[u8], at: usize) -> Result<u8, Error> {
        if tables.is_empty() { Ok(1) } else { Err(Error::Encoding { field: Field::CodeTables, at }) }
    }

    fn halves(_: &[u8]) -> usize {
        0
    }

    fn open(_: &[u8], _: usize, _: &'s mut [u16]) -> Result<Self, Error> {
        Ok(Self)
    }

    fn context(&self, _: u8, _: u8) -> u8 {
        0
    }

    #[inline(always)]
    fn restart<'c>(&mut self, _: impl Iterator<Item = &'c mut u8>) {}

    #[inline(always)]
    fn codes_from(&self, position: usize) -> usize {
        position.wrapping_add(7) & !7
    }

    #[inline(always)]
    fn feed<L: FrameLoops>(&mut self, loops: L) -> Option<usize> {
        loops.by_byte_groups()
    }
}

/// The code of channel `place` (0 to 7) of a byte group whose codes all have `BITS` bits, 4 to 8.
///
/// With `place` known, a code is two shifts (one instruction on Cortex-M4), and its word is shared by four or eight. Cortex-M0+
/// puts words together from bytes, so there they are of as few as can be.
#[inline(always)]
pub fn field<const BITS: usize>(bytes: &[u8; BITS], place: usize) -> i32 {
    let first = place.wrapping_mul(BITS);
    let shifted = match (BITS, BYTES_ONLY) {
        (4 | 8, true) => byte(bytes, first >> 3) << 24 << (first & 7),
        (_, true) if place < 4 => big_endian::<BITS>(bytes, 0).wrapping_shl(first as u32),
        (_, true) => {
            let before = BITS >> 1;
            big_endian::<BITS>(bytes, before).wrapping_shl(first.wrapping_sub(before.wrapping_mul(8)) as u32)
        }
        // No byte has to change its place.
        (8, false) => {
            let half = if place < 4 { bytes.first_chunk::<4>() } else { bytes.last_chunk::<4>() };
            half.map_or(0, |&half| u32::from_le_bytes(half))
                .wrapping_shl((place as u32 & 3 ^ 3).wrapping_mul(8))
        }
        (_, false) => {
            let (half, skipped) = if place < 4 || BITS == 4 {
                (bytes.first_chunk::<4>(), first)
            } else {
                (bytes.last_chunk::<4>(), first.wrapping_add(32).wrapping_sub(GROUP.wrapping_mul(BITS)))
            };
            half.map_or(0, |&half| u32::from_be_bytes(half)).wrapping_shl(skipped as u32)
        }
    };
    shifted.cast_signed().wrapping_shr(32u32.wrapping_sub(BITS as u32))
}

/// The bytes of four codes, from byte `at` on, at the top of a word.
#[inline(always)]
fn big_endian<const BITS: usize>(bytes: &[u8; BITS], at: usize) -> u32 {
    let word =
        byte(bytes, at) << 24 | byte(bytes, at.wrapping_add(1)) << 16 | byte(bytes, at.wrapping_add(2)) << 8;
    if BITS == 7 { word | byte(bytes, at.wrapping_add(3)) } else { word }
}

#[inline(always)]
fn byte(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at).copied().unwrap_or(0).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bits::BitReader;
    use crate::testing::{Random, times};

    fn check<const BITS: usize>(random: &mut Random) {
        for _ in 0..times(2000, 20) {
            let bytes = [0; BITS].map(|_: u8| random.next() as u8);
            let mut bits = BitReader::new(&bytes);
            for place in 0..GROUP {
                assert_eq!(field(&bytes, place), bits.take_signed(BITS as u32), "{BITS} bits, {place}");
            }
        }
    }

    #[test]
    fn fields_are_what_a_reader_takes() {
        let mut random = Random::new(14);
        check::<4>(&mut random);
        check::<5>(&mut random);
        check::<6>(&mut random);
        check::<7>(&mut random);
        check::<8>(&mut random);
    }
}

//! Codes of each channel's own width, in two's complement, eight channels from one whole byte to another.

use super::SymbolSource;
use crate::bits::BitReader;

/// Channels whose codes begin on a whole byte: eight codes of a width take whole bytes.
pub const OCTET: usize = 8;

/// Fixed-width packing, for channels whose widths differ: where those of an octet are all the same, [`field`] takes
/// codes out at places that the compiler knows.
#[derive(Clone, Copy, Debug)]
pub struct FixedWidth;

impl SymbolSource for FixedWidth {
    #[inline(always)]
    fn code(&mut self, bits: &mut BitReader<'_>, channel: usize, width: u8, _: &mut u8) -> Option<i32> {
        if channel & (OCTET - 1) == 0 {
            bits.align();
        }
        if width == 0 { None } else { Some(bits.take_signed(width.into())) }
    }
}

/// The code of channel `lane` (0 to 7) of an octet whose codes all have `BITS` bits, 4 to 8.
///
/// The first four codes are in the first four bytes, the others in the last four. With `lane` known, a code is two
/// shifts (one instruction on Cortex-M4), and its word is shared by four.
#[inline(always)]
pub fn field<const BITS: usize>(bytes: &[u8; BITS], lane: usize) -> i32 {
    let (word, skipped) = if lane < 4 {
        (bytes.first_chunk::<4>(), lane.wrapping_mul(BITS))
    } else {
        (bytes.last_chunk::<4>(), 32usize.wrapping_sub(OCTET.wrapping_sub(lane).wrapping_mul(BITS)))
    };
    let word = word.map_or(0, |&word| u32::from_be_bytes(word));
    word.wrapping_shl(skipped as u32).cast_signed().wrapping_shr(32u32.wrapping_sub(BITS as u32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, times};

    #[test]
    fn codes_lie_bit_to_bit() {
        let mut bits = BitReader::new(&[0b1011_0011, 0b1000_0001, 0xff]);
        let mut next = |channel, width| FixedWidth.code(&mut bits, channel, width, &mut 0);
        let codes = [next(0, 1), next(1, 3), next(2, 0), next(3, 5), next(4, 7), next(5, 8)];
        assert_eq!(codes, [Some(-1), Some(3), None, Some(7), Some(1), Some(-1)]);
    }

    #[test]
    fn the_ninth_channel_begins_on_a_whole_byte() {
        let mut bits = BitReader::new(&[0b0101_0101, 0b0101_0101, 0b0110_0000]);
        let widths = [1, 1, 2, 0, 1, 1, 1, 2, 3];
        let mut channel = 0..;
        let codes = widths
            .map(|width| FixedWidth.code(&mut bits, channel.next().unwrap(), width, &mut 0).unwrap_or(0));
        assert_eq!(codes, [0, -1, 1, 0, 0, -1, 0, -2, 3]);
    }

    fn check<const BITS: usize>(random: &mut Random) {
        for _ in 0..times(2000, 20) {
            let bytes = [0; BITS].map(|_: u8| random.next() as u8);
            let mut bits = BitReader::new(&bytes);
            for lane in 0..OCTET {
                assert_eq!(field(&bytes, lane), bits.take_signed(BITS as u32), "{BITS} bits, {lane}");
            }
        }
    }

    #[test]
    fn fields_are_what_a_reader_takes() {
        let mut random = Random(14);
        check::<4>(&mut random);
        check::<5>(&mut random);
        check::<6>(&mut random);
        check::<7>(&mut random);
        check::<8>(&mut random);
    }
}

//! Codes of each channel's own width, in two's complement, eight channels from one whole byte to another.

/// Channels whose codes begin on a whole byte: eight codes of a width take whole bytes.
pub const OCTET: usize = 8;

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
    use crate::bits::BitReader;
    use crate::testing::{Random, times};

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

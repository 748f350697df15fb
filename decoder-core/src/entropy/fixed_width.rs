//! Codes of each channel's own width, in two's complement, eight channels from one whole byte to another.

/// Channels whose codes begin on a whole byte: eight codes of a width take whole bytes.
pub const OCTET: usize = 8;

/// Whether a core has no loads from odd addresses, as ARMv6-M, which of all targets that we know has no atomic exchange either.
pub const BYTES_ONLY: bool = !cfg!(target_has_atomic = "32");

/// The code of channel `lane` (0 to 7) of an octet whose codes all have `BITS` bits, 4 to 8.
///
/// With `lane` known, a code is two shifts (one instruction on Cortex-M4), and its word is shared by four or eight. Cortex-M0+
/// puts words together from bytes, so there they are of as few as can be.
#[inline(always)]
pub fn field<const BITS: usize>(bytes: &[u8; BITS], lane: usize) -> i32 {
    let first = lane.wrapping_mul(BITS);
    let shifted = match (BITS, BYTES_ONLY) {
        (4 | 8, true) => byte(bytes, first >> 3) << 24 << (first & 7),
        (_, true) if lane < 4 => big_endian::<BITS>(bytes, 0).wrapping_shl(first as u32),
        (_, true) => {
            let before = BITS >> 1;
            big_endian::<BITS>(bytes, before).wrapping_shl(first.wrapping_sub(before.wrapping_mul(8)) as u32)
        }
        // No byte has to change its place.
        (8, false) => {
            let half = if lane < 4 { bytes.first_chunk::<4>() } else { bytes.last_chunk::<4>() };
            half.map_or(0, |&half| u32::from_le_bytes(half))
                .wrapping_shl((lane as u32 & 3 ^ 3).wrapping_mul(8))
        }
        (_, false) => {
            let (half, skipped) = if lane < 4 || BITS == 4 {
                (bytes.first_chunk::<4>(), first)
            } else {
                (bytes.last_chunk::<4>(), first.wrapping_add(32).wrapping_sub(OCTET.wrapping_mul(BITS)))
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

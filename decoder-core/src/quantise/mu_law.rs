//! The mu-law quantiser (7-5): steps that are narrow about zero and widen with the magnitude.
//!
//! Equation (7-5) as printed, d_i = θ_MAX · log(1 + μ·i/(N/2)) / log(1 + μ), is the compressor's curve: its levels
//! crowd at θ_MAX and are widest about zero, the opposite of what the text asks for. The decision levels are the
//! inverse law, d_i = θ_MAX · ((1 + μ)^(i/(N/2)) − 1) / μ. Reconstruction is in the middle of two levels (7-3),
//! and the negative half mirrors the positive one.
//!
//! The levels are those of the clip's header, in 65536ths of θ_MAX, so any μ, or any other law, decodes without a
//! logarithm. Levels of N/2 steps are every second of those of N, so one table serves all widths up to its own.

use super::quantiser::{Quantise, Step};
use crate::arithmetic::scale;

/// Most levels in a table: those of a code of nine bits.
pub const MAX_LEVELS: usize = 256;

/// Decision levels d_0 = 0 to d_(N/2 − 1) in 65536ths of θ_MAX, little-endian; d_(N/2) is θ_MAX itself.
///
/// A channel's θ_MAX is its step size. Code m from 0 up is the middle of d_m and d_(m+1), code −1 − m its negative.
/// Two loads and two multiplies a code.
#[derive(Clone, Copy, Debug)]
pub struct MuLaw<'a> {
    levels: &'a [[u8; 2]],
    /// Bits of a code that uses all levels, sign included.
    bits: u8,
}

impl<'a> MuLaw<'a> {
    /// A quantiser of these levels: `None` unless there are 1, 2, 4 … or [`MAX_LEVELS`] of them.
    pub fn new(levels: &'a [u8]) -> Option<Self> {
        let (levels, rest) = levels.as_chunks::<2>();
        let count = levels.len();
        if !rest.is_empty() || !count.is_power_of_two() || count > MAX_LEVELS {
            return None;
        }
        // At most 9.
        let bits = (count.trailing_zeros() as u8).wrapping_add(1);
        Some(Self { levels, bits })
    }

    /// The levels as a header has them.
    pub const fn bytes(&self) -> &'a [u8] {
        self.levels.as_flattened()
    }

    /// Most bits of a channel's code.
    pub const fn bits(&self) -> u8 {
        self.bits
    }

    /// Level `index` of the `2^(bits−1)` that a code of so many bits has, in 65536ths of θ_MAX.
    #[inline(always)]
    fn level(&self, index: u32, bits: u8) -> u32 {
        let stride = u32::from(self.bits.wrapping_sub(bits));
        let level = self.levels.get(index.wrapping_shl(stride) as usize);
        level.map_or(65536, |&level| u32::from(u16::from_le_bytes(level)))
    }
}

impl Quantise for MuLaw<'_> {
    #[inline(always)]
    fn difference(&self, code: i32, step: &mut Step, bits: u8) -> i32 {
        // All bits set for negative codes.
        let sign = code >> 31;
        let index = (code ^ sign).cast_unsigned();
        let sum = self.level(index, bits).wrapping_add(self.level(index.wrapping_add(1), bits));
        // A quarter of the sum of two 65536ths: the middle, in 32768ths.
        let middle = (sum >> 2).min(0x7fff) as i16;
        let value = scale(step.word(), middle).wrapping_shl(1);
        (value ^ sign).wrapping_sub(sign)
    }

    /// By halving: the decision level in the middle says in which half to go on (7.2.2).
    fn nearest(&self, difference: i32, step: i32, bits: u8) -> i32 {
        let (mut low, mut count) = (0u32, 1u32.wrapping_shl(bits.into()) >> 1);
        while count > 1 {
            count >>= 1;
            let middle = low.wrapping_add(count);
            let level = self.level(middle, bits) >> 1;
            if difference.unsigned_abs()
                >= scale(step, level.min(0x7fff) as i16).wrapping_shl(1).unsigned_abs()
            {
                low = middle;
            }
        }
        low.cast_signed() ^ (difference >> 31)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::signed;
    use crate::quantise::step::size;
    use std::vec::Vec;

    fn levels(mu: f64, count: usize) -> Vec<u8> {
        let level = |i: usize| ((1.0 + mu).powf(i as f64 / count as f64) - 1.0) / mu * 65536.0;
        (0..count).flat_map(|i| (level(i).round() as u16).to_le_bytes()).collect()
    }

    #[test]
    fn values_are_the_middles_of_the_inverse_law() {
        for (mu, count) in [(255.0, 128), (255.0, 256), (10.0, 32), (100.0, 1)] {
            let levels = levels(mu, count);
            let law = MuLaw::new(&levels).unwrap();
            for bits in 1..=law.bits() {
                let half = f64::from(1u32 << (bits - 1));
                for step in [60, 104, 140, 199] {
                    let most = f64::from(size(step));
                    for symbol in 0..1u32 << bits {
                        let at = |i: u32| ((1.0 + mu).powf(f64::from(i) / half) - 1.0) / mu * most;
                        let middle = (at(symbol / 2) + at(symbol / 2 + 1)) / 2.0;
                        let expected = if symbol % 2 == 0 { middle } else { -middle };
                        let found =
                            f64::from(law.difference(signed(symbol), &mut Step::of(size(step)), bits));
                        // A 65536th for the levels' rounding, a 32768th for the middle's.
                        assert!(
                            (found - expected).abs() <= most / 16384.0 + 3.0,
                            "{mu} {bits} {symbol}: {found} {expected}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn steps_are_narrowest_about_zero() {
        let levels = levels(255.0, 128);
        let law = MuLaw::new(&levels).unwrap();
        let values: Vec<i32> = (0..32).map(|m| law.difference(m, &mut Step::of(size(140)), 6)).collect();
        let gaps: Vec<i32> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(gaps.windows(2).all(|pair| pair[0] <= pair[1]), "{gaps:?}");
        assert!(gaps[30] > 100 * gaps[0], "{gaps:?}");
    }

    #[test]
    fn the_search_finds_the_cell_that_a_value_is_in() {
        let levels = levels(255.0, 16);
        let law = MuLaw::new(&levels).unwrap();
        for bits in 1..=5 {
            let half = 1 << (bits - 1);
            for code in -half..half {
                let value = law.difference(code, &mut Step::of(size(90)), bits);
                if value != 0 {
                    assert_eq!(law.nearest(value, size(90), bits), code, "{bits} {value}");
                }
            }
            assert_eq!(law.nearest(i32::MAX, size(90), bits), half - 1);
            assert_eq!(law.nearest(i32::MIN, size(90), bits), -half);
        }
    }

    #[test]
    fn tables_of_other_sizes_are_none() {
        for bytes in [0, 1, 3, 6, 1024] {
            assert!(MuLaw::new(&std::vec![0; bytes]).is_none(), "{bytes}");
        }
    }
}

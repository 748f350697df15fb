//! The adaptive quantiser (7-7): a uniform one whose step follows the codes.
//!
//! Δ(n) = β · Δ(n − 1), where β depends on the code n − 1 alone. Steps are in equal ratios of 2^(1/8), so
//! multiplying by β is adding to the step's index, and what is added is a table of the clip's header. The index is
//! bounded, so the step is.

use super::quantiser::{Quantise, Step};
use super::step::{MAX_STEP, SIZES};
use super::uniform::Uniform;

/// Classes of codes, each with a multiplier: sixteenths of all codes of a width.
pub const CLASSES: usize = 16;

/// What a clip fixes for all channels. A channel's step is its index, counted from the lowest one, in the lower half of a word.
///
/// A code costs three look-ups and a multiply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adaptive {
    /// log₂ β in eighths, for the codes of each class.
    pub multipliers: [i8; CLASSES],
    /// Lowest index of a step.
    pub low: u8,
    /// Highest index of a step, not below the lowest.
    pub high: u8,
    /// The highest index from the lowest one on.
    range: u8,
    /// Whether it can change a step.
    adapts: bool,
    /// The sizes from the lowest step on.
    sizes: &'static [i32; 256],
}

impl Adaptive {
    /// A quantiser with these multipliers and bounds.
    pub fn new(multipliers: [i8; CLASSES], low: u8, high: u8) -> Self {
        let adapts = multipliers.iter().any(|&by| by != 0) || low > 0 || high < MAX_STEP;
        let sizes = SIZES.get(usize::from(low)..).and_then(<[i32]>::first_chunk).unwrap_or(&[0; 256]);
        Self { multipliers, low, high, range: high.saturating_sub(low), adapts, sizes }
    }

    /// Whether it can change a step.
    pub const fn adapts(&self) -> bool {
        self.adapts
    }

    /// The step with this index, brought between the bounds.
    pub fn step(&self, index: u8) -> Step {
        let index = index.min(self.high).max(self.low).wrapping_sub(self.low);
        Step::first(index)
    }

    /// The class of a code: its first four bits; zeros stand for bits that it has not. So with four bits each code has a
    /// multiplier of its own. Positive codes are in classes 0 to 7, negative ones in 8 to 15.
    #[inline(always)]
    pub const fn class(code: i32, bits: u8) -> usize {
        (code.cast_unsigned().wrapping_shl(32u32.wrapping_sub(bits as u32)) >> 28) as usize
    }
}

impl Quantise for Adaptive {
    const KEEPS: bool = true;

    #[inline(always)]
    fn difference(&self, code: i32, step: &mut Step, bits: u8) -> i32 {
        let Step([kept, ..]) = step;
        let index = *kept;
        let by = self.multipliers.get(Self::class(code, bits)).copied().unwrap_or(0);
        let range = u32::from(self.range);
        let next = i32::from(index).wrapping_add(by.into());
        // One comparison where it is between the bounds.
        *kept = if next.cast_unsigned() <= range {
            next as u8
        } else if next < 0 {
            0
        } else {
            self.range
        };
        self.size(index.into()).wrapping_mul(code)
    }

    fn nearest(&self, difference: i32, step: i32, bits: u8) -> i32 {
        Uniform.nearest(difference, self.size(step), bits)
    }

    #[inline(always)]
    fn size(&self, step: i32) -> i32 {
        self.sizes.get(usize::from(step as u8)).copied().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantise::step::size;
    use crate::testing::stride;

    /// All steps, widths and codes, with multipliers that reach past both bounds.
    #[test]
    fn every_transition() {
        let tables = [
            [-2, -2, -1, -1, 3, 5, 7, 9, 10, 7, 5, 3, -1, -1, -2, -2],
            [-128, 127, -127, 126, -1, 0, 1, 127, 2, 3, 4, 5, 6, 7, 8, -9],
            [0; 16],
        ];
        let mut transitions = 0u64;
        for multipliers in tables {
            for (low, high) in [(0, MAX_STEP), (40, 160), (77, 77)] {
                let quantiser = Adaptive::new(multipliers, low, high);
                assert_eq!(quantiser.adapts(), multipliers != [0; 16] || (low, high) != (0, MAX_STEP));
                for index in (low..=high).step_by(stride(67)) {
                    for bits in 1..=8u8 {
                        for code in -(1 << (bits - 1))..1i32 << (bits - 1) {
                            let mut step = quantiser.step(index);
                            let difference = quantiser.difference(code, &mut step, bits);
                            let exact = i64::from(code) * i64::from(size(index));
                            assert_eq!(difference, exact as i32, "wraps");
                            let class = (code * 16).div_euclid(1 << bits).rem_euclid(16) as usize;
                            let next = (i64::from(index) + i64::from(multipliers[class]))
                                .clamp(low.into(), high.into());
                            assert_eq!(i64::from(step.0[0]) + i64::from(low), next);
                            assert_eq!(step.0[1], index - low, "the first one stays");
                            transitions += 1;
                        }
                    }
                }
            }
        }
        assert!(cfg!(miri) || transitions == 3 * (200 + 121 + 1) * 510, "{transitions}");
    }

    #[test]
    fn the_nearest_code_to_a_codes_difference_is_that_code() {
        let quantiser = Adaptive::new([3; CLASSES], 0, MAX_STEP);
        for step in [0, 40, 99, 160].map(|index| quantiser.step(index)) {
            for code in -16..16 {
                let difference = quantiser.difference(code, &mut { step }, 5);
                assert_eq!(quantiser.nearest(difference, step.word(), 5), code);
            }
        }
    }

    /// Every code of more bits than an octet's: the index stays bounded.
    #[test]
    fn wide_codes_are_bounded_too() {
        let multipliers = [-9, -3, 0, 1, 2, 5, 9, 127, -128, 9, 5, 2, 1, 0, -3, -9];
        let quantiser = Adaptive::new(multipliers, 10, 190);
        for bits in 9..=16u8 {
            let mut step = quantiser.step(100);
            for code in (-(1 << (bits - 1))..1i32 << (bits - 1)).step_by(stride(509)) {
                quantiser.difference(code, &mut step, bits);
                assert!((0..=180).contains(&step.0[0]));
            }
        }
    }
}

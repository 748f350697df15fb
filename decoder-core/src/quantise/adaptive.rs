//! The adaptive quantiser (7-7): a uniform one whose step follows the codes.
//!
//! Δ(n) = β · Δ(n − 1), where β depends on the code n − 1 alone. Steps are in equal ratios of 2^(1/8), so
//! multiplying by β is adding to the step's index, and what is added is a table of the clip's header. The index is
//! bounded, so the step is.

use super::{Cell, Quantise, Uniform};
use crate::arithmetic::signed;

/// Classes of code magnitudes, each with a multiplier.
pub const CLASSES: usize = 8;

/// What a clip fixes for all channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adaptive {
    /// log₂ β in eighths, for the codes of each class.
    pub multipliers: [i8; CLASSES],
    /// Lowest index of a step.
    pub low: u8,
    /// Highest index of a step.
    pub high: u8,
}

impl Adaptive {
    /// The class of a code: its magnitude in eighths of the largest, `min(⌊|code| · 16 / 2^bits⌋, 7)`.
    #[inline(always)]
    pub const fn class(code: i32, bits: u8) -> usize {
        let class = code.unsigned_abs().wrapping_shl(4).wrapping_shr(bits as u32);
        if class > 7 { 7 } else { class as usize }
    }
}

impl Quantise for Adaptive {
    #[inline(always)]
    fn difference(&self, symbol: u32, cell: &mut Cell) -> i32 {
        let difference = Uniform.difference(symbol, cell);
        let class = Self::class(signed(symbol), cell.bits);
        let by = self.multipliers.get(class).copied().unwrap_or(0);
        cell.step = cell.step.saturating_add_signed(by).min(self.high).max(self.low);
        difference
    }

    fn nearest(&self, difference: i32, cell: &Cell) -> u32 {
        Uniform.nearest(difference, cell)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantise::step::{MAX_STEP, size};
    use crate::testing::stride;

    /// All steps, widths and symbols, with multipliers that reach past both bounds.
    #[test]
    fn every_transition() {
        let tables = [[-2, -2, -1, -1, 3, 5, 7, 9], [-128, 127, -127, 126, -1, 0, 1, 127], [0; 8]];
        let mut transitions = 0u64;
        for multipliers in tables {
            for (low, high) in [(0, MAX_STEP), (40, 160), (77, 77)] {
                let quantiser = Adaptive { multipliers, low, high };
                for step in (low..=high).step_by(stride(67)) {
                    for bits in 1..=8u8 {
                        for symbol in 0..1u32 << bits {
                            let mut cell = Cell { step, bits };
                            let difference = quantiser.difference(symbol, &mut cell);
                            let code = i64::from(signed(symbol));
                            assert_eq!(difference, (code * i64::from(size(step))) as i32, "wraps");
                            let class = (code.unsigned_abs() * 16 / (1 << bits)).min(7) as usize;
                            let next = (i64::from(step) + i64::from(multipliers[class]))
                                .clamp(0, 255)
                                .clamp(i64::from(low), i64::from(high));
                            assert_eq!(i64::from(cell.step), next);
                            assert_eq!(cell.bits, bits);
                            transitions += 1;
                        }
                    }
                }
            }
        }
        assert!(cfg!(miri) || transitions == 3 * (200 + 121 + 1) * 510, "{transitions}");
    }

    /// Every symbol with more bits than a prefix table holds: the index stays bounded.
    #[test]
    fn wide_codes_are_bounded_too() {
        let quantiser = Adaptive { multipliers: [-9, -3, 0, 1, 2, 5, 9, 127], low: 10, high: 190 };
        for bits in 9..=16u8 {
            let mut cell = Cell { step: 100, bits };
            for symbol in (0..1u32 << bits).step_by(stride(509)) {
                quantiser.difference(symbol, &mut cell);
                assert!((10..=190).contains(&cell.step));
            }
        }
    }
}

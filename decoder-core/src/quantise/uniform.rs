//! Uniform quantisers: of values between two limits (7-4), and of differences about zero.

use super::quantiser::{MAX_BITS, Quantise, Step};

/// Values between two limits θ_L and θ_U in N steps of Δ = (θ_U − θ_L) / N: decision levels d_i = θ_L + i·Δ (7-4),
/// reconstruction in the middle of two of them (7-3).
///
/// Δ = mantissa · 2^exponent, so that it fits a channel's memory. The error is at most Δ/2 inside the limits;
/// values outside get the nearest level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// θ_L, a word.
    pub low: i32,
    /// Δ without its power of two, at least 1.
    pub mantissa: i16,
    /// The power of two in Δ, 0 to [`MAX_EXPONENT`].
    pub exponent: u8,
}

/// Largest exponent of a grid's step.
pub const MAX_EXPONENT: u8 = 15;

impl Grid {
    /// A grid of 2^bits steps that covers `low` to `high` with the least Δ that a mantissa of 15 bits has.
    /// `None` where `low` is above `high`, bits is not 1 to 16, or Δ would be 2³⁰ or more.
    pub fn covering(low: i32, high: i32, bits: u8) -> Option<Self> {
        if low > high || !(1..=MAX_BITS).contains(&bits) {
            return None;
        }
        let range = low.abs_diff(high);
        let rounded = range.checked_shr(u32::from(bits))?.saturating_add(1);
        let mut exponent = 0u8;
        while rounded.checked_shr(u32::from(exponent))? >= 0x7fff {
            exponent = exponent.checked_add(1)?;
        }
        let mantissa = rounded.checked_shr(u32::from(exponent))?;
        if exponent > MAX_EXPONENT {
            return None;
        }
        let exact = mantissa.checked_shl(u32::from(exponent))? == rounded;
        let mantissa = i16::try_from(if exact { mantissa } else { mantissa.saturating_add(1) }).ok()?;
        Some(Self { low, mantissa, exponent })
    }

    /// Δ.
    #[inline(always)]
    pub const fn step(self) -> i32 {
        (self.mantissa as i32).wrapping_shl(self.exponent as u32)
    }

    /// The value that code 0 of `bits` bits stands for: `low + 2^(bits − 1) · Δ + ⌊Δ / 2⌋`, wrapping. Code c stands for
    /// c · Δ more, so that a grid's codes are those of a [`Uniform`] quantiser of differences to this value.
    pub const fn middle(self, bits: u8) -> i32 {
        let codes = 1i32.wrapping_shl(bits as u32) >> 1;
        let step = self.step();
        self.low.wrapping_add(codes.wrapping_mul(step)).wrapping_add(step >> 1)
    }
}

/// Differences in steps about zero: code · Δ, with zero a level of its own.
///
/// One multiply a code; the error is at most Δ/2 where the code is in range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Uniform;

impl Quantise for Uniform {
    #[inline(always)]
    fn difference(&self, code: i32, step: &mut Step, _: u8) -> i32 {
        step.word().wrapping_mul(code)
    }

    fn nearest(&self, difference: i32, step: i32, bits: u8) -> i32 {
        // Halves away from zero.
        let half = (step >> 1).wrapping_mul(difference.signum());
        let code = difference.saturating_add(half).checked_div(step).unwrap_or(0);
        let most = 1i32.wrapping_shl(bits.into()) >> 1;
        code.clamp(most.wrapping_neg(), most.wrapping_sub(1).max(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantise::step::size;
    use crate::testing::{Random, stride, times};

    fn codes(bits: u8) -> core::ops::Range<i32> {
        let half = 1 << (bits - 1);
        -half..half
    }

    #[test]
    fn every_code_is_the_nearest_to_its_own_value() {
        for bits in 1..=10 {
            for (low, high) in [(-5 << 16, 90 << 16), (0, 0), (i32::MIN, i32::MAX), (-7, 300_000), (3, 5)] {
                let Some(grid) = Grid::covering(low, high, bits) else {
                    assert!(bits < 3 && low == i32::MIN);
                    continue;
                };
                for code in codes(bits).step_by(stride(13)) {
                    let above = i64::from(code) + (1 << (bits - 1));
                    let value = i64::from(low) + above * i64::from(grid.step()) + i64::from(grid.step() / 2);
                    let difference = Uniform.difference(code, &mut Step::of(grid.step()), bits);
                    assert_eq!(grid.middle(bits).wrapping_add(difference), value as i32);
                    if i64::from(difference) == i64::from(code) * i64::from(grid.step()) {
                        assert_eq!(Uniform.nearest(difference, grid.step(), bits), code);
                    }
                }
            }
        }
    }

    #[test]
    fn the_error_is_half_a_step_between_the_limits() {
        let mut random = Random::new(4);
        for _ in 0..times(200_000, 300) {
            let bits = 1 + random.below(16) as u8;
            let (a, b) = (random.next() as i32 >> random.below(32), random.next() as i32 >> random.below(32));
            let (low, high) = (a.min(b), a.max(b));
            let Some(grid) = Grid::covering(low, high, bits) else { continue };
            let ideal = (f64::from(high) - f64::from(low)) / f64::from(1u32 << bits);
            assert!(f64::from(grid.step()) <= ideal * (1.0 + 2f64.powi(-13)) + 1.0, "{grid:?} {ideal}");
            let value =
                low.wrapping_add((random.next() % (low.abs_diff(high).saturating_add(1)).max(1)) as i32);
            let middle = grid.middle(bits);
            let Some(difference) = value.checked_sub(middle) else { continue };
            let step = grid.step();
            let code = Uniform.nearest(difference, step, bits);
            let found = i64::from(middle) + i64::from(Uniform.difference(code, &mut Step::of(step), bits));
            // Differences of half of all words wrap.
            if i32::try_from(i64::from(code) * i64::from(step)).is_ok() {
                let error = (found - i64::from(value)).abs();
                assert!(2 * error <= i64::from(grid.step()) + 1, "{grid:?} {value} {found}");
            }
        }
    }

    #[test]
    fn values_outside_get_the_nearest_level() {
        let grid = Grid::covering(0, 255, 4).unwrap();
        let code = |value: i32| Uniform.nearest(value - grid.middle(4), grid.step(), 4);
        assert_eq!((code(-1000), code(1000)), (-8, 7));
        assert_eq!(Grid::covering(1, 0, 4), None);
        assert_eq!(Grid::covering(0, 1, 0), None);
        assert_eq!(Grid::covering(0, 1, 17), None);
    }

    #[test]
    fn differences_are_whole_steps() {
        for index in (0..=crate::quantise::step::MAX_STEP).step_by(stride(67)) {
            let step = size(index);
            for bits in 1..=8 {
                for code in codes(bits) {
                    let exact = i64::from(step) * i64::from(code);
                    let difference = Uniform.difference(code, &mut Step::of(step), bits);
                    assert_eq!(difference, exact as i32, "wraps");
                    if i64::from(difference) == exact {
                        assert_eq!(Uniform.nearest(difference, step, bits), code);
                    }
                }
            }
        }
        assert_eq!([i32::MIN, i32::MAX].map(|far| Uniform.nearest(far, size(100), 4)), [-8, 7]);
        assert_eq!(Uniform.nearest(1 << 20, 0, 0), 0);
    }
}

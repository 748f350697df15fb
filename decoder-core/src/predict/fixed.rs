//! Fixed predictors of first and second order (7-12), whose coefficients stay as the clip's header has them.
//!
//! They are written such that each costs one 32-bit product, whatever the value: a value has 32 bits, and so does a
//! product on Cortex-M0+. The first order multiplies whole units, the second the last movement.

use crate::arithmetic::BYTES_ONLY;

/// What the second order's coefficient is in parts of.
pub const MOMENTUM_ONE: i8 = 64;

/// What the first order's leak is in parts of.
pub const LEAK_ONE: i32 = 1 << 16;

/// A predictor.
pub trait Predict {
    /// Whether `second` is the value before the last one, which is to be kept up.
    const KEEPS: bool = false;

    /// The prediction from the last value; `second` and `coefficient` are what the channel's state has.
    fn predict(&self, last: i32, second: i32, coefficient: i8) -> i32;
}

/// A constant, which is `second`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Constant;

impl Predict for Constant {
    #[inline(always)]
    fn predict(&self, _: i32, second: i32, _: i8) -> i32 {
        second
    }
}

/// First order: α · x(n − 1), as x − λ · ⌊x / 2¹⁶⌋, where `second` is −λ, which is α − 1 in 65536ths ([`LEAK_ONE`]), −32767 to 32767.
/// λ = 0 predicts the last value.
///
/// The best α is R(1)/R(0) (7-14); the encoder finds it. That the leak is that of the whole units makes a difference of
/// at most λ words. A shift, a multiplication and a subtraction.
#[derive(Clone, Copy, Debug, Default)]
pub struct First;

impl Predict for First {
    #[inline(always)]
    fn predict(&self, last: i32, second: i32, _: i8) -> i32 {
        last.wrapping_add((last >> 16).wrapping_mul(second))
    }
}

/// The same, written as Cortex-M4's instruction SMLATB: it multiplies halves of words.
#[derive(Clone, Copy, Debug, Default)]
pub struct FirstByHalves;

impl Predict for FirstByHalves {
    #[inline(always)]
    fn predict(&self, last: i32, second: i32, coefficient: i8) -> i32 {
        // Cortex-M0+ has no such instruction, and would have to cut the half off.
        let second = if BYTES_ONLY { second } else { i32::from(second as i16) };
        First.predict(last, second, coefficient)
    }
}

/// Second order: the last value and a part of the last movement, x(n − 1) + ⌊β · (x(n − 1) − x(n − 2)) / 64⌋, where
/// `coefficient` is β in 64ths ([`MOMENTUM_ONE`]) and `second` x(n − 2): α₁ = 1 + β and α₂ = −β of (7-12).
///
/// Movements whose product with β is not in a word wrap: those of 512 units a frame where β is 1. Two additions, a
/// multiplication and a shift.
#[derive(Clone, Copy, Debug, Default)]
pub struct Second;

impl Predict for Second {
    const KEEPS: bool = true;

    #[inline(always)]
    fn predict(&self, last: i32, second: i32, coefficient: i8) -> i32 {
        let movement = last.wrapping_sub(second);
        last.wrapping_add(movement.wrapping_mul(coefficient.into()) >> 6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, times};

    #[test]
    fn the_first_order_is_the_formula_to_a_leak_of_one_unit() {
        let mut random = Random::new(5);
        for _ in 0..times(200_000, 300) {
            let (last, leak) = (random.next() as i32, random.below(1 << 15) as i32);
            let exact = (1.0 - f64::from(leak) / f64::from(LEAK_ONE)) * f64::from(last);
            assert_eq!(FirstByHalves.predict(last, -leak, 0), First.predict(last, -leak, 0));
            let found = f64::from(First.predict(last, -leak, 0));
            assert!((0.0..=f64::from(leak)).contains(&(found - exact)), "{last} {leak}: {exact} {found}");
        }
    }

    #[test]
    fn the_second_order_is_the_formula_rounded_down() {
        let mut random = Random::new(5);
        for _ in 0..times(200_000, 300) {
            // Within ±128 units, so that nothing wraps.
            let (last, second) = (random.next() as i32 >> 8, random.next() as i32 >> 8);
            let coefficient = (random.below(129) as i16 - 64) as i8;
            let part = f64::from(coefficient) / f64::from(MOMENTUM_ONE);
            let exact = (1.0 + part) * f64::from(last) - part * f64::from(second);
            assert_eq!(f64::from(Second.predict(last, second, coefficient)), exact.floor());
        }
    }

    #[test]
    fn without_coefficients_it_is_the_last_value() {
        for last in [i32::MIN, -70_003, -1, 0, 1, 4, 5_000_001, i32::MAX] {
            assert_eq!(First.predict(last, 0, 0), last);
            assert_eq!(Second.predict(last, 9, 0), last);
            assert_eq!(Constant.predict(9, last, 0), last);
        }
    }
}

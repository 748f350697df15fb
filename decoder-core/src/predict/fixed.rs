//! Fixed linear predictors of first and second order (7-12).

use crate::arithmetic::scale;

/// A predictor whose coefficients stay as the clip's header has them.
pub trait Predict {
    /// The prediction from the last value and from `before`, the one before it.
    fn predict(&self, coefficients: [i16; 2], last: i32, before: i32) -> i32;
}

/// The last value: differences between frames, without a multiplication.
#[derive(Clone, Copy, Debug)]
pub struct Last;

impl Predict for Last {
    #[inline(always)]
    fn predict(&self, _: [i16; 2], last: i32, _: i32) -> i32 {
        last
    }
}

/// First order: α₁ · x(n − 1). The best α₁ is R(1)/R(0) (7-14); the encoder finds it. One multiplication of a word.
#[derive(Clone, Copy, Debug)]
pub struct First;

impl Predict for First {
    #[inline(always)]
    fn predict(&self, [first, _]: [i16; 2], last: i32, _: i32) -> i32 {
        scale(last, first).wrapping_shl(2)
    }
}

/// Second order: α₁ · x(n − 1) + α₂ · x(n − 2), with two multiplications of a word.
///
/// Coefficients reach from −2 to almost 2. Where they are outside the triangle |α₂| < 1, |α₁| < 1 − α₂, values run
/// away and wrap; the encoder keeps them inside or on its edge.
#[derive(Clone, Copy, Debug)]
pub struct Second;

impl Predict for Second {
    #[inline(always)]
    fn predict(&self, [first, second]: [i16; 2], last: i32, before: i32) -> i32 {
        scale(last, first).wrapping_add(scale(before, second)).wrapping_shl(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::predict::ONE;
    use crate::testing::{Random, times};

    #[test]
    fn predictions_are_the_formula_to_a_few_last_places() {
        let mut random = Random(5);
        for _ in 0..times(200_000, 500) {
            // Within ±4096 units, so that nothing wraps.
            let (last, before) = (random.next() as i32 >> 3, random.next() as i32 >> 3);
            let coefficients = [random.next() as i16, random.next() as i16];
            let [first, second] = coefficients.map(|c| f64::from(c) / f64::from(ONE));
            let exact = first * f64::from(last) + second * f64::from(before);
            let found = Second.predict(coefficients, last, before);
            assert!((exact - f64::from(found)).abs() <= 8.0, "{exact} {found}");
            let exact = first * f64::from(last);
            let found = First.predict(coefficients, last, before);
            assert!((exact - f64::from(found)).abs() <= 4.0, "{exact} {found}");
        }
    }

    #[test]
    fn a_coefficient_of_one_keeps_all_but_two_bits() {
        for last in [-70_003, -1, 0, 1, 4, 5_000_001] {
            assert_eq!(First.predict([ONE, 0], last, 9), last >> 2 << 2);
        }
    }
}

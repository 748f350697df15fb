//! Between two frames: linear, in 32-bit integers.

/// Bits of a [`Fraction`].
const FRACTION_BITS: u32 = 15;

/// How far a tick is from one frame to the next, in 1/32768: 0 is the first frame, 32768 (the second) is excluded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Fraction(u16);

impl Fraction {
    /// `phase / period`, rounded down. One divide; made once a tick, for all channels.
    ///
    /// `phase < period ≤ 131071`, so that the product stays in 32 bits; a larger phase counts as the largest.
    pub const fn of(phase: u32, period: u32) -> Self {
        debug_assert!(phase < period && period <= 131_071);
        let fraction = (phase << FRACTION_BITS) / period;
        Self(if fraction >> FRACTION_BITS == 0 { fraction as u16 } else { (1 << FRACTION_BITS) - 1 })
    }

    /// The fraction in 1/32768.
    pub const fn bits(self) -> u16 {
        self.0
    }
}

/// The value at `fraction` of the way from `from` to `to`: `from + ⌊(to − from) · fraction⌋`, exact for every
/// input.
///
/// Raw values of one unit, for instance the bits of an I16F16. The difference has 33 bits, so it is multiplied in
/// halves of 16: two 32-bit multiplies, no 64-bit one.
pub const fn lerp(from: i32, to: i32, fraction: Fraction) -> i32 {
    let fraction = fraction.0 as i32;
    let high = (to >> 16) - (from >> 16);
    let low = (to & 0xffff) - (from & 0xffff);
    // |high|, |low| ≤ 65535 and fraction ≤ 32767: neither product overflows. Doubling `high`'s may, but the sum
    // lies between `from` and `to`, so wrapping gives it exactly.
    let step = (high * fraction).wrapping_mul(2).wrapping_add((low * fraction) >> FRACTION_BITS);
    from.wrapping_add(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn slow(from: i32, to: i32, fraction: Fraction) -> i128 {
        let difference = i128::from(to) - i128::from(from);
        i128::from(from) + (difference * i128::from(fraction.bits())).div_euclid(1 << FRACTION_BITS)
    }

    #[test]
    fn the_extremes_are_exact() {
        let values =
            [i32::MIN, i32::MIN + 1, -65_537, -65_536, -1, 0, 1, 65_535, 65_536, i32::MAX - 1, i32::MAX];
        for from in values {
            for to in values {
                for bits in [0, 1, 16_384, 32_766, 32_767] {
                    let fraction = Fraction(bits);
                    assert_eq!(i128::from(lerp(from, to, fraction)), slow(from, to, fraction));
                }
            }
        }
    }

    #[test]
    fn a_fraction_of_nothing_is_the_frame_itself() {
        assert_eq!(lerp(-7, i32::MAX, Fraction::of(0, 100)), -7);
    }

    proptest! {
        #[test]
        fn lerp_equals_the_wide_reference(from: i32, to: i32, bits in 0u16..1 << FRACTION_BITS) {
            let fraction = Fraction(bits);
            prop_assert_eq!(i128::from(lerp(from, to, fraction)), slow(from, to, fraction));
        }

        #[test]
        fn a_fraction_is_the_quotient_rounded_down(period in 1u32..=131_071, part in 0.0f64..1.0) {
            let phase = ((f64::from(period) * part) as u32).min(period - 1);
            let expected = u64::from(phase) * 32_768 / u64::from(period);
            prop_assert_eq!(u64::from(Fraction::of(phase, period).bits()), expected);
        }
    }
}

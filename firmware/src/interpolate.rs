//! Between frames: linear, or cubic (Catmull-Rom), in 32-bit integers.

/// Bits of a [`Fraction`].
const FRACTION_BITS: u32 = 15;

/// How far a tick is from one frame to the next, in 1/32768: 0 is the first frame, 32768 (the second) is excluded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Fraction(u16);

impl Fraction {
    /// At the first frame.
    pub const START: Self = Self(0);

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
    let high = (to >> 16) - (from >> 16);
    let low = (to & 0xffff) - (from & 0xffff);
    from.wrapping_add(part(high, low, fraction))
}

/// `⌊(65536 · high + low) · fraction⌋`, modulo 2³²; |high|, |low| ≤ 65535.
const fn part(high: i32, low: i32, fraction: Fraction) -> i32 {
    // Neither product overflows, since the fraction is at most 32767. Doubling the high one may, where the result
    // does not fit either.
    let fraction = fraction.0 as i32;
    (high * fraction).wrapping_mul(2).wrapping_add((low * fraction) >> FRACTION_BITS)
}

/// Bits that a cubic's coefficients give away, so that they fit: 1/2048 of a degree remains.
const CUBIC_SHIFT: u32 = 5;

/// The value at `fraction` of the way from `taps[1]` to `taps[2]` on the Catmull-Rom curve through four frames in a row
/// (Catmull and Rom 1974, "A class of local interpolating splines"): at both its slope is half the way between its neighbours.
///
/// Raw values of one unit. The curve may leave the range of its taps by an eighth of their largest difference; beyond
/// the range of an i32 it saturates. Rounds down, to 1/2048 where the unit is 1/65536. Six 32-bit multiplies.
pub const fn catmull_rom(taps: [i32; 4], fraction: Fraction) -> i32 {
    let [before, from, to, after] = taps;
    // |x| ≤ 2²⁶, and the largest coefficient's sum is 12 of them.
    let [p0, p1, p2, p3] =
        [before >> CUBIC_SHIFT, from >> CUBIC_SHIFT, to >> CUBIC_SHIFT, after >> CUBIC_SHIFT];
    let cubic = 3 * (p1 - p2) + p3 - p0;
    let square = 2 * p0 - 5 * p1 + 4 * p2 - p3;
    let linear = p2 - p0;
    let sum = linear + of(square + of(cubic, fraction), fraction);
    // Half of it, in the raw unit.
    let value = from as i64 + ((of(sum, fraction) as i64) << (CUBIC_SHIFT - 1));
    if value > i32::MAX as i64 {
        i32::MAX
    } else if value < i32::MIN as i64 {
        i32::MIN
    } else {
        value as i32
    }
}

/// `⌊value · fraction⌋`.
const fn of(value: i32, fraction: Fraction) -> i32 {
    part(value >> 16, value & 0xffff, fraction)
}

/// `3s² − 2s³` and its like have a jump in acceleration at their ends; this does not: `10s³ − 15s⁴ + 6s⁵`, in 1/32768.
///
/// The path of least jerk from rest to rest (Flash and Hogan 1985). Its highest velocity is 15/8 of the mean one.
///
/// Two 64-bit multiplies; made once a tick, for all joints.
pub const fn least_jerk(fraction: Fraction) -> Fraction {
    let s = fraction.0 as u64;
    // In 1/2⁴⁵ and, between 1 and 10, in 1/2³⁰.
    let rest = (10 << (2 * FRACTION_BITS)) + 6 * s * s - ((15 * s) << FRACTION_BITS);
    let path = (((s * s * s) >> FRACTION_BITS) * rest) >> (3 * FRACTION_BITS);
    Fraction(if path >> FRACTION_BITS == 0 { path as u16 } else { (1 << FRACTION_BITS) - 1 })
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

    #[test]
    fn least_jerk_follows_its_polynomial() {
        let mut last = 0;
        for bits in 0..1u16 << FRACTION_BITS {
            let s = f64::from(bits) / 32_768.0;
            let exact = 32_768.0 * s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            let found = least_jerk(Fraction(bits)).bits();
            assert!((f64::from(found) - exact).abs() <= 1.1, "{bits}: {found}, {exact}");
            assert!(found >= last, "{bits}");
            last = found;
        }
        assert_eq!(least_jerk(Fraction(0)).bits(), 0);
        assert!(last == 32_767);
    }

    #[test]
    fn a_cubic_goes_through_its_frames_and_keeps_lines() {
        assert_eq!(catmull_rom([5 << 16, 7 << 16, -3 << 16, 99], Fraction(0)), 7 << 16);
        for bits in [0, 1, 9_000, 32_767] {
            let line = [0, 64 << 16, 128 << 16, 192 << 16];
            let exact = (64 << 16) + bits * 128;
            assert!((catmull_rom(line, Fraction(bits as u16)) - exact).abs() <= 32, "{bits}");
        }
    }

    proptest! {
        #[test]
        fn a_cubic_equals_the_curve(taps: [i32; 4], shift in 0u32..16, bits in 0u16..1 << FRACTION_BITS) {
            let taps = taps.map(|tap| tap >> shift);
            let [p0, p1, p2, p3] = taps.map(f64::from);
            let t = f64::from(bits) / 32_768.0;
            let exact = p1 + 0.5 * t * (p2 - p0 + t * (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3
                + t * (3.0 * (p1 - p2) + p3 - p0)));
            let exact = exact.clamp(f64::from(i32::MIN), f64::from(i32::MAX));
            let found = f64::from(catmull_rom(taps, Fraction(bits)));
            // Twelve taps of the inner sums are cut by up to 32 each, and each product by 1.
            prop_assert!((found - exact).abs() <= 300.0, "{found} {exact}");
        }

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

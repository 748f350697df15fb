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
        let fraction = match (phase << FRACTION_BITS).checked_div(period) {
            Some(fraction) => fraction,
            None => 0,
        };
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
    let high = (to >> 16).wrapping_sub(from >> 16);
    let low = (to & 0xffff).wrapping_sub(from & 0xffff);
    from.wrapping_add(part(high, low, fraction))
}

/// `⌊(65536 · high + low) · fraction⌋`, modulo 2³²; |high|, |low| ≤ 65535.
const fn part(high: i32, low: i32, fraction: Fraction) -> i32 {
    // Neither product overflows, since the fraction is at most 32767. Doubling the high one may, where the result
    // does not fit either.
    let fraction = fraction.0 as i32;
    high.wrapping_mul(fraction).wrapping_mul(2).wrapping_add(low.wrapping_mul(fraction) >> FRACTION_BITS)
}

/// Frames that are further from each other than this are joined by lines: the coefficients of a cubic would not fit.
const CURVED: i32 = 1 << 27;

/// The value at `fraction` of the way from `taps[1]` to `taps[2]` on the Catmull-Rom curve through four frames in a row
/// (Catmull and Rom 1974, "A class of local interpolating splines"): at both its slope is half the way between its neighbours.
///
/// Raw values of one unit, within ±2³⁰. The curve may leave the range of its taps by an eighth of their largest difference. Rounds
/// down. Where a frame is 2²⁷ or further from `taps[1]`, it is a line. Six 32-bit multiplies.
pub const fn catmull_rom(taps: [i32; 4], fraction: Fraction) -> i32 {
    let [before, from, to, after] = taps;
    // From `from` on all are small, and the sum of a coefficient's fourteen fits.
    let (d0, d2, d3) = (before.wrapping_sub(from), to.wrapping_sub(from), after.wrapping_sub(from));
    if (d0 ^ (d0 >> 31)) | (d2 ^ (d2 >> 31)) | (d3 ^ (d3 >> 31)) >= CURVED {
        return lerp(from, to, fraction);
    }
    let cubic = d3.wrapping_sub(d0).wrapping_sub(d2.wrapping_mul(3));
    let square = d0.wrapping_mul(2).wrapping_add(d2.wrapping_mul(4)).wrapping_sub(d3);
    let linear = d2.wrapping_sub(d0);
    let sum = linear.wrapping_add(of(square.wrapping_add(of(cubic, fraction)), fraction));
    from.wrapping_add(of(sum, fraction) >> 1)
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
    let square = s.wrapping_mul(s);
    let rest = (10u64 << (2 * FRACTION_BITS))
        .wrapping_add(square.wrapping_mul(6))
        .wrapping_sub(s.wrapping_mul(15) << FRACTION_BITS);
    let path = (square.wrapping_mul(s) >> FRACTION_BITS).wrapping_mul(rest) >> (3 * FRACTION_BITS);
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
            assert!((catmull_rom(line, Fraction(bits as u16)) - exact).abs() <= 1, "{bits}");
        }
    }

    proptest! {
        #[test]
        fn a_cubic_equals_the_curve(
            taps in prop::array::uniform4(-(1i32 << 26)..1 << 26),
            at in -(1i32 << 29)..1 << 29,
            shift in 0u32..16,
            bits in 0u16..1 << FRACTION_BITS,
        ) {
            let taps = taps.map(|tap| at + (tap >> shift));
            let [p0, p1, p2, p3] = taps.map(f64::from);
            let t = f64::from(bits) / 32_768.0;
            let exact = p1 + 0.5 * t * (p2 - p0 + t * (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3
                + t * (3.0 * (p1 - p2) + p3 - p0)));
            let found = f64::from(catmull_rom(taps, Fraction(bits)));
            // Three products are rounded down, the last of them once more.
            prop_assert!((-2.1..=0.001).contains(&(found - exact)), "{found} {exact}");
        }

        #[test]
        fn frames_too_far_apart_are_joined_by_lines(
            taps in prop::array::uniform4(-(1i32 << 30)..=1 << 30),
            which in 0usize..3,
            bits in 0u16..1 << FRACTION_BITS,
        ) {
            let mut taps = taps;
            let far = [0, 2, 3][which];
            taps[far] = if taps[1] < 0 { taps[1] + CURVED } else { taps[1] - CURVED - 1 };
            let fraction = Fraction(bits);
            prop_assert_eq!(catmull_rom(taps, fraction), lerp(taps[1], taps[2], fraction));
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

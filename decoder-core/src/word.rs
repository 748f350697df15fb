//! IEEE 754 single precision to 16.16 fixed point, in integers.
//!
//! QMD stores poses, table entries and unquantised differences as 32-bit floats (paper, section 5.1). The core
//! has no floating point, so their bits are turned into a fixed-point word by shifts. The result is defined for
//! every bit pattern and is part of the format (docs/FORMAT.md, "Numbers"):
//!
//! - the value times 65536, rounded to the nearest integer, halves away from zero;
//! - below −2³¹ or above 2³¹ − 1, infinities included: the nearest of the two;
//! - not a number: 0. Subnormals round to 0 like every value below 2⁻¹⁷.

/// The 16.16 fixed-point word nearest to the float with these bits. One shift, no divide, no multiply.
///
/// ```
/// use decoder_core::word::fixed_from_f32_bits;
/// assert_eq!(fixed_from_f32_bits(1.5f32.to_bits()), 0x1_8000);
/// assert_eq!(fixed_from_f32_bits(f32::NAN.to_bits()), 0);
/// ```
#[inline(always)]
pub const fn fixed_from_f32_bits(bits: u32) -> i32 {
    match near(bits) {
        Some(fixed) => fixed,
        None => {
            core::hint::cold_path();
            // Zeros are many: a channel that rests.
            if bits << 1 == 0 { 0 } else { far(bits) }
        }
    }
}

/// The word, where the value is below 128 and not so small that only its exponent says that it is 0.
///
/// With M the mantissa of 24 bits, hidden one included, the float is M · 2^(e − 150). Twice that times 2^16 is
/// M · 2^(e − 133), a right shift by 133 − e; the last bit rounds.
#[inline(always)]
pub(crate) const fn near(bits: u32) -> Option<i32> {
    // 1 − e in the low byte, and in the others what takes sign and exponent off and puts the hidden one on. Written
    // like this it needs the fewest registers and constants of Cortex-M0+, which has few of both.
    let hide = 1u32.wrapping_sub(bits >> 23);
    let shift = (hide & 0xff).wrapping_sub(124);
    if shift > 31 {
        return None;
    }
    let mantissa = bits.wrapping_add(hide << 23);
    let twice = (mantissa >> shift).cast_signed();
    let sign = bits.cast_signed() >> 31;
    // Halves away from zero: −x is !x + 1, so the one that rounds serves for the sign, too.
    Some((twice ^ sign).wrapping_add(1) >> 1)
}

/// The word for all others: values that round to 0, values from 128 on, and what is no number.
#[cold]
#[inline(never)]
pub(crate) const fn far(bits: u32) -> i32 {
    let magnitude = bits & 0x7fff_ffff;
    let exponent = magnitude >> 23;
    if exponent < 134 || magnitude > 0x7f80_0000 {
        return 0;
    }
    let sign = bits.cast_signed() >> 31;
    if exponent > 141 {
        return i32::MAX ^ sign;
    }
    let mantissa = (magnitude & 0x7f_ffff) | 0x80_0000;
    let magnitude = mantissa.wrapping_shl(exponent.wrapping_sub(134)).cast_signed();
    (magnitude ^ sign).wrapping_sub(sign)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{stride, times};

    /// The definition, in wider floats: exact, since f64 holds every f32 times 65536.
    fn reference(bits: u32) -> i32 {
        let value = f64::from(f32::from_bits(bits));
        if value.is_nan() {
            return 0;
        }
        // `f64::round` rounds halves away from zero; `as` saturates.
        (value * 65536.0).round() as i32
    }

    #[test]
    fn every_exponent_and_the_mantissas_where_rounding_turns() {
        for high in (0..=0x1ff_u32).step_by(stride(37)) {
            for low in 0..=23 {
                for near in [-2i64, -1, 0, 1, 2] {
                    for base in [0i64, 1 << low, 0x7f_ffff & !((1 << low) - 1)] {
                        let mantissa = (base + near).rem_euclid(1 << 23);
                        let bits = high << 23 | mantissa as u32;
                        assert_eq!(fixed_from_f32_bits(bits), reference(bits), "{bits:#010x}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_stride_through_all_bit_patterns() {
        // 65537 patterns a step apart that no power of two divides, so every exponent and sign is met.
        let mut bits = 0u32;
        for _ in 0..times(2_000_000, 2_000) {
            assert_eq!(fixed_from_f32_bits(bits), reference(bits), "{bits:#010x}");
            bits = bits.wrapping_add(0x9e37_79b1);
        }
    }

    #[test]
    fn edges() {
        let at = |value: f32| fixed_from_f32_bits(value.to_bits());
        assert_eq!(at(0.0), 0);
        assert_eq!(at(-0.0), 0);
        assert_eq!(at(f32::INFINITY), i32::MAX);
        assert_eq!(at(f32::NEG_INFINITY), i32::MIN);
        assert_eq!(at(f32::NAN), 0);
        assert_eq!(at(32768.0), i32::MAX);
        assert_eq!(at(-32768.0), i32::MIN);
        assert_eq!(at(f32::MIN_POSITIVE / 2.0), 0);
        // Not `powi`, whose last bits Miri changes at random.
        let half = 0.5 / 65536.0;
        assert_eq!(at(half), 1, "halves round away from zero");
        assert_eq!(at(-half), -1);
        assert_eq!(at(half * 0.999_999), 0);
    }
}

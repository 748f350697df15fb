//! Step sizes in equal ratios: eight to an octave, 2⁻¹³ to almost 4096 units.
//!
//! An index is a byte, so a channel's step costs a byte of memory, a multiplication of the step (7-7) is an
//! addition to the index, and a step that is bounded is an index that is.

/// Highest index of a step.
pub const MAX_STEP: u8 = 199;

/// 2^(31 + i/8), rounded to the nearest integer.
const MANTISSAS: [u32; 8] =
    [0x8000_0000, 0x8b95_c1e4, 0x9837_f052, 0xa5fe_d6aa, 0xb504_f334, 0xc567_2a11, 0xd744_fccb, 0xeac0_c6e8];

/// The step size with this index, as a word: `MANTISSAS[index mod 8] >> (28 − ⌊index / 8⌋)`, which is
/// ⌊2^(3 + index/8)⌋. An index above [`MAX_STEP`] counts as that.
///
/// ```
/// use decoder_core::quantise::step::size;
/// assert_eq!([size(0), size(8), size(12), size(104)], [8, 16, 22, 65536]);
/// ```
#[inline(always)]
pub const fn size(index: u8) -> i32 {
    let index = if index > MAX_STEP { MAX_STEP } else { index };
    let [a, b, c, d, e, f, g, h] = MANTISSAS;
    let mantissa = match index & 7 {
        0 => a,
        1 => b,
        2 => c,
        3 => d,
        4 => e,
        5 => f,
        6 => g,
        _ => h,
    };
    // Below 2^28, since the shift is 4 at least.
    mantissa.wrapping_shr(28u32.wrapping_sub((index >> 3) as u32)).cast_signed()
}

/// The sizes of all indices, and of more: 256 from any index of a step on.
pub(super) static SIZES: [i32; MAX_STEP as usize + 256] = {
    let mut sizes = [0; MAX_STEP as usize + 256];
    let mut index = 0u8;
    let mut rest = sizes.as_mut_slice();
    while let Some((first, others)) = rest.split_first_mut() {
        *first = size(index);
        rest = others;
        index = index.saturating_add(1);
    }
    sizes
};

#[cfg(test)]
mod tests {
    use super::*;

    /// 2^(eighths / 8), by roots: Miri changes the last bits of `powf` at random.
    fn power(eighths: u32) -> f64 {
        f64::from(1u32 << (eighths % 8)).sqrt().sqrt().sqrt() * f64::from(1u32 << (eighths / 8))
    }

    #[test]
    fn mantissas_are_their_formula() {
        for (index, &mantissa) in (0..).zip(MANTISSAS.iter()) {
            assert_eq!(f64::from(mantissa), power(8 * 31 + index).round());
        }
    }

    #[test]
    fn sizes_are_their_formula() {
        for index in 0..=MAX_STEP {
            assert_eq!(f64::from(size(index)), power(8 * 3 + u32::from(index)).floor(), "{index}");
        }
        assert!((0..=255).all(|index| SIZES[usize::from(index)] == size(index)));
        assert!((MAX_STEP..=255).all(|index| size(index) == size(MAX_STEP)));
    }
}

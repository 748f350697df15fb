//! The operations that every stage uses. All are defined for all inputs (docs/FORMAT.md, "Numbers").

/// Whether a core has no loads from odd addresses, as ARMv6-M, which of all targets that we know has no atomic
/// exchange either.
pub const BYTES_ONLY: bool = !cfg!(target_has_atomic = "32");

/// `⌊x · factor / 2¹⁶⌋`, exactly: a word times a 16-bit fraction. Two 16-bit multiplies and no 64-bit one.
///
/// x = h·2¹⁶ + l, so x · factor / 2¹⁶ = h · factor + l · factor / 2¹⁶, and neither product leaves 32 bits.
///
/// ```
/// use decoder_core::arithmetic::scale;
/// assert_eq!(scale(3 << 16, -0x4000), -(3 << 14));
/// ```
#[inline(always)]
pub const fn scale(x: i32, factor: i16) -> i32 {
    let factor = factor as i32;
    let high = (x >> 16).wrapping_mul(factor);
    let low = (x & 0xffff).wrapping_mul(factor) >> 16;
    high.wrapping_add(low)
}

/// The signed code that a symbol stands for: 0, −1, 1, −2, 2 … for 0, 1, 2, 3, 4 …
#[inline(always)]
pub const fn signed(symbol: u32) -> i32 {
    (symbol >> 1) as i32 ^ ((symbol & 1) as i32).wrapping_neg()
}

/// The symbol that stands for a signed code: the inverse of [`signed`].
#[inline(always)]
pub const fn unsigned(code: i32) -> u32 {
    (code.wrapping_shl(1) ^ (code >> 31)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, stride, times};

    #[test]
    fn scaling_is_the_floor_of_the_product() {
        let edges = [i32::MIN, i32::MIN + 1, -65537, -65536, -65535, -1, 0, 1, 65535, 65536, i32::MAX];
        let reference = |x: i32, factor: i16| ((i64::from(x) * i64::from(factor)) >> 16) as i32;
        for factor in (i16::MIN..=i16::MAX).step_by(stride(509)) {
            for x in edges {
                assert_eq!(scale(x, factor), reference(x, factor), "{x} {factor}");
            }
        }
        let mut random = Random::new(3);
        for _ in 0..times(1_000_000, 500) {
            let (x, factor) = (random.next() as i32, random.next() as i16);
            assert_eq!(scale(x, factor), reference(x, factor), "{x} {factor}");
        }
    }

    #[test]
    fn symbols_are_codes_in_the_order_of_their_magnitude() {
        assert_eq!([0, 1, 2, 3, 4].map(signed), [0, -1, 1, -2, 2]);
        for code in (-70_000..70_000).step_by(stride(509)).chain([i32::MIN, i32::MAX]) {
            assert_eq!(signed(unsigned(code)), code);
        }
    }
}

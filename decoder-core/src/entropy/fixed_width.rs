//! Codes of each channel's own width, one after the other.

use super::{Context, SymbolSource};
use crate::bits::BitReader;

/// Fixed-width packing. A symbol costs two shifts, and a load for every eight bits.
#[derive(Clone, Copy, Debug)]
pub struct FixedWidth;

impl SymbolSource for FixedWidth {
    #[inline(always)]
    fn symbol(&mut self, bits: &mut BitReader<'_>, width: u8, _: &mut Context) -> u32 {
        bits.take(u32::from(width))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_lie_bit_to_bit() {
        let mut bits = BitReader::new(&[0b1011_0011, 0b1000_0001, 0xff]);
        let mut next = |width| FixedWidth.symbol(&mut bits, width, &mut Context::default());
        assert_eq!([next(1), next(3), next(5), next(7), next(8)], [1, 3, 7, 1, 255]);
    }
}

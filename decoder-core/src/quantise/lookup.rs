//! Differences from a look-up table, as QMD has them, in units of each channel's step.
//!
//! QMD (VRST 2005) gives all channels one table. Here a channel scales it by its step, so that a table fits the
//! movement of joints that a difference causes rather than the difference's own size.

use super::quantiser::{Quantise, Step};
use crate::arithmetic::{scale, signed, unsigned};

/// Differences in 4096ths of a step, signed, little-endian; codes 0, −1, 1, −2, 2 … are the entries 0, 1, 2, 3, 4 …
///
/// One load and one word-by-16-bit multiply a code. A code without an entry stands for 0.
#[derive(Clone, Copy, Debug)]
pub struct Lookup<'a> {
    levels: &'a [[u8; 2]],
}

impl<'a> Lookup<'a> {
    /// A quantiser of these levels, two bytes each; `None` where a byte is left over or there are no levels.
    pub const fn new(levels: &'a [u8]) -> Option<Self> {
        let (levels, rest) = levels.as_chunks::<2>();
        if rest.is_empty() && !levels.is_empty() { Some(Self { levels }) } else { None }
    }

    /// The levels as a header has them.
    pub const fn bytes(&self) -> &'a [u8] {
        self.levels.as_flattened()
    }

    /// Number of levels.
    pub const fn levels(&self) -> usize {
        self.levels.len()
    }
}

impl Quantise for Lookup<'_> {
    #[inline(always)]
    fn difference(&self, code: i32, step: &mut Step, _: u8) -> i32 {
        let level = self.levels.get(unsigned(code) as usize).map_or(0, |&level| i16::from_le_bytes(level));
        scale(step.word(), level).wrapping_shl(4)
    }

    fn nearest(&self, difference: i32, step: i32, bits: u8) -> i32 {
        let mut best = (u32::MAX, 0);
        for symbol in 0..1u32.wrapping_shl(bits.into()).min(self.levels.len() as u32) {
            let code = signed(symbol);
            let off = self.difference(code, &mut Step::of(step), bits).abs_diff(difference);
            if off < best.0 {
                best = (off, code);
            }
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantise::step::size;
    use crate::testing::stride;
    use std::vec::Vec;

    #[test]
    fn every_level_of_every_size() {
        for step in [0, 8, 104, 199].map(size) {
            for part in (i16::MIN..=i16::MAX).step_by(stride(509)) {
                let bytes = part.to_le_bytes();
                let table = Lookup::new(&bytes).unwrap();
                let found = table.difference(0, &mut Step::of(step), 8);
                let exact = ((i64::from(step) * i64::from(part)) >> 16) << 4;
                assert_eq!(found, exact as i32);
                assert_eq!(table.difference(-1, &mut Step::of(step), 8), 0);
            }
        }
    }

    #[test]
    fn the_nearest_entry_wins() {
        let bytes: Vec<u8> = [0i16, -4096, 4096, 9000].iter().flat_map(|level| level.to_le_bytes()).collect();
        let table = Lookup::new(&bytes).unwrap();
        let nearest = |difference| table.nearest(difference, size(104), 2);
        assert_eq!([0, -60_000, 40_000, 150_000, i32::MAX].map(nearest), [0, -1, 1, -2, -2]);
        assert_eq!(table.nearest(150_000, size(104), 1), 0);
        assert_eq!(table.levels(), 4);
        assert!(Lookup::new(&[]).is_none() && Lookup::new(&[1]).is_none());
    }
}

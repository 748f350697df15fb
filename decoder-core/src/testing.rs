//! What the tests of several stages share.

/// `count` repetitions, or `in_miri` under Miri, which is a thousand times slower.
pub const fn times(count: usize, in_miri: usize) -> usize {
    if cfg!(miri) { in_miri } else { count }
}

/// The step through a range: every number, or under Miri every so many.
pub const fn stride(in_miri: usize) -> usize {
    times(1, in_miri)
}

/// A generator of numbers that are the same on every run (splitmix64).
pub struct Random(pub u64);

impl Random {
    /// 32 bits, evenly distributed.
    pub fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 32) as u32
    }

    /// A number from 0 to `end` − 1.
    pub fn below(&mut self, end: usize) -> usize {
        self.next() as usize % end
    }
}

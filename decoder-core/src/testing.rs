//! What the tests of several stages share.

/// `count` repetitions, or `in_miri` under Miri, which is a thousand times slower.
pub const fn times(count: usize, in_miri: usize) -> usize {
    if cfg!(miri) { in_miri } else { count }
}

/// The step through a range: every number, or under Miri every so many.
pub const fn stride(in_miri: usize) -> usize {
    times(1, in_miri)
}

/// A generator of numbers that are the same on every run.
pub struct Random(fastrand::Rng);

impl Random {
    /// A generator that begins at `seed`.
    pub fn new(seed: u64) -> Self {
        Self(fastrand::Rng::with_seed(seed))
    }

    /// 32 bits, evenly distributed.
    pub fn next(&mut self) -> u32 {
        self.0.u32(..)
    }

    /// A number from 0 to `end` − 1.
    pub fn below(&mut self, end: usize) -> usize {
        self.0.usize(..end)
    }
}

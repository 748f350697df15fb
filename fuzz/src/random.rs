//! Numbers that are the same on every run.

use fastrand::Rng;

/// A generator of evenly distributed numbers.
#[derive(Clone, Debug)]
pub struct Random(Rng);

impl Random {
    /// A generator that begins at `seed`.
    pub fn new(seed: u64) -> Self {
        Self(Rng::with_seed(seed))
    }

    /// A generator that begins at a number that the bytes give: a target's choices are part of its input.
    pub fn of(bytes: &[u8]) -> Self {
        // FNV-1a.
        Self::new(bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
        }))
    }

    /// A number from 0 to `end` − 1; 0 where `end` is 0.
    pub fn below(&mut self, end: usize) -> usize {
        self.0.usize(..end.max(1))
    }

    /// Cuts bytes into chunks of 1 to `longest` bytes.
    pub fn chunks<'b>(&mut self, mut rest: &'b [u8], longest: usize) -> Vec<&'b [u8]> {
        let mut chunks = Vec::new();
        while !rest.is_empty() {
            let (chunk, after) = rest.split_at((1 + self.below(longest)).min(rest.len()));
            chunks.push(chunk);
            rest = after;
        }
        chunks
    }
}

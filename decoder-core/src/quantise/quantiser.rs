//! What a quantiser is, and what it keeps of a channel.

/// Most bits of a code.
pub const MAX_BITS: u8 = 16;

/// What a quantiser keeps of a channel: a word; or, where steps adapt, the step's index in its lowest byte and that of the first
/// step in the next one.
///
/// As bytes, because a core then stores the index without the rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C, align(4))]
pub struct Step(pub(super) [u8; 4]);

impl Step {
    /// A word.
    pub const fn of(word: i32) -> Self {
        Self(word.to_le_bytes())
    }

    /// The first step, as an index.
    pub(super) const fn first(index: u8) -> Self {
        Self([index, index, 0, 0])
    }

    /// Back to the first step.
    pub const fn reset(&mut self) {
        let Self([index, first, ..]) = self;
        *index = *first;
    }

    /// The word.
    #[inline(always)]
    pub const fn word(self) -> i32 {
        i32::from_le_bytes(self.0)
    }
}

/// A quantiser of differences.
///
/// Codes are signed, in two's complement of a channel's `bits`, 1 to [`MAX_BITS`]. `step` is the channel's own: its step
/// size as a word, or what a quantiser that adapts makes of it.
pub trait Quantise {
    /// Whether a code may change the step.
    const KEEPS: bool = false;

    /// The difference that `code` stands for. May change the step, so it is called once a code.
    fn difference(&self, code: i32, step: &mut Step, bits: u8) -> i32;

    /// The code whose difference is nearest to `difference`. Only an encoder needs it.
    fn nearest(&self, difference: i32, step: i32, bits: u8) -> i32;

    /// The step size, in words.
    fn size(&self, step: i32) -> i32 {
        step
    }
}

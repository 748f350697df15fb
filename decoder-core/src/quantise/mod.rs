//! Quantisers: from the symbols of a channel to its values or differences, and back for the encoder.
//!
//! Source: the waveform-coding document, sections 7.2 and 7.3. One file a quantiser. What a clip fixes for all
//! channels is in the quantiser, what belongs to a channel is given to it.

pub mod adaptive;
pub mod lookup;
pub mod mu_law;
pub mod step;
pub mod uniform;

pub use adaptive::Adaptive;
pub use lookup::Lookup;
pub use mu_law::MuLaw;
pub use uniform::{Grid, Uniform};

/// Most bits of a code.
pub const MAX_BITS: u8 = 16;

/// What a quantiser keeps of a channel: a word, or two halves of one.
///
/// As halves, because a core stores one of them without the other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C, align(4))]
pub struct Step {
    low: u8,
    above: u8,
    high: u16,
}

impl Step {
    /// A word.
    pub const fn of(word: i32) -> Self {
        Self { low: word as u8, above: (word >> 8) as u8, high: (word >> 16) as u16 }
    }

    /// Back to the first step, which is in the upper half where steps adapt.
    pub const fn reset(&mut self) {
        self.low = self.high as u8;
    }

    /// The word.
    #[inline(always)]
    pub const fn word(self) -> i32 {
        (self.low as i32) | (self.above as i32).wrapping_shl(8) | (self.high as i32).wrapping_shl(16)
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

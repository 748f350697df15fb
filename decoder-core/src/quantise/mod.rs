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

/// A quantiser of differences.
///
/// Codes are signed, in two's complement of a channel's `bits`, 1 to [`MAX_BITS`]. `step` is the channel's own: its step
/// size as a word, or what a quantiser that adapts makes of it.
pub trait Quantise {
    /// The difference that `code` stands for. May change the step, so it is called once a code.
    fn difference(&self, code: i32, step: &mut i32, bits: u8) -> i32;

    /// The code whose difference is nearest to `difference`. Only an encoder needs it.
    fn nearest(&self, difference: i32, step: i32, bits: u8) -> i32;

    /// The step size, in words.
    fn size(&self, step: i32) -> i32 {
        step
    }
}

//! The .mclip that was loaded, and memory for its decoder.

use crate::lend::lend;
use crate::loaded::{File, Number};
use decoder_core::I16F16;
use decoder_core::mclip::{Memory, State};
use decoder_core::predict::Correlation;

/// The clip.
#[unsafe(no_mangle)]
pub static CLIP: File = File::NONE;

/// Its channels.
#[unsafe(no_mangle)]
static CHANNELS: Number = Number::NONE;

/// Correlations that its decoder needs.
#[unsafe(no_mangle)]
static CORRELATIONS: Number = Number::NONE;

/// Words that its decoder needs.
#[unsafe(no_mangle)]
static WORDS: Number = Number::NONE;

/// As much memory as the decoder needs.
#[inline(always)]
pub fn memory() -> Memory<'static> {
    Memory {
        pose: lend(CHANNELS.elements(), I16F16::ZERO),
        states: lend(CHANNELS.elements(), State::EMPTY),
        correlations: lend(CORRELATIONS.elements(), Correlation::EMPTY),
        words: lend(WORDS.elements(), 0),
    }
}

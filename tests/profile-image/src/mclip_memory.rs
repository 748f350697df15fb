//! The .mclip that was loaded, and memory for its decoder.

use crate::lend::SpareRam;
use crate::loaded::{File, Number};
use decoder_core::mclip::Memory;

/// The clip.
#[unsafe(no_mangle)]
pub static CLIP: File = File::NONE;

/// Its channels.
#[unsafe(no_mangle)]
static CHANNELS: Number = Number::NONE;

/// Words that its decoder needs.
#[unsafe(no_mangle)]
static WORDS: Number = Number::NONE;

/// Halves of words that its decoder needs.
#[unsafe(no_mangle)]
static HALVES: Number = Number::NONE;

/// As much memory as the decoder needs.
#[inline(always)]
pub fn memory() -> Memory<'static> {
    let mut ram = SpareRam::new();
    Memory {
        pose: ram.lend(CHANNELS.get()),
        states: ram.lend(CHANNELS.get()),
        words: ram.lend(WORDS.get()),
        halves: ram.lend(HALVES.get()),
    }
}

//! Entropy stages: from bits to the codes of channels.
//!
//! Source: the waveform-coding document, section 7.4. One file a stage, all behind [`SymbolSource`]. A **code** is what
//! a quantiser takes: a signed number. Prefix codes number them 0, −1, 1, −2, 2 …: these are their symbols.

pub mod adaptive_huffman;
pub mod fixed_width;
pub mod huffman;

pub use adaptive_huffman::AdaptiveHuffman;
pub use huffman::Huffman;

use crate::bits::BitReader;

/// Gives the codes of channels, one after the other.
pub trait SymbolSource {
    /// The next channel's code; 0 where it has none, since its codes have 0 bits. Past the end of `bits` it is any.
    ///
    /// `width` is the bits of the channel's codes, 0 to 16, and `context` what the stage keeps of the channel.
    fn code(&mut self, bits: &mut BitReader<'_>, width: u8, context: &mut u8) -> i32;
}

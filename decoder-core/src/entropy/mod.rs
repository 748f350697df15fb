//! Entropy stages: from bits to the symbols of channels.
//!
//! Source: the waveform-coding document, section 7.4. One file a stage, all behind [`SymbolSource`].

pub mod adaptive_huffman;
pub mod fixed_width;
pub mod huffman;

pub use adaptive_huffman::AdaptiveHuffman;
pub use fixed_width::FixedWidth;
pub use huffman::Huffman;

use crate::bits::BitReader;

/// What an entropy stage keeps of a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Context {
    /// The channel's group, which has code tables of its own.
    pub group: u8,
    /// A decaying sum of the magnitudes of the channel's codes: see [`huffman`].
    pub activity: u8,
}

/// Gives the symbols of channels, one after the other.
pub trait SymbolSource {
    /// The next symbol, of a channel with codes of `width` bits, 1 to 16. Past the end of `bits` it is any one.
    fn symbol(&mut self, bits: &mut BitReader<'_>, width: u8, context: &mut Context) -> u32;
}

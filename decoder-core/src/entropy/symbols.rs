//! What an entropy stage of prefix codes is to a codec: a source of codes.

use crate::bits::BitReader;

/// Gives the codes of channels, one after the other.
///
/// A source may be left between any two codes and taken up again: what it keeps between them is in itself, in the
/// channels' `context` and in the position of the reader.
pub trait SymbolSource {
    /// The next channel's code; 0 where it has none, since its codes have 0 bits. Past the end of `bits` it is any.
    ///
    /// `width` is the bits of the channel's codes, 0 to 16, and `context` what the stage keeps of the channel.
    fn code(&mut self, bits: &mut BitReader<'_>, width: u8, context: &mut u8) -> i32;
}

//! Codes into bits, by any entropy stage.

use super::huffman::Books;
use decoder_core::arithmetic::unsigned;
use decoder_core::bits::BitWriter;
use decoder_core::entropy::AdaptiveHuffman;

/// Bits that are being written.
pub(crate) type Bits = BitWriter<Vec<u8>>;

/// The entropy stage of a clip, which writes what the decoder's reads.
pub(crate) enum Coder<'c> {
    /// Codes of fixed width.
    FixedWidth,
    /// Static Huffman codes, by these books.
    Huffman(&'c Books),
    /// Adaptive Huffman codes.
    AdaptiveHuffman(AdaptiveHuffman<'c>),
}

impl Coder<'_> {
    /// Begins an entry point.
    pub fn restart(&mut self, out: &mut Bits) {
        match self {
            Self::FixedWidth => out.align(),
            Self::Huffman(_) => {}
            Self::AdaptiveHuffman(tree) => tree.reset(),
        }
    }

    /// Begins a byte group, or ends a frame: codes of fixed width go on at a whole byte.
    pub fn align(&self, out: &mut Bits) {
        if matches!(self, Self::FixedWidth) {
            out.align();
        }
    }

    /// Writes a code of a channel whose context is the number of its table.
    pub fn write(&mut self, code: i32, width: u8, context: &mut u8, out: &mut Bits) {
        match self {
            Self::FixedWidth => out.put_signed(code, width.into()),
            Self::Huffman(books) => books.write(code, width, context, out),
            Self::AdaptiveHuffman(tree) => {
                let coded = unsigned(code).min(tree.escape());
                let (prefix, length) = tree.code(coded);
                out.put(prefix, length);
                if coded == tree.escape() {
                    out.put_signed(code, width.into());
                }
                tree.count(coded);
            }
        }
    }
}

//! What writes the codes that the decoder's entropy stages read.

pub(crate) mod coder;
pub(crate) mod huffman;

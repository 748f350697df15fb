//! Tables of entropy stages: one file a stage that has some.

pub(crate) mod huffman;

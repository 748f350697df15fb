//! Bit strings, the most significant bit of a byte first: a reader, and a writer beside it.

pub mod reader;
pub mod writer;

pub use reader::{BitReader, MAX_TAKE};
pub use writer::BitWriter;

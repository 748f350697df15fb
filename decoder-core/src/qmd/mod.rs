//! QMD: look-up tables of differences between frames.
//!
//! Source: S. Chattopadhyay, S. M. Bhandarkar, K. Li, "Efficient Compression and Delivery of Stored Motion Data
//! for Avatar Animation in Resource Constrained Devices", VRST 2005, sections 3.4, 4 and 5.1. The bytes are in
//! docs/FORMAT.md, "QMD".
//!
//! A clip is one or more segments. A segment is a look-up table of `2^b` floats and a row for every frame. A row
//! holds, for every channel, the difference to the frame before: a float for the first `FDF` channels, an index
//! into the table for the others. Decoding is one look-up and one addition a channel; additions wrap.
//!
//! [`Clip::parse`] checks all there is to check, so decoding cannot fail afterwards, whatever the bytes are.
//! [`Decoder`] plays a clip that lies in memory; [`Stream`] is fed chunks of any size. Both give the same frames.
//!
//! A caller may lend [`Decoder`] a buffer of `2^b` words, into which each segment's table is converted once.
//! Without it every look-up converts a float, which is slower and takes no memory.

mod clip;
mod decoder;
mod row;
mod segment;
mod stream;
#[cfg(test)]
mod testing;

pub use clip::Clip;
pub use decoder::Decoder;
pub use segment::{Layout, MAX_INDEX_BITS, MIN_INDEX_BITS, SEGMENT_HEADER_BYTES};
pub use stream::Stream;

//! Our decoder beside what motion is otherwise stored with on a microcontroller: int16 frames, as they are or packed
//! by a general compressor.
//!
//! Rotations are stored in centidegrees; translations in the finest of 0.01, 0.1 and 1 cm that the motion's range
//! allows. Compressors get blocks of frames of up to 4 KiB, each packed by itself, so that a device needs memory for
//! one block; tamp, which unpacks any number of bytes of a stream, gets all frames in one. Frames may be stored as differences
//! to the frame before. Where a compressor has levels, the best is taken.

mod compare;
mod pack;
mod plot;
mod quantised;

pub use compare::{Blocks, Comparison, Cost, Entry, Method};
pub use pack::{PACKERS, Packer};
pub use plot::plot;
pub use quantised::{BLOCK_BYTES, Quantised};

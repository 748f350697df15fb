//! What the caller knows about a file.

use std::path::Path;

use super::unit::Unit;
use super::values::Values;

/// What the caller knows about a file.
#[derive(Clone, Debug, Default)]
pub struct Options<'a> {
    /// The ASF file that an AMC file needs; for others it is not read.
    pub skeleton: Option<&'a Path>,
    /// The unit of length of a file that does not say; without it, it is guessed ([`unit::guess`](super::unit::guess)).
    pub unit: Option<Unit>,
    /// Frames per second, instead of what the file says. No frame is made or left out.
    pub fps: Option<f64>,
    /// Frames per second of a file whose rows have uneven times, as recorded moves have: there, frames are made.
    pub sampled_fps: Option<f64>,
    /// The unit of a table's or a move's values whose names do not say it.
    pub values: Option<Values>,
}

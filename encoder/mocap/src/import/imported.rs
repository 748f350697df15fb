//! What an importer has read.

use crate::clip::Clip;

/// A clip, and what its reader had to guess, mend or leave out.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The clip.
    pub clip: Clip,
    /// Whether the frame rate is the file's own or the caller's. An AMC file may have none; its rate is then
    /// [`amc::DEFAULT_FPS`](super::amc::DEFAULT_FPS).
    pub has_rate: bool,
    /// One sentence each, without the file's name and without a full stop, once for each kind of fault: for a person.
    pub notes: Vec<String>,
}

//! Clips by number, and who decodes them.

use crate::frames::Frames;
use crate::play_error::PlayError;

/// The clip number of the live stream. A clip that is stored with this number is never played.
pub const LIVE: u16 = u16::MAX;

/// Clips by number. At most two decoders are open at a time, so memory for two is enough.
pub trait Library {
    /// A decoder.
    type Frames: Frames;

    /// A decoder before the first frame of clip `clip`.
    ///
    /// # Errors
    /// [`PlayError::NoClip`], or what is wrong with the clip.
    fn open(&mut self, clip: u16) -> Result<Self::Frames, PlayError>;

    /// Whether there is such a clip, that plays or that does not.
    fn has(&self, clip: u16) -> bool;

    /// Takes a decoder back, and the memory that it had.
    fn close(&mut self, frames: Self::Frames);
}

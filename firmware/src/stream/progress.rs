//! How far a stream is, and what has happened to it.

use serde::Serialize;

/// What has happened since the stream began. Saturates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counters {
    /// Frames that were played as they were sent.
    pub played: u32,
    /// Frames that were made up, since the right ones were not there.
    pub concealed: u32,
    /// Frames that were on the way back from made-up ones to the right ones.
    pub eased: u32,
    /// Frames that were passed over: never received, or of no use without one that was not.
    pub lost: u32,
    /// Blocks that came after their last frame's time.
    pub late: u32,
    /// Blocks that came twice, before their time.
    pub duplicates: u32,
    /// Packets that were no blocks, or damaged.
    pub damaged: u32,
    /// Blocks that came when the buffer was full.
    pub overflowed: u32,
}

/// How far a stream is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Progress {
    /// Number of the frame that plays next.
    pub position: u32,
    /// Number of the first frame, from the one that the decoder is at, that has not come: all blocks before it have come, or their
    /// time has passed.
    pub received: u32,
    /// Frames in all; 0 before the header is there.
    pub frames: u32,
    /// Blocks that the buffer still takes.
    pub free_blocks: u16,
    /// Blocks that the buffer takes in all.
    pub blocks: u16,
}

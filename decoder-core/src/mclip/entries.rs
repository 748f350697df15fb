//! Where decoding may begin in a clip.

use super::block::Block;

/// An entry point: a block that decodes without the ones before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EntryPoint {
    /// Number of its first frame.
    pub first_frame: u32,
    /// Where the block's header is in the clip.
    pub at: u32,
}

impl EntryPoint {
    /// Before it is filled in.
    pub const EMPTY: Self = Self { first_frame: 0, at: 0 };

    /// That of a block which is one.
    pub(super) const fn of(block: &Block<'_>) -> Self {
        // A clip is no longer than that: its memory is addressed by 32 bits, or nobody holds so many blocks.
        Self { first_frame: block.header.first_frame, at: block.at as u32 }
    }
}

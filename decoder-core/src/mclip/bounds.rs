//! What a clip's header says of its blocks.

/// What a clip's blocks keep to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockBounds {
    /// Most bytes of a block's codes.
    pub bytes: u16,
    /// Frames of the clip.
    pub frames: u32,
}

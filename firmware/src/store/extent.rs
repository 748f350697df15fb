//! A stretch of flash.

/// Flash that is in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Extent {
    /// Address of its first byte.
    pub at: u32,
    pub bytes: u32,
}

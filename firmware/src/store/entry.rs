//! What a store knows of a clip.

use core::fmt;

/// Bytes of a clip's name at most.
pub const NAME_BYTES: usize = 32;

/// A clip's name.
pub type Name = heapless::String<NAME_BYTES>;

/// A clip in the store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Its number.
    pub clip: u16,
    /// Its name.
    pub name: Name,
    /// Where it begins in the flash.
    pub at: u32,
    /// Its bytes.
    pub bytes: u32,
    /// Their CRC-32, as in docs/FORMAT.md.
    pub crc: u32,
    /// Frames.
    pub frames: u32,
    /// Channels in a frame.
    pub channels: u16,
    /// Frames per second, in hundredths.
    pub rate_centihertz: u16,
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "clip {} \"{}\": {} frames, {} bytes", self.clip, self.name, self.frames, self.bytes)
    }
}

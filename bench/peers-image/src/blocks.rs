//! Blocks of frames, each packed by itself and unpacked when its first frame is due: two bytes of length, then so
//! many bytes.

use crate::player::{BLOCK_FRAMES, FRAME};

/// Bytes of the frames that are packed together, and one more: heatshrink's decoder fails where it has no room left.
pub const BLOCK: usize = BLOCK_FRAMES * FRAME + 1;

/// A crate that unpacks.
pub trait Unpack {
    /// Before the first block.
    fn new() -> Self;

    /// Unpacks a block, and says how many bytes it has.
    fn unpack(&mut self, packed: &[u8], block: &mut [u8; BLOCK]) -> Option<usize>;
}

/// The stored motion.
pub struct Blocks<U> {
    rest: &'static [u8],
    block: [u8; BLOCK],
    /// Where the next frame is in the block, and where the block ends.
    at: usize,
    end: usize,
    unpacker: U,
}

impl<U: Unpack> Blocks<U> {
    pub fn new(bytes: &'static [u8]) -> Option<Self> {
        Some(Self { rest: bytes, block: [0; BLOCK], at: 0, end: 0, unpacker: U::new() })
    }

    pub fn frame(&mut self) -> Option<&[u8]> {
        if self.at == self.end {
            let (&len, rest) = self.rest.split_first_chunk::<2>()?;
            let (packed, rest) = rest.split_at_checked(usize::from(u16::from_le_bytes(len)))?;
            self.rest = rest;
            self.end = self.unpacker.unpack(packed, &mut self.block)?;
            self.at = 0;
        }
        let frame = self.block.get(self.at..self.at + FRAME);
        self.at += FRAME;
        frame
    }
}

//! A block: the unit of transport and integrity.

use super::engine::Engine;
use super::header::{Header, check, checksum};
use crate::error::{Error, Field};

/// Bytes of a block before its codes.
pub const BLOCK_HEADER_BYTES: usize = 12;

/// Bytes of a block's header that its checksum covers.
const COVERED_BYTES: usize = 8;

/// In the number of the first frame: the block is an entry point.
const ENTRY: u32 = 1 << 31;

/// What is before a block's codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockHeader {
    /// Bytes of its codes.
    pub length: u16,
    /// Frames in it, at least 1.
    pub frames: u16,
    /// Number of its first frame in the clip.
    pub first_frame: u32,
    /// Whether it decodes without the blocks before it.
    pub entry: bool,
    /// CRC-32 of the header's other 8 bytes and the codes.
    pub checksum: u32,
}

impl BlockHeader {
    /// The header of a block with these codes.
    pub fn of(codes: &[u8], frames: u16, first_frame: u32, entry: bool) -> Option<Self> {
        let length = u16::try_from(codes.len()).ok()?;
        let header = Self { length, frames, first_frame, entry, checksum: 0 };
        let checksum = checksum(&header.covered(), codes);
        Some(Self { checksum, ..header })
    }

    fn covered(&self) -> [u8; COVERED_BYTES] {
        let [l0, l1] = self.length.to_le_bytes();
        let [n0, n1] = self.frames.to_le_bytes();
        let flag = if self.entry { ENTRY } else { 0 };
        let [f0, f1, f2, f3] = (self.first_frame | flag).to_le_bytes();
        [l0, l1, n0, n1, f0, f1, f2, f3]
    }

    /// Its bytes.
    pub fn bytes(&self) -> [u8; BLOCK_HEADER_BYTES] {
        let [l0, l1, n0, n1, f0, f1, f2, f3] = self.covered();
        let [c0, c1, c2, c3] = self.checksum.to_le_bytes();
        [l0, l1, n0, n1, f0, f1, f2, f3, c0, c1, c2, c3]
    }

    /// Reads the header at byte `at` of the clip and checks it. `expected` is the number of the frame that comes
    /// next, or `None` where any may, after a loss.
    ///
    /// # Errors
    /// [`Error::Malformed`] where a block of this clip cannot have such a header.
    pub fn read(
        bytes: &[u8; BLOCK_HEADER_BYTES],
        at: usize,
        clip: &Header<'_>,
        expected: Option<u32>,
    ) -> Result<Self, Error> {
        let [l0, l1, n0, n1, f0, f1, f2, f3, c0, c1, c2, c3] = *bytes;
        let flagged = u32::from_le_bytes([f0, f1, f2, f3]);
        let block = Self {
            length: u16::from_le_bytes([l0, l1]),
            frames: u16::from_le_bytes([n0, n1]),
            first_frame: flagged & !ENTRY,
            entry: flagged & ENTRY != 0,
            checksum: u32::from_le_bytes([c0, c1, c2, c3]),
        };
        let most = clip.opening().block_bytes;
        check(Field::BlockLength, at, block.length.into(), 0, most.into())?;
        let last = clip.frames().saturating_sub(1);
        let (low, high) = expected.map_or((0, last), |frame| (frame, frame.min(last)));
        check(Field::FirstFrame, at.saturating_add(4), block.first_frame, low, high)?;
        let left = clip.frames().saturating_sub(block.first_frame);
        check(Field::Frames, at.saturating_add(2), block.frames.into(), 1, left)?;
        if block.first_frame == 0 {
            check(Field::Entry, at.saturating_add(7), block.entry.into(), 1, 1)?;
        }
        Ok(block)
    }

    /// Checks the codes of the block, whose header is at byte `at`, against its checksum.
    ///
    /// # Errors
    /// [`Error::Checksum`].
    #[inline(never)]
    pub fn verify(&self, codes: &[u8], at: usize) -> Result<(), Error> {
        let found = checksum(&self.covered(), codes);
        if found == self.checksum {
            return Ok(());
        }
        Err(Error::Checksum { field: Field::Payload, at, found, expected: self.checksum })
    }
}

/// A position in the codes of a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cursor {
    /// Number of the frame that comes next.
    pub frame: u32,
    /// Frames before this one need no more than to be decoded: they are neither an entry point nor the block's last one.
    plain: u32,
    /// Bits read.
    position: usize,
    /// Frames of the block and of those before it.
    end: u32,
    /// Where the block's header is in the clip.
    at: usize,
    /// Whether the next frame is the first one of an entry point.
    entry: bool,
}

impl Cursor {
    /// Before the first frame of a block, whose header is at byte `at`.
    pub const fn new(block: BlockHeader, at: usize) -> Self {
        let end = block.first_frame.saturating_add(block.frames as u32);
        let plain = if block.entry { 0 } else { end.saturating_sub(1) };
        Self { frame: block.first_frame, plain, position: 0, end, at, entry: block.entry }
    }

    /// In no block; `frame` comes next.
    pub const fn outside(frame: u32) -> Self {
        Self { frame, plain: 0, position: 0, end: frame, at: 0, entry: false }
    }

    /// Decodes the next frame where it is one of those that need no more; whether it was.
    ///
    /// # Errors
    /// [`Error::Truncated`].
    #[inline(always)]
    pub fn next_plain(&mut self, engine: &mut Engine<'_, '_>, codes: &[u8]) -> Result<bool, Error> {
        if self.frame >= self.plain {
            return Ok(false);
        }
        let Some(position) = engine.decode(codes, self.position) else {
            return Err(self.truncated(codes.len()));
        };
        self.position = position;
        self.frame = self.frame.wrapping_add(1);
        Ok(true)
    }

    /// Decodes the next frame; false after the last one.
    ///
    /// # Errors
    /// [`Error::Truncated`], or [`Error::Malformed`] after the last one.
    #[inline(always)]
    pub fn next(&mut self, engine: &mut Engine<'_, '_>, codes: &[u8]) -> Result<bool, Error> {
        if self.is_done() {
            return Ok(false);
        }
        let decoded = if self.entry {
            engine.decode_entry(codes, self.position)
        } else {
            engine.decode(codes, self.position)
        };
        let Some(position) = decoded else { return Err(self.truncated(codes.len())) };
        self.entry = false;
        self.plain = self.end.saturating_sub(1);
        self.position = position;
        let next = self.frame.wrapping_add(1);
        let used = position.wrapping_add(7) >> 3;
        if next >= self.end && used != codes.len() {
            return Err(self.too_long(codes.len(), used));
        }
        self.frame = next;
        Ok(true)
    }

    /// Whether all of the block's frames were given.
    pub const fn is_done(&self) -> bool {
        self.frame >= self.end
    }

    #[cold]
    const fn truncated(&self, found: usize) -> Error {
        let at = self.at.saturating_add(BLOCK_HEADER_BYTES);
        Error::Truncated { field: Field::Payload, at, needed: found.saturating_add(1), found }
    }

    #[cold]
    const fn too_long(&self, found: usize, used: usize) -> Error {
        let (found, used) = (found as u32, used as u32);
        Error::Malformed { field: Field::BlockLength, at: self.at, found, low: used, high: used }
    }
}

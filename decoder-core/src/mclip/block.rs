//! A block: the unit of transport and integrity.

use super::bounds::BlockBounds;
use super::fields::checksum;
use crate::error::{Error, Field, check};

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

    /// Its bytes, as [`read`](Self::read) reads them.
    pub fn emit(&self) -> [u8; BLOCK_HEADER_BYTES] {
        let [l0, l1, n0, n1, f0, f1, f2, f3] = self.covered();
        let [c0, c1, c2, c3] = self.checksum.to_le_bytes();
        [l0, l1, n0, n1, f0, f1, f2, f3, c0, c1, c2, c3]
    }

    /// Reads the header at byte `at` of the clip and checks it. `expected` is the number of the frame that comes
    /// next, or `None` where any may, after a loss.
    ///
    /// # Errors
    /// [`Error::Malformed`] where a block of this clip cannot have such a header.
    #[inline(always)]
    pub fn read(
        bytes: &[u8; BLOCK_HEADER_BYTES],
        at: usize,
        clip: BlockBounds,
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
        check(Field::BlockLength, at, block.length.into(), 0, clip.bytes.into())?;
        let last = clip.frames.saturating_sub(1);
        let (low, high) = expected.map_or((0, last), |frame| (frame, frame.min(last)));
        check(Field::FirstFrame, at.saturating_add(4), block.first_frame, low, high)?;
        let left = clip.frames.saturating_sub(block.first_frame);
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

/// A block in place.
#[derive(Clone, Copy, Debug)]
pub struct Block<'a> {
    /// What its header says.
    pub header: BlockHeader,
    /// Where its header is in the clip.
    pub at: usize,
    /// Its codes, which were not checked: see [`BlockHeader::verify`].
    pub codes: &'a [u8],
}

impl<'a> Block<'a> {
    /// The block whose header is at byte `at` of `bytes`, of a clip with these bounds. `expected` is the number of the frame that comes next, or
    /// `None` where any may.
    ///
    /// # Errors
    /// As [`BlockHeader::read`], and [`Error::Truncated`].
    // Part of the caller, who then copies no block: where a frame is waiting for it.
    #[inline(always)]
    pub fn read(bytes: &'a [u8], at: usize, clip: BlockBounds, expected: Option<u32>) -> Result<Self, Error> {
        let rest = bytes.get(at..).unwrap_or_default();
        let (header, rest) = rest.split_first_chunk::<BLOCK_HEADER_BYTES>().ok_or(Error::Truncated {
            field: Field::BlockHeader,
            at,
            needed: BLOCK_HEADER_BYTES,
            found: rest.len(),
        })?;
        let header = BlockHeader::read(header, at, clip, expected)?;
        let needed = usize::from(header.length);
        let codes = rest.get(..needed).ok_or(Error::Truncated {
            field: Field::Payload,
            at: at.saturating_add(BLOCK_HEADER_BYTES),
            needed,
            found: rest.len(),
        })?;
        Ok(Self { header, at, codes })
    }

    /// Where the next block's header is in the clip.
    pub const fn end(&self) -> usize {
        self.at.saturating_add(BLOCK_HEADER_BYTES).saturating_add(self.codes.len())
    }

    /// Number of the frame after its last one.
    pub const fn next_frame(&self) -> u32 {
        self.header.first_frame.saturating_add(self.header.frames as u32)
    }
}

/// The blocks of a clip, one after the other: up to the last frame, or the first error.
///
/// ```
/// use decoder_core::Limits;
/// use decoder_core::mclip::Clip;
///
/// let bytes = include_bytes!("../../examples/clip.mclip");
/// let clip = Clip::parse(bytes, Limits::MAX)?;
/// let mut codes = 0;
/// for block in clip.blocks() {
///     let block = block?;
///     block.header.verify(block.codes, block.at)?;
///     codes += block.codes.len();
/// }
/// assert!(codes < bytes.len());
/// # Ok::<(), decoder_core::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Blocks<'a> {
    bounds: BlockBounds,
    bytes: &'a [u8],
    /// Where the next one is.
    at: usize,
    /// Number of the frame that comes next.
    frame: u32,
}

impl<'a> Blocks<'a> {
    /// The blocks of the clip that has these bounds and bytes, from byte `at` on, which is that of a block's header, whose
    /// first frame is `frame`.
    pub const fn new(bounds: BlockBounds, bytes: &'a [u8], at: usize, frame: u32) -> Self {
        Self { bounds, bytes, at, frame }
    }

    /// Where the next block is in the clip, or where the last one ended.
    pub const fn at(&self) -> usize {
        self.at
    }

    /// Reads the next one.
    #[inline(never)]
    fn read(&mut self) -> Result<Block<'a>, Error> {
        let block = Block::read(self.bytes, self.at, self.bounds, Some(self.frame))?;
        self.at = block.end();
        self.frame = block.next_frame();
        Ok(block)
    }
}

impl<'a> Iterator for Blocks<'a> {
    type Item = Result<Block<'a>, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.frame >= self.bounds.frames {
            return None;
        }
        let block = self.read();
        if block.is_err() {
            self.frame = u32::MAX;
        }
        Some(block)
    }
}

//! A clip that lies in memory.

use super::block::{BLOCK_HEADER_BYTES, BlockHeader};
use super::decoder::Decoder;
use super::engine::{Engine, Memory};
use super::header::{Header, Prefix};
use crate::error::{Error, Field, Limits};

/// A clip whose header, and whose blocks' headers, were checked.
///
/// Its decoders check a block's codes against its checksum when they enter it, which takes time in proportion to the
/// block. After [`verify`](Self::verify), once after the clip was installed or the machine started, they do not:
/// no frame takes longer than its channels then. Codes that were damaged decode to some frames, or are refused; nothing
/// worse.
#[derive(Clone, Copy, Debug)]
pub struct Clip<'a> {
    header: Header<'a>,
    bytes: &'a [u8],
    /// Where the first block is.
    start: usize,
    blocks: u32,
    entries: u32,
    verified: bool,
}

/// A block in place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block<'a> {
    pub header: BlockHeader,
    /// Where its header is.
    pub at: usize,
    pub codes: &'a [u8],
    /// Where the next one is.
    pub end: usize,
}

impl<'a> Clip<'a> {
    /// Checks a clip and gives access to it. Nothing is copied. Takes time in proportion to the channels and blocks.
    ///
    /// # Errors
    /// [`Error`] with the byte that is wrong.
    pub fn parse(bytes: &'a [u8], limits: Limits) -> Result<Self, Error> {
        let header = Header::parse(bytes, limits)?;
        let start = Prefix::read(bytes)?.header_bytes;
        let mut clip = Self { header, bytes, start, blocks: 0, entries: 0, verified: false };
        let (mut at, mut frame) = (start, 0u32);
        while frame < header.frames() {
            let block = clip.block(at, Some(frame))?;
            frame = frame.saturating_add(block.header.frames.into());
            at = block.end;
            clip.blocks = clip.blocks.saturating_add(1);
            clip.entries = clip.entries.saturating_add(block.header.entry.into());
        }
        match bytes.len().checked_sub(at) {
            Some(0) => Ok(clip),
            _ => Err(Error::Encoding { field: Field::BlockHeader, at }),
        }
    }

    /// Checks all blocks against their checksums. Decoders of the clip that is returned do not do it again.
    ///
    /// # Errors
    /// [`Error::Checksum`] with the first block that was damaged.
    pub fn verify(self) -> Result<Self, Error> {
        let (mut at, mut frame) = (self.start, 0u32);
        while frame < self.frames() {
            let block = self.block(at, Some(frame))?;
            block.header.verify(block.codes, at)?;
            frame = frame.saturating_add(block.header.frames.into());
            at = block.end;
        }
        Ok(Self { verified: true, ..self })
    }

    /// Whether it was verified.
    pub const fn is_verified(&self) -> bool {
        self.verified
    }

    /// The header.
    pub const fn header(&self) -> &Header<'a> {
        &self.header
    }

    /// Channels in a frame.
    pub const fn channels(&self) -> usize {
        self.header.channel_count()
    }

    /// Frames of all blocks.
    pub const fn frames(&self) -> u32 {
        self.header.frames()
    }

    /// Number of blocks.
    pub const fn blocks(&self) -> u32 {
        self.blocks
    }

    /// Number of blocks that decode without the ones before them.
    pub const fn entries(&self) -> u32 {
        self.entries
    }

    /// Bytes before the first block.
    pub const fn header_bytes(&self) -> usize {
        self.start
    }

    /// A decoder before the first frame, in memory of at least [`Header::needs`].
    ///
    /// # Errors
    /// [`Error::OutputTooSmall`], or [`Error::Encoding`] where the code tables are none.
    pub fn decoder<'s>(&self, memory: Memory<'s>) -> Result<Decoder<'a, 's>, Error> {
        Ok(Decoder::new(*self, Engine::new(self.header, memory)?))
    }

    /// The block whose header is at byte `at`.
    #[inline(never)]
    fn block(&self, at: usize, expected: Option<u32>) -> Result<Block<'a>, Error> {
        self.block_here(at, expected)
    }

    /// The same as a part of the caller, who then copies no block: where a frame is waiting for it.
    #[inline(always)]
    pub(super) fn block_here(&self, at: usize, expected: Option<u32>) -> Result<Block<'a>, Error> {
        let rest = self.bytes.get(at..).unwrap_or_default();
        let (header, rest) = rest.split_first_chunk::<BLOCK_HEADER_BYTES>().ok_or(Error::Truncated {
            field: Field::BlockHeader,
            at,
            needed: BLOCK_HEADER_BYTES,
            found: rest.len(),
        })?;
        let header = BlockHeader::read(header, at, &self.header, expected)?;
        let start = at.saturating_add(BLOCK_HEADER_BYTES);
        let needed = usize::from(header.length);
        let codes = rest.get(..needed).ok_or(Error::Truncated {
            field: Field::Payload,
            at: start,
            needed,
            found: rest.len(),
        })?;
        Ok(Block { header, at, codes, end: start.saturating_add(needed) })
    }

    /// The last entry point that is not after `frame`.
    pub(super) fn entry_before(&self, frame: u32) -> Result<Block<'a>, Error> {
        let mut block = self.block(self.start, Some(0))?;
        let mut entry = block;
        loop {
            let next = block.header.first_frame.saturating_add(block.header.frames.into());
            if next > frame || next >= self.frames() {
                return Ok(entry);
            }
            block = self.block(block.end, Some(next))?;
            if block.header.entry {
                entry = block;
            }
        }
    }
}

//! A clip that lies in memory.

use super::block::{Block, Blocks};
use super::entries::EntryPoint;
use super::fields::Prefix;
use super::header::Header;
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
    block_count: u32,
    entry_count: u32,
    verified: bool,
    /// All entry points in their order, or none where seeking walks over the blocks.
    entries: &'a [EntryPoint],
}

impl<'a> Clip<'a> {
    /// Checks a clip and gives access to it. Nothing is copied. Takes time in proportion to the channels and blocks.
    ///
    /// # Errors
    /// [`Error`] with the byte that is wrong.
    pub fn parse(bytes: &'a [u8], limits: Limits) -> Result<Self, Error> {
        let header = Header::parse(bytes, limits)?;
        let start = Prefix::read(bytes)?.header_bytes;
        let (block_count, entry_count, entries) = (0, 0, &[]);
        let mut clip = Self { header, bytes, start, block_count, entry_count, verified: false, entries };
        let mut blocks = clip.blocks();
        for block in &mut blocks {
            clip.block_count = clip.block_count.saturating_add(1);
            clip.entry_count = clip.entry_count.saturating_add(block?.header.entry.into());
        }
        if blocks.at() != bytes.len() {
            return Err(Error::Encoding { field: Field::BlockHeader, at: blocks.at() });
        }
        Ok(clip)
    }

    /// Checks all blocks against their checksums. Decoders of the clip that is returned do not do it again.
    ///
    /// # Errors
    /// [`Error::Checksum`] with the first block that was damaged.
    pub fn verify(self) -> Result<Self, Error> {
        for block in self.blocks() {
            let Block { header, at, codes } = block?;
            header.verify(codes, at)?;
        }
        Ok(Self { verified: true, ..self })
    }

    /// The clip with an index of its entry points. Then seeking takes the time of a search by halves, instead of a walk over
    /// the blocks up to the frame.
    ///
    /// Memory for [`entry_count`](Self::entry_count) of them has all. Less has every second, third … one, so that more frames are
    /// decoded after a seek; none at all leaves the walk.
    #[must_use]
    pub fn with_index(self, memory: &'a mut [EntryPoint]) -> Self {
        let count = self.entry_count as usize;
        let stride = count.div_ceil(memory.len().max(1)).max(1);
        let points = self.blocks().flatten().filter(|block| block.header.entry).step_by(stride);
        let mut filled = 0usize;
        for (slot, block) in memory.iter_mut().zip(points) {
            *slot = EntryPoint::of(&block);
            filled = filled.saturating_add(1);
        }
        let memory: &'a [EntryPoint] = memory;
        Self { entries: memory.get(..filled).unwrap_or_default(), ..self }
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
    pub const fn block_count(&self) -> u32 {
        self.block_count
    }

    /// Number of blocks that decode without the ones before them.
    pub const fn entry_count(&self) -> u32 {
        self.entry_count
    }

    /// The blocks, one after the other.
    pub const fn blocks(&self) -> Blocks<'a> {
        Blocks::new(self.header.block_bounds(), self.bytes, self.start, 0)
    }

    /// Bytes before the first block.
    pub const fn header_bytes(&self) -> usize {
        self.start
    }

    /// The bytes, from the prefix to the last block.
    pub const fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// The last entry point that is not after `frame`.
    pub(super) fn entry_before(&self, frame: u32) -> Result<EntryPoint, Error> {
        let after = self.entries.partition_point(|point| point.first_frame <= frame);
        if let Some(&point) = after.checked_sub(1).and_then(|last| self.entries.get(last)) {
            return Ok(point);
        }
        let mut entry = EntryPoint { first_frame: 0, at: self.start as u32 };
        for block in self.blocks() {
            let block = block?;
            if block.header.first_frame > frame {
                break;
            }
            if block.header.entry {
                entry = EntryPoint::of(&block);
            }
        }
        Ok(entry)
    }
}

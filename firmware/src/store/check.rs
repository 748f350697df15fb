//! Reads an upload back from flash, piece by piece, before anything names it.

use super::error::StoreError;
use crate::demands::{Demands, Facts};
use crc::Digest;
use decoder_core::mclip::{self, BlockBounds, Blocks, Header, MAGIC, Needs, Prefix};
use decoder_core::{Error, Field, Limits, qmd};

/// Bytes that a step reads; a block that is longer is read in one.
const STEP_BYTES: usize = 4096;

/// How far a check is.
pub(super) struct Check {
    digest: Digest<'static, u32>,
    /// Bytes that were read.
    at: usize,
    /// Frames of the blocks that were read.
    frames: u32,
    /// What the clip's header says, once it was read, and what is wrong with the clip.
    opened: Option<Result<Opened, Error>>,
}

/// What a clip's header says.
#[derive(Clone, Copy)]
struct Opened {
    facts: Facts,
    /// Of a .mclip, whose blocks have checksums. A QMD clip has none of its own.
    blocks: Option<BlockBounds>,
}

impl Check {
    pub fn new() -> Self {
        Self { digest: mclip::digest(), at: 0, frames: 0, opened: None }
    }

    /// Bytes that were read.
    pub const fn at(&self) -> usize {
        self.at
    }

    /// Goes on in the clip's bytes; gives what it says of itself once all were read. The header is read in the first step.
    pub fn step(
        &mut self,
        clip: &[u8],
        crc: u32,
        capacity: &Needs,
        demands: Option<&Demands>,
    ) -> Result<Option<Facts>, StoreError> {
        let opened = self.opened.take().unwrap_or_else(|| self.open(clip, capacity));
        let opened = match opened {
            Ok(Opened { blocks: Some(bounds), .. }) => self.read_blocks(clip, bounds).and(opened),
            _ => opened,
        };
        if !matches!(opened, Ok(Opened { blocks: Some(_), .. })) {
            // Of a damaged clip too: whether these are the bytes that were sent is to be known first.
            self.read(clip, self.at.saturating_add(STEP_BYTES).min(clip.len()));
        }
        self.opened = Some(opened);
        if self.at < clip.len() {
            return Ok(None);
        }
        let found = self.digest.clone().finalize();
        if found != crc {
            return Err(StoreError::Checksum { found, expected: crc });
        }
        let facts = opened.map_err(StoreError::Clip)?.facts;
        demands.map_or(Ok(()), |demands| demands.check(&facts)).map_err(StoreError::Play)?;
        Ok(Some(facts))
    }

    /// Takes bytes up to `to` into the checksum.
    fn read(&mut self, clip: &[u8], to: usize) {
        self.digest.update(clip.get(self.at..to).unwrap_or_default());
        self.at = to;
    }

    /// Reads the header.
    fn open(&mut self, clip: &[u8], capacity: &Needs) -> Result<Opened, Error> {
        let channels = u16::try_from(capacity.channels).unwrap_or(u16::MAX);
        let limits = Limits { channels, frames: Limits::MAX.frames };
        if !clip.starts_with(&MAGIC) {
            let clip = qmd::Clip::parse(clip, limits)?;
            return Ok(Opened { facts: Facts::from(&clip), blocks: None });
        }
        let header = Header::parse(clip, limits)?;
        fits(&header.needs(), capacity)?;
        self.read(clip, Prefix::read(clip)?.header_bytes);
        Ok(Opened { facts: Facts::from(&header), blocks: Some(header.block_bounds()) })
    }

    /// Checks blocks of about [`STEP_BYTES`].
    fn read_blocks(&mut self, clip: &[u8], bounds: BlockBounds) -> Result<(), Error> {
        let stop = self.at.saturating_add(STEP_BYTES);
        let mut blocks = Blocks::new(bounds, clip, self.at, self.frames);
        // At the clip's end there is an error to read where frames are missing.
        while (self.at < stop || self.at == clip.len())
            && let Some(block) = blocks.next()
        {
            let block = block?;
            block.header.verify(block.codes, block.at)?;
            self.read(clip, block.end());
            self.frames = block.next_frame();
        }
        if self.frames >= bounds.frames && self.at != clip.len() {
            return Err(Error::Encoding { field: Field::BlockHeader, at: self.at });
        }
        Ok(())
    }
}

/// Whether decoders here have the memory.
fn fits(needs: &Needs, capacity: &Needs) -> Result<(), Error> {
    for (field, needed, lent) in [
        (Field::States, needs.channels, capacity.channels),
        (Field::Words, needs.words, capacity.words),
        (Field::Halves, needs.halves, capacity.halves),
    ] {
        if needed > lent {
            return Err(Error::OutputTooSmall { field, needed, lent });
        }
    }
    Ok(())
}

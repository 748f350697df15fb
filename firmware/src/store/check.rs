//! Reads an upload back from flash, piece by piece, before anything names it.

use super::error::StoreError;
use crc::Digest;
use decoder_core::mclip::{self, BLOCK_HEADER_BYTES, BlockHeader, Header, MAGIC, Needs, Prefix};
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
    /// What is wrong with the clip.
    wrong: Option<Error>,
}

/// What a clip says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Facts {
    pub frames: u32,
    pub channels: u16,
    pub rate_centihertz: u16,
}

impl Check {
    pub fn new() -> Self {
        Self { digest: mclip::digest(), at: 0, frames: 0, wrong: None }
    }

    /// Bytes that were read.
    pub const fn at(&self) -> usize {
        self.at
    }

    /// Goes on in the clip's bytes; gives what it says of itself once all were read.
    pub fn step(&mut self, clip: &[u8], crc: u32, capacity: &Needs) -> Result<Option<Facts>, StoreError> {
        let channels = u16::try_from(capacity.channels).unwrap_or(u16::MAX);
        let limits = Limits { channels, frames: Limits::MAX.frames };
        let facts = match self.wrong {
            Some(_) => None,
            None if clip.starts_with(&MAGIC) => self.mclip(clip, limits, capacity).transpose(),
            None => self.qmd(clip, limits).transpose(),
        };
        if let Some(Err(error)) = facts {
            self.wrong = Some(error);
        }
        if self.wrong.is_some() {
            // Whether these are the bytes that were sent is to be known first.
            self.read(clip, self.at.saturating_add(STEP_BYTES).min(clip.len()));
        }
        let Some(result) = facts.or(self.wrong.map(Err)).filter(|_| self.at == clip.len()) else {
            return Ok(None);
        };
        let found = self.digest.clone().finalize();
        if found != crc {
            return Err(StoreError::Checksum { found, expected: crc });
        }
        result.map(Some).map_err(StoreError::Clip)
    }

    /// Takes bytes up to `to` into the checksum.
    fn read(&mut self, clip: &[u8], to: usize) {
        self.digest.update(clip.get(self.at..to).unwrap_or_default());
        self.at = to;
    }

    /// Checks blocks. The header is parsed again in every step, since it borrows the bytes.
    fn mclip(&mut self, clip: &[u8], limits: Limits, capacity: &Needs) -> Result<Option<Facts>, Error> {
        let header = Header::parse(clip, limits)?;
        if self.at == 0 {
            fits(&header.needs(), capacity)?;
            self.read(clip, Prefix::read(clip)?.header_bytes);
        }
        let stop = self.at.saturating_add(STEP_BYTES);
        while self.at < stop && self.frames < header.frames() {
            let (block, end) = block(clip, self.at, &header, self.frames)?;
            self.read(clip, end);
            self.frames = self.frames.saturating_add(block.frames.into());
        }
        if self.frames < header.frames() {
            return Ok(None);
        }
        if self.at != clip.len() {
            return Err(Error::Encoding { field: Field::BlockHeader, at: self.at });
        }
        let channels = u16::try_from(header.channel_count()).unwrap_or(u16::MAX);
        let rate_centihertz = header.rate_centihertz();
        Ok(Some(Facts { frames: header.frames(), channels, rate_centihertz }))
    }

    /// A QMD clip has no checksums of its own.
    fn qmd(&mut self, clip: &[u8], limits: Limits) -> Result<Option<Facts>, Error> {
        let parsed = qmd::Clip::parse(clip, limits)?;
        self.read(clip, self.at.saturating_add(STEP_BYTES).min(clip.len()));
        let channels = u16::try_from(parsed.channels()).unwrap_or(u16::MAX);
        let facts = Facts { frames: parsed.frames(), channels, rate_centihertz: parsed.rate_centihertz() };
        Ok((self.at == clip.len()).then_some(facts))
    }
}

/// The block whose header is at byte `at`, checked, and where the next one is.
fn block(clip: &[u8], at: usize, header: &Header<'_>, frame: u32) -> Result<(BlockHeader, usize), Error> {
    let rest = clip.get(at..).unwrap_or_default();
    let truncated = |field, at, needed, found| Error::Truncated { field, at, needed, found };
    let (bytes, rest) =
        rest.split_first_chunk().ok_or(truncated(Field::BlockHeader, at, BLOCK_HEADER_BYTES, rest.len()))?;
    let block = BlockHeader::read(bytes, at, header, Some(frame))?;
    let (start, length) = (at.saturating_add(BLOCK_HEADER_BYTES), usize::from(block.length));
    let codes = rest.get(..length).ok_or(truncated(Field::Payload, start, length, rest.len()))?;
    block.verify(codes, at)?;
    Ok((block, start.saturating_add(length)))
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

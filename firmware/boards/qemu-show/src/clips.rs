//! The linked-in clips, each with a decoder of its own.

use decoder_core::mclip::{self, EntryPoint, Workspace};
use decoder_core::{Error, Limits, qmd};
use firmware::frames::Frames;
use heapless::Vec;

include!(concat!(env!("OUT_DIR"), "/clips.rs"));

/// Entry points of a clip that are found without looking through it.
const ENTRIES: usize = 64;

/// What a decoder is lent: enough for the clip that needs most.
pub struct Memory {
    space: Workspace<CHANNELS, WORDS, HALVES>,
    table: [i32; TABLE],
    entries: [EntryPoint; ENTRIES],
}

impl Memory {
    pub const EMPTY: Self =
        Self { space: Workspace::EMPTY, table: [0; TABLE], entries: [EntryPoint::EMPTY; ENTRIES] };
}

/// A clip before its first frame.
#[allow(clippy::large_enum_variant, reason = "there are few, and nowhere to box them")]
pub enum Decoder<'s> {
    Qmd(qmd::Decoder<'static, 's>),
    Mclip(mclip::Decoder<'s, 's>),
}

impl<'s> Decoder<'s> {
    pub fn frames(&mut self) -> &mut (dyn Frames + 's) {
        match self {
            Self::Qmd(decoder) => decoder,
            Self::Mclip(decoder) => decoder,
        }
    }
}

/// Opens all clips; those in blocks are checked with all their blocks, so that none has to be while it plays.
pub fn open(memories: &mut [Memory; COUNT]) -> Result<Vec<Decoder<'_>, COUNT>, Error> {
    FILES.iter().zip(memories).map(|(file, memory)| one(file, memory)).collect()
}

fn one<'s>(file: &'static [u8], memory: &'s mut Memory) -> Result<Decoder<'s>, Error> {
    let Memory { space, table, entries } = memory;
    if file.starts_with(&mclip::MAGIC) {
        let clip = mclip::Clip::parse(file, Limits::MAX)?.verify()?.with_index(entries);
        return Ok(Decoder::Mclip(clip.decoder(space.lend())?));
    }
    let clip = qmd::Clip::parse(file, Limits::MAX)?;
    Ok(Decoder::Qmd(clip.decoder(space.lend().pose, Some(table))?))
}

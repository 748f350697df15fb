//! The linked-in .mclip, and as much memory as its header says.

use decoder_core::mclip::{Clip, Decoder, Workspace};
use decoder_core::{Error, Limits};

include!(concat!(env!("OUT_DIR"), "/sizes.rs"));

pub static CLIP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/clip"));

/// What the decoder is lent.
pub type Memory = Workspace<CHANNELS, WORDS, HALVES>;

/// A clip before its first frame.
pub struct Opened<'s> {
    pub decoder: Decoder<'static, 's>,
    pub frames: u32,
    pub rate_centihertz: u16,
}

/// Checks the clip with all its blocks, so that none has to be checked while it plays.
pub fn open(memory: &mut Memory) -> Result<Opened<'_>, Error> {
    let clip = Clip::parse(CLIP, Limits::MAX)?.verify()?;
    let decoder = clip.decoder(memory.lend())?;
    Ok(Opened { decoder, frames: clip.frames(), rate_centihertz: clip.header().rate_centihertz() })
}

/// Checks the clip with all its blocks.
#[cfg(feature = "link")]
pub fn check() -> Result<(), Error> {
    Clip::parse(CLIP, Limits::MAX)?.verify().map(|_| ())
}

//! The linked-in .mclip, and as much memory as its header says.

use decoder_core::mclip::{self, Clip, Decoder, State};
use decoder_core::predict::Correlation;
use decoder_core::{Error, I16F16, Limits};

include!(concat!(env!("OUT_DIR"), "/sizes.rs"));

static CLIP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/clip"));

/// What the decoder is lent.
pub struct Memory {
    pose: [I16F16; CHANNELS],
    states: [State; CHANNELS],
    correlations: [Correlation; CORRELATIONS],
    words: [u16; WORDS],
}

impl Memory {
    pub const EMPTY: Self = Self {
        pose: [I16F16::ZERO; CHANNELS],
        states: [State::EMPTY; CHANNELS],
        correlations: [Correlation::EMPTY; CORRELATIONS],
        words: [0; WORDS],
    };
}

/// A clip before its first frame.
pub struct Opened<'s> {
    pub decoder: Decoder<'static, 's>,
    pub frames: u32,
    pub rate_centihertz: u16,
}

/// Checks the clip with all its blocks, so that none has to be checked while it plays.
pub fn open(memory: &mut Memory) -> Result<Opened<'_>, Error> {
    let clip = Clip::parse(CLIP, Limits::MAX)?.verify()?;
    let Memory { pose, states, correlations, words } = memory;
    let decoder = clip.decoder(mclip::Memory { pose, states, correlations, words })?;
    Ok(Opened { decoder, frames: clip.frames(), rate_centihertz: clip.header().rate_centihertz() })
}

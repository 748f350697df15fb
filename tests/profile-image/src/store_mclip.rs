//! The linked-in .mclip and memory for its decoder.

use core::hint::black_box;
use decoder_core::mclip::{self, State};
use decoder_core::predict::Correlation;
use decoder_core::{Error, I16F16, Limits};

include!(concat!(env!("OUT_DIR"), "/mclip_sizes.rs"));

static CLIP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/clip.mclip"));

pub type Decoder = mclip::Decoder<'static, 'static>;

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

/// The decoder, and the clip's rate in hundredths of a frame per second.
pub fn decoder(memory: &'static mut Memory) -> Result<(Decoder, u16), Error> {
    let clip = mclip::Clip::parse(black_box(CLIP), Limits::MAX)?.verify()?;
    let Memory { pose, states, correlations, words } = memory;
    let decoder = clip.decoder(mclip::Memory { pose, states, correlations, words })?;
    Ok((decoder, clip.header().rate_centihertz()))
}

//! The linked-in .mclip and memory for its decoder.

use core::hint::black_box;
use decoder_core::mclip::{self, Workspace};
use decoder_core::{Error, Limits};

include!(concat!(env!("OUT_DIR"), "/mclip_sizes.rs"));

static CLIP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/clip.mclip"));

pub type Decoder = mclip::Decoder<'static, 'static>;

pub type Memory = Workspace<CHANNELS, WORDS, HALVES>;

/// The decoder, and the clip's rate in hundredths of a frame per second.
pub fn decoder(memory: &'static mut Memory) -> Result<(Decoder, u16), Error> {
    let clip = mclip::Clip::parse(black_box(CLIP), Limits::MAX)?.verify()?;
    let decoder = clip.decoder(memory.lend())?;
    Ok((decoder, clip.header().rate_centihertz()))
}

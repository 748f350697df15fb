//! The decoder of a .mclip that was loaded.

#[path = "mclip_memory.rs"]
mod mclip_memory;

use decoder_core::{Error, Limits, mclip};
use mclip_memory::{CLIP, memory};

pub type Decoder = mclip::Decoder<'static, 'static>;

/// The decoder, and the clip's rate in hundredths of a frame per second.
pub fn decoder() -> Result<(Decoder, u16), Error> {
    let clip = mclip::Clip::parse(CLIP.bytes(), Limits::MAX)?.verify()?;
    let decoder = clip.decoder(memory())?;
    Ok((decoder, clip.header().rate_centihertz()))
}

//! The linked-in .qmd.

use decoder_core::qmd::{Clip, Decoder};
use decoder_core::{Error, I16F16, Limits};

include!(concat!(env!("OUT_DIR"), "/sizes.rs"));

static CLIP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/clip"));

/// What the decoder is lent.
pub struct Memory {
    pose: [I16F16; CHANNELS],
    table: [i32; TABLE],
}

impl Memory {
    pub const EMPTY: Self = Self { pose: [I16F16::ZERO; CHANNELS], table: [0; TABLE] };
}

/// A clip before its first frame.
pub struct Opened<'s> {
    pub decoder: Decoder<'static, 's>,
    pub frames: u32,
    pub rate_centihertz: u16,
}

pub fn open(memory: &mut Memory) -> Result<Opened<'_>, Error> {
    let clip = Clip::parse(CLIP, Limits::MAX)?;
    let table = (TABLE > 0).then_some(&mut memory.table[..]);
    let decoder = clip.decoder(&mut memory.pose, table)?;
    Ok(Opened { decoder, frames: clip.frames(), rate_centihertz: clip.rate_centihertz() })
}

//! The linked-in .qmd and memory for its decoder.

use core::hint::black_box;
use decoder_core::{Error, I16F16, Limits, qmd};

include!(concat!(env!("OUT_DIR"), "/sizes.rs"));

static CLIP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/clip.qmd"));

pub type Decoder = qmd::Decoder<'static, 'static>;

pub struct Memory {
    pose: [I16F16; CHANNELS],
    table: [i32; TABLE],
}

impl Memory {
    pub const EMPTY: Self = Self { pose: [I16F16::ZERO; CHANNELS], table: [0; TABLE] };
}

/// The decoder, and the clip's rate in hundredths of a frame per second.
pub fn decoder(memory: &'static mut Memory) -> Result<(Decoder, u16), Error> {
    let clip = qmd::Clip::parse(black_box(CLIP), Limits::MAX)?;
    let table = if TABLE == 0 { None } else { Some(&mut memory.table[..]) };
    Ok((clip.decoder(&mut memory.pose, table)?, clip.rate_centihertz()))
}

//! The decoder of a .qmd that was loaded.

use crate::lend::SpareRam;
use crate::loaded::{File, Number};
use decoder_core::{Error, Limits, qmd};

/// The clip.
#[unsafe(no_mangle)]
static CLIP: File = File::NONE;

/// Its channels.
#[unsafe(no_mangle)]
static CHANNELS: Number = Number::NONE;

/// Words to lend for its table.
#[unsafe(no_mangle)]
static TABLE: Number = Number::NONE;

pub type Decoder = qmd::Decoder<'static, 'static>;

/// The decoder, and the clip's rate in hundredths of a frame per second.
pub fn decoder() -> Result<(Decoder, u16), Error> {
    let clip = qmd::Clip::parse(CLIP.bytes(), Limits::MAX)?;
    let mut ram = SpareRam::new();
    let pose = ram.lend(CHANNELS.get());
    let table = if cfg!(feature = "no-table") { None } else { Some(ram.lend(TABLE.get())) };
    Ok((clip.decoder(pose, table)?, clip.rate_centihertz()))
}

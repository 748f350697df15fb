//! Decodes a .mclip from the first frame to the last, and nothing else: `decode.rs` for clips in blocks.
#![no_std]
#![no_main]

mod ends;
mod lend;
mod loaded;
mod mclip_memory;

use core::hint::black_box;
use cortex_m_rt::entry;
use decoder_core::mclip::{Clip, Decoder, Memory};
use decoder_core::{Error, I16F16, Limits};
use ends::{failed, finished};
use loaded::Number;
use mclip_memory::{CLIP, memory};

/// Whether blocks are checked as they are entered, and not all before.
#[unsafe(no_mangle)]
static VERIFY_BLOCKS: Number = Number::NONE;

#[entry]
fn main() -> ! {
    let mut opened = open(CLIP.bytes(), memory());
    let Ok(decoder) = &mut opened else { failed() };
    while let Some(pose) = decode_frame(decoder) {
        black_box(pose);
    }
    finished()
}

/// Checks the clip, its blocks unless that is for later, and makes its decoder, which builds the tables of the entropy stage.
#[inline(never)]
#[unsafe(no_mangle)]
fn open(bytes: &'static [u8], memory: Memory<'static>) -> Result<Decoder<'static, 'static>, Error> {
    let clip = Clip::parse(bytes, Limits::MAX)?;
    if VERIFY_BLOCKS.get() != 0 { clip } else { clip.verify()? }.decoder(memory)
}

/// What is measured: one frame, and with [`VERIFY_BLOCKS`] the checksum of a block where it begins one.
#[inline(never)]
#[unsafe(no_mangle)]
fn decode_frame<'d>(decoder: &'d mut Decoder<'_, '_>) -> Option<&'d [I16F16]> {
    decoder.next_frame().ok().flatten()
}

//! Decodes a .qmd from the first frame to the last, and nothing else.
//!
//! `bunraku profile` runs this image and counts the cycles between the first instruction of a function that is
//! named here and the return from it, so measuring adds no instruction to the image.
#![no_std]
#![no_main]

mod ends;
mod lend;
mod loaded;

use core::hint::black_box;
use cortex_m_rt::entry;
use decoder_core::qmd::{Clip, Decoder};
use decoder_core::{Error, I16F16, Limits};
use ends::{failed, finished};
use lend::SpareRam;
use loaded::{File, Number};

/// The clip.
#[unsafe(no_mangle)]
static CLIP: File = File::NONE;

/// Its channels.
#[unsafe(no_mangle)]
static CHANNELS: Number = Number::NONE;

/// Words to lend for its table.
#[unsafe(no_mangle)]
static TABLE: Number = Number::NONE;

#[entry]
fn main() -> ! {
    // A halfword, by which `decode_frame` begins where it began in an image that has its clip linked in: in the middle of
    // a word. At the beginning of one, an M4 takes 0.3 cycles a frame more, for its branches to 32-bit instructions.
    if cfg!(not(feature = "no-table")) {
        halfword();
    }
    let mut ram = SpareRam::new();
    let pose = ram.lend(CHANNELS.get());
    let mut opened = open(CLIP.bytes(), pose, ram.lend(TABLE.get()));
    let Ok(decoder) = &mut opened else { failed() };
    while let Some(pose) = decode_frame(decoder) {
        black_box(pose);
    }
    finished()
}

#[inline(always)]
fn halfword() {
    // SAFETY: does nothing.
    unsafe { core::arch::asm!("nop", options(nomem, nostack, preserves_flags)) };
}

/// Checks the clip and makes its decoder, which converts the first table.
#[inline(never)]
#[unsafe(no_mangle)]
fn open<'s>(
    bytes: &'static [u8],
    pose: &'s mut [I16F16],
    words: &'s mut [i32],
) -> Result<Decoder<'static, 's>, Error> {
    let table = if cfg!(feature = "no-table") { None } else { Some(words) };
    Clip::parse(bytes, Limits::MAX)?.decoder(pose, table)
}

/// What is measured: one frame.
#[inline(never)]
#[unsafe(no_mangle)]
fn decode_frame<'d>(decoder: &'d mut Decoder<'_, '_>) -> Option<&'d [I16F16]> {
    decoder.next_frame()
}

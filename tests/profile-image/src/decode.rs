//! Decodes the linked-in clip from the first frame to the last, and nothing else.
//!
//! `bunraku profile` runs this image and counts the cycles between the first instruction of a function that is
//! named here and the return from it, so measuring adds no instruction to the image.
#![no_std]
#![no_main]

mod ends;

use core::hint::black_box;
use cortex_m_rt::entry;
use decoder_core::qmd::{Clip, Decoder};
use decoder_core::{Error, I16F16, Limits};
use ends::{failed, finished};

include!(concat!(env!("OUT_DIR"), "/sizes.rs"));
include!(concat!(env!("OUT_DIR"), "/nops.rs"));

static CLIP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/clip.qmd"));

#[entry]
fn main() -> ! {
    static mut POSE: [I16F16; CHANNELS] = [I16F16::ZERO; CHANNELS];
    static mut WORDS: [i32; TABLE] = [0; TABLE];
    // A decoder for just this clip would be faster than one for any: hide which clip it is.
    let mut opened = open(black_box(CLIP), POSE, WORDS);
    let Ok(decoder) = &mut opened else { failed() };
    while let Some(pose) = decode_frame(decoder) {
        black_box(pose);
    }
    finished()
}

/// Checks the clip and makes its decoder, which converts the first table.
#[inline(never)]
#[unsafe(no_mangle)]
fn open<'s>(
    bytes: &'static [u8],
    pose: &'s mut [I16F16],
    words: &'s mut [i32],
) -> Result<Decoder<'static, 's>, Error> {
    let table = if TABLE == 0 { None } else { Some(words) };
    Clip::parse(bytes, Limits::MAX)?.decoder(pose, table)
}

/// What is measured: one frame.
#[inline(never)]
#[unsafe(no_mangle)]
fn decode_frame<'d>(decoder: &'d mut Decoder<'_, '_>) -> Option<&'d [I16F16]> {
    waste();
    decoder.next_frame()
}

#[inline(always)]
fn waste() {
    if NOPS != 0 {
        // SAFETY: does nothing, several times.
        unsafe { core::arch::asm!(".rept {}", "nop", ".endr", const NOPS) };
    }
}

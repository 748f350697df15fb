//! Decodes the linked-in .mclip from the first frame to the last, and nothing else: `decode.rs` for clips in blocks.
#![no_std]
#![no_main]

mod ends;

use core::hint::black_box;
use cortex_m_rt::entry;
use decoder_core::mclip::{Clip, Decoder, Memory, State};
use decoder_core::{Error, I16F16, Limits};
use ends::{failed, finished};

include!(concat!(env!("OUT_DIR"), "/mclip_sizes.rs"));
include!(concat!(env!("OUT_DIR"), "/verify.rs"));

static CLIP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/clip.mclip"));

#[entry]
fn main() -> ! {
    static mut POSE: [I16F16; CHANNELS] = [I16F16::ZERO; CHANNELS];
    static mut STATES: [State; CHANNELS] = [State::EMPTY; CHANNELS];
    static mut WIDE: [u32; WORDS] = [0; WORDS];
    static mut NARROW: [u16; HALVES] = [0; HALVES];
    let memory = Memory { pose: POSE, states: STATES, words: WIDE, halves: NARROW };
    // A decoder for just this clip would be faster than one for any: hide which clip it is.
    let mut opened = open(black_box(CLIP), memory);
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
    if VERIFY_BLOCKS { clip } else { clip.verify()? }.decoder(memory)
}

/// What is measured: one frame, and with `VERIFY_BLOCKS` the checksum of a block where it begins one.
#[inline(never)]
#[unsafe(no_mangle)]
fn decode_frame<'d>(decoder: &'d mut Decoder<'_, '_>) -> Option<&'d [I16F16]> {
    decoder.next_frame().ok().flatten()
}

//! Reads the clip that its argument names, decodes it in place, with a lent table and without, and prints the hash
//! of the frames.
#![no_std]
#![no_main]

mod common;

use common::{Frames, open};
use core::ptr::addr_of_mut;
use cortex_m as _;
use cortex_m_rt::entry;
use decoder_core::qmd::Clip;
use decoder_core::{I16F16, Limits, mclip};
use semihosting::io::Read;
use semihosting::process;

/// Longest clip.
const BYTES: usize = 1 << 20;
/// Most channels.
const CHANNELS: usize = 4096;
/// Longest table: index bits 16.
const TABLE: usize = 1 << 16;

static mut CLIP: [u8; BYTES] = [0; BYTES];
static mut POSE: [I16F16; CHANNELS] = [I16F16::ZERO; CHANNELS];
static mut WORDS: [i32; TABLE] = [0; TABLE];
static mut STATES: [mclip::State; CHANNELS] = [mclip::State::EMPTY; CHANNELS];
static mut WIDE: [u32; 4 * CHANNELS] = [0; 4 * CHANNELS];
static mut CODES: [u16; TABLE] = [0; TABLE];

#[entry]
fn main() -> ! {
    // SAFETY: `main` runs once, and nothing else uses the buffers.
    let (buffer, pose, words) =
        unsafe { (&mut *addr_of_mut!(CLIP), &mut *addr_of_mut!(POSE), &mut *addr_of_mut!(WORDS)) };
    let mut file = open();
    let mut length = 0;
    loop {
        let free = buffer.get_mut(length..).filter(|free| !free.is_empty()).expect("the clip is too long");
        match file.read(free).expect("the clip cannot be read") {
            0 => break,
            count => length += count,
        }
    }
    if buffer.starts_with(&mclip::MAGIC) {
        // SAFETY: as above.
        let memory = unsafe {
            mclip::Memory {
                pose,
                states: &mut *addr_of_mut!(STATES),
                words: &mut *addr_of_mut!(WIDE),
                halves: &mut *addr_of_mut!(CODES),
            }
        };
        semihosting::println!("{}", hash_blocks(&buffer[..length], memory));
        process::exit(0)
    }
    let clip = Clip::parse(&buffer[..length], Limits::MAX).unwrap_or_else(|error| panic!("{error}"));
    let lent = hash(&clip, pose, Some(words));
    let bare = hash(&clip, pose, None);
    assert!(lent == bare, "a lent table changes the frames: {lent} with, {bare} without");
    semihosting::println!("{lent}");
    process::exit(0)
}

fn hash(clip: &Clip<'_>, pose: &mut [I16F16], words: Option<&mut [i32]>) -> common::Hash {
    let mut decoder = clip.decoder(pose, words).unwrap_or_else(|error| panic!("{error}"));
    let mut frames = Frames::new();
    while let Some(frame) = decoder.next_frame() {
        frames.add(frame);
    }
    frames.finish()
}

fn hash_blocks(bytes: &[u8], memory: mclip::Memory<'_>) -> common::Hash {
    let clip = mclip::Clip::parse(bytes, Limits::MAX).unwrap_or_else(|error| panic!("{error}"));
    let mut decoder = clip.decoder(memory).unwrap_or_else(|error| panic!("{error}"));
    let mut frames = Frames::new();
    while let Some(frame) = decoder.next_frame().unwrap_or_else(|error| panic!("{error}")) {
        frames.add(frame);
    }
    frames.finish()
}

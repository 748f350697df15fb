//! Decodes the clip that its host wrote into `CLIP`, and leaves the SHA-256 of the frames in `HASH`.
//!
//! The host finds both by the addresses that [`clip`] and [`hash`] give; [`decode`] takes the clip's length.
#![no_std]
#![no_main]

use core::panic::PanicInfo;
use core::ptr::addr_of_mut;
use decoder_core::qmd::Clip;
use decoder_core::{I16F16, Limits, mclip};
use sha2::{Digest, Sha256};

/// Longest clip.
const BYTES: usize = 1 << 20;
/// Most channels.
const CHANNELS: usize = 4096;
/// Longest table: index bits 16.
const TABLE: usize = 1 << 16;

static mut CLIP: [u8; BYTES] = [0; BYTES];
static mut HASH: [u8; 32] = [0; 32];
static mut POSE: [I16F16; CHANNELS] = [I16F16::ZERO; CHANNELS];
static mut WORDS: [i32; TABLE] = [0; TABLE];
static mut STATES: [mclip::State; CHANNELS] = [mclip::State::EMPTY; CHANNELS];
static mut WIDE: [u32; 4 * CHANNELS] = [0; 4 * CHANNELS];
static mut CODES: [u16; TABLE] = [0; TABLE];

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    core::arch::wasm32::unreachable()
}

/// Where the clip goes.
#[unsafe(no_mangle)]
pub extern "C" fn clip() -> *mut u8 {
    addr_of_mut!(CLIP).cast()
}

/// Where the hash is.
#[unsafe(no_mangle)]
pub extern "C" fn hash() -> *mut u8 {
    addr_of_mut!(HASH).cast()
}

/// Decodes the first `length` bytes of the clip; gives the number of frames, or 0 where it is refused.
#[unsafe(no_mangle)]
pub extern "C" fn decode(length: u32, lend: u32) -> u32 {
    // SAFETY: the host makes one call at a time, and nothing else uses the buffers.
    let (bytes, out, pose, words) = unsafe {
        (&*addr_of_mut!(CLIP), &mut *addr_of_mut!(HASH), &mut *addr_of_mut!(POSE), &mut *addr_of_mut!(WORDS))
    };
    let parsed = bytes.get(..length as usize).map(|bytes| Clip::parse(bytes, Limits::MAX));
    let Some(Ok(clip)) = parsed else { return 0 };
    let Ok(mut decoder) = clip.decoder(pose, (lend != 0).then_some(words)) else { return 0 };
    let mut sha = Sha256::new();
    while let Some(pose) = decoder.next_frame() {
        for value in pose {
            sha.update(value.to_bits().to_le_bytes());
        }
    }
    out.copy_from_slice(&sha.finalize());
    decoder.position()
}

/// Decodes the first `length` bytes as a clip in blocks; gives the number of frames, or 0 where it is refused.
#[unsafe(no_mangle)]
pub extern "C" fn decode_mclip(length: u32) -> u32 {
    // SAFETY: the host makes one call at a time, and nothing else uses the buffers.
    let (bytes, out, memory) = unsafe {
        let memory = mclip::Memory {
            pose: &mut *addr_of_mut!(POSE),
            states: &mut *addr_of_mut!(STATES),
            words: &mut *addr_of_mut!(WIDE),
            halves: &mut *addr_of_mut!(CODES),
        };
        (&*addr_of_mut!(CLIP), &mut *addr_of_mut!(HASH), memory)
    };
    let parsed = bytes.get(..length as usize).map(|bytes| mclip::Clip::parse(bytes, Limits::MAX));
    let Some(Ok(clip)) = parsed else { return 0 };
    let Ok(mut decoder) = clip.decoder(memory) else { return 0 };
    let mut sha = Sha256::new();
    loop {
        match decoder.next_frame() {
            Ok(Some(pose)) => pose.iter().for_each(|value| sha.update(value.to_bits().to_le_bytes())),
            Ok(None) => break,
            Err(_) => return 0,
        }
    }
    out.copy_from_slice(&sha.finalize());
    decoder.position()
}

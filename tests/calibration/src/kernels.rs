//! Loops like those of decoders, and a decoder, small enough for 16 KB of ROM: run on several simulators of one
//! core. Each takes nothing and gives a checksum. RAM starts out undefined and is written before it is read.
#![no_std]
#![no_main]

use core::arch::global_asm;
use core::hint::black_box;
use core::panic::PanicInfo;
use core::ptr::addr_of_mut;
use decoder_core::qmd::Clip;
use decoder_core::{I16F16, Limits};

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {}
}

global_asm!(".section .vectors, \"a\"", ".word _stack_start", ".word start");

/// Keeps the kernels in the image.
#[unsafe(no_mangle)]
extern "C" fn start() -> ! {
    black_box((lookup as extern "C" fn() -> u32, serial as extern "C" fn() -> u32));
    black_box((predict as extern "C" fn() -> u32, divide as extern "C" fn() -> u32));
    black_box(decode as extern "C" fn() -> u32);
    loop {}
}

const CHANNELS: usize = 62;

static CLIP: &[u8] = include_bytes!("../../vectors/v1/qmd-segments.qmd");
static mut VALUES: [i32; 256] = [0; 256];
static mut INDICES: [u8; 256] = [0; 256];

/// The buffers, filled with numbers of a linear congruential generator.
fn buffers() -> (&'static mut [i32; 256], &'static mut [u8; 256]) {
    // SAFETY: one kernel runs at a time, and calls this once.
    let (values, indices) = unsafe { (&mut *addr_of_mut!(VALUES), &mut *addr_of_mut!(INDICES)) };
    let mut state = 1u32;
    for (value, index) in values.iter_mut().zip(indices.iter_mut()) {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *value = state as i32 >> 8;
        *index = (state >> 24) as u8;
    }
    (values, indices)
}

fn checksum(values: &[i32]) -> u32 {
    values.iter().fold(0, |sum, &value| sum.rotate_left(5) ^ value as u32)
}

/// A row of table look-ups, added up for each channel.
#[unsafe(no_mangle)]
extern "C" fn lookup() -> u32 {
    let (table, indices) = buffers();
    let mut pose = [0i32; CHANNELS];
    for _ in 0..16 {
        for (value, &index) in pose.iter_mut().zip(black_box(&*indices)) {
            *value = value.wrapping_add(table[usize::from(index)]);
        }
    }
    checksum(&pose)
}

/// A code read bit by bit.
#[unsafe(no_mangle)]
extern "C" fn serial() -> u32 {
    let (values, indices) = buffers();
    let (mut at, mut sum) = (0usize, 0u32);
    for _ in 0..256 {
        let mut code = 1usize;
        while code < 128 {
            let bit = indices[at >> 3 & 255] >> (at & 7) & 1;
            at += 1;
            code = code << 1 | usize::from(bit);
            if code >= 4 && values[code & 255] < 0 {
                break;
            }
        }
        sum = sum.rotate_left(3) ^ code as u32;
    }
    sum
}

/// A second-order predictor with 64-bit products.
#[unsafe(no_mangle)]
extern "C" fn predict() -> u32 {
    let (values, _) = buffers();
    let (mut before, mut last) = (0i32, 0i32);
    for value in values.iter_mut() {
        let sum = i64::from(last) * 115_000 - i64::from(before) * 50_000;
        before = last;
        last = value.wrapping_add((sum >> 16) as i32);
        *value = last;
    }
    checksum(values)
}

/// Divisions.
#[unsafe(no_mangle)]
extern "C" fn divide() -> u32 {
    let (values, indices) = buffers();
    for (value, &index) in values.iter_mut().zip(indices.iter()) {
        *value /= i32::from(index) + 1;
    }
    checksum(values)
}

/// A whole clip of `tests/vectors/v1`, without a lent table.
#[unsafe(no_mangle)]
extern "C" fn decode() -> u32 {
    let mut pose = [I16F16::ZERO; 64];
    let Ok(clip) = Clip::parse(black_box(CLIP), Limits::MAX) else {
        return 1;
    };
    let Ok(mut decoder) = clip.decoder(&mut pose, None) else {
        return 2;
    };
    let mut sum = 0u32;
    while let Some(frame) = decoder.next_frame() {
        for value in frame {
            sum = sum.rotate_left(5) ^ value.to_bits() as u32;
        }
    }
    sum
}

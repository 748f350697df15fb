//! Streams the clip that its argument names into the decoder, in chunks of odd sizes, and prints the hash of the
//! frames. Fits the 16 KB of RAM of a Cortex-M0.
#![no_std]
#![no_main]

mod common;

use common::{Frames, open};
use cortex_m as _;
use cortex_m_rt::entry;
use decoder_core::qmd::Stream;
use decoder_core::{I16F16, Limits};
use semihosting::io::Read;
use semihosting::process;

/// Most channels.
const CHANNELS: usize = 320;
/// Longest table: index bits 10.
const TABLE: usize = 1 << 10;
/// Longest row.
const ROW: usize = 1280;
/// Sizes of the chunks, one after the other.
const CHUNKS: [usize; 7] = [61, 1, 255, 7, 2, 127, 13];

#[entry]
fn main() -> ! {
    let mut file = open();
    let (mut pose, mut table, mut row) = ([I16F16::ZERO; CHANNELS], [0; TABLE], [0; ROW]);
    let mut stream = Stream::new(Limits::MAX, &mut pose, &mut table, &mut row);
    let mut frames = Frames::new();
    let mut buffer = [0; 255];
    for size in CHUNKS.iter().cycle() {
        let count = file.read(&mut buffer[..*size]).expect("the clip cannot be read");
        if count == 0 {
            break;
        }
        let mut chunk = &buffer[..count];
        while let Some(frame) = stream.next_frame(&mut chunk).unwrap_or_else(|error| panic!("{error}")) {
            frames.add(frame);
        }
    }
    stream.finish().unwrap_or_else(|error| panic!("{error}"));
    semihosting::println!("{}", frames.finish());
    process::exit(0)
}

//! Plays int16 frames packed by heatshrink, window 2^11, look-ahead 2^4.
#![no_std]
#![no_main]

mod blocks;
#[path = "../../../tests/profile-image/src/ends.rs"]
mod ends;
#[path = "../../../tests/profile-image/src/loaded.rs"]
mod loaded;
mod player;

use blocks::{BLOCK, Blocks, Unpack};

type Store = Blocks<Heatshrink>;

struct Heatshrink;

impl Unpack for Heatshrink {
    fn new() -> Self {
        Self
    }

    fn unpack(&mut self, packed: &[u8], block: &mut [u8; BLOCK]) -> Option<usize> {
        let config = heatshrink::Config::new(11, 4).ok()?;
        heatshrink::decode(packed, block, &config).ok().map(|block| block.len())
    }
}

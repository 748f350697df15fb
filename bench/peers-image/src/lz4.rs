//! Plays int16 frames packed as LZ4 blocks by lz4_flex.
#![no_std]
#![no_main]

mod blocks;
#[path = "../../../tests/profile-image/src/ends.rs"]
mod ends;
#[path = "../../../tests/profile-image/src/loaded.rs"]
mod loaded;
mod player;

use blocks::{BLOCK, Blocks, Unpack};

type Store = Blocks<Lz4>;

struct Lz4;

impl Unpack for Lz4 {
    fn new() -> Self {
        Self
    }

    fn unpack(&mut self, packed: &[u8], block: &mut [u8; BLOCK]) -> Option<usize> {
        lz4_flex::block::decompress_into(packed, block).ok()
    }
}

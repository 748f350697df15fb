//! Plays int16 frames packed as raw DEFLATE by miniz_oxide.
#![no_std]
#![no_main]

mod blocks;
#[path = "../../../tests/profile-image/src/ends.rs"]
mod ends;
#[path = "../../../tests/profile-image/src/loaded.rs"]
mod loaded;
mod player;

use blocks::{BLOCK, Blocks, Unpack};
use miniz_oxide::inflate::TINFLStatus;
use miniz_oxide::inflate::core::{DecompressorOxide, decompress, inflate_flags};

type Store = Blocks<DecompressorOxide>;

impl Unpack for DecompressorOxide {
    fn new() -> Self {
        Self::new()
    }

    fn unpack(&mut self, packed: &[u8], block: &mut [u8; BLOCK]) -> Option<usize> {
        self.init();
        let flags = inflate_flags::TINFL_FLAG_USING_NON_WRAPPING_OUTPUT_BUF;
        let (status, _, len) = decompress(self, packed, block, 0, flags);
        (status == TINFLStatus::Done).then_some(len)
    }
}

//! Blocks of frames, each packed by itself and unpacked when its first frame is due: two bytes of length, then so
//! many bytes.

use crate::FRAME;

include!(concat!(env!("OUT_DIR"), "/block.rs"));

/// Bytes of the frames that are packed together, and one more: heatshrink's decoder fails where it has no room left.
const BLOCK: usize = BLOCK_FRAMES * FRAME + 1;

pub struct Store {
    rest: &'static [u8],
    block: [u8; BLOCK],
    /// Where the next frame is in the block, and where the block ends.
    at: usize,
    end: usize,
    #[cfg(feature = "miniz_oxide")]
    inflater: miniz_oxide::inflate::core::DecompressorOxide,
}

impl Store {
    pub fn new(bytes: &'static [u8]) -> Option<Self> {
        Some(Self {
            rest: bytes,
            block: [0; BLOCK],
            at: 0,
            end: 0,
            #[cfg(feature = "miniz_oxide")]
            inflater: miniz_oxide::inflate::core::DecompressorOxide::new(),
        })
    }

    pub fn frame(&mut self) -> Option<&[u8]> {
        if self.at == self.end {
            let (&len, rest) = self.rest.split_first_chunk::<2>()?;
            let (packed, rest) = rest.split_at_checked(usize::from(u16::from_le_bytes(len)))?;
            self.rest = rest;
            self.end = self.unpack(packed)?;
            self.at = 0;
        }
        let frame = self.block.get(self.at..self.at + FRAME);
        self.at += FRAME;
        frame
    }

    #[cfg(feature = "heatshrink")]
    fn unpack(&mut self, packed: &[u8]) -> Option<usize> {
        let config = heatshrink::Config::new(11, 4).ok()?;
        heatshrink::decode(packed, &mut self.block, &config).ok().map(|block| block.len())
    }

    #[cfg(feature = "lz4_flex")]
    fn unpack(&mut self, packed: &[u8]) -> Option<usize> {
        lz4_flex::block::decompress_into(packed, &mut self.block).ok()
    }

    #[cfg(feature = "miniz_oxide")]
    fn unpack(&mut self, packed: &[u8]) -> Option<usize> {
        use miniz_oxide::inflate::{TINFLStatus, core};
        self.inflater.init();
        let flags = core::inflate_flags::TINFL_FLAG_USING_NON_WRAPPING_OUTPUT_BUF;
        let (status, _, len) = core::decompress(&mut self.inflater, packed, &mut self.block, 0, flags);
        (status == TINFLStatus::Done).then_some(len)
    }
}

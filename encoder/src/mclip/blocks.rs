//! The blocks of a clip (docs/FORMAT.md, "Blocks"): frames that go together under a checksum.

use decoder_core::bits::BitWriter;
use decoder_core::mclip::BlockHeader;

/// A frame in bits.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Whether it decodes without the frames before it.
    pub entry: bool,
    /// Its codes.
    pub codes: BitWriter<Vec<u8>>,
}

/// Puts frames into blocks of at most `most` bytes of codes, or of one frame where that is longer; gives the bytes of the
/// blocks, and those of the longest one's codes.
pub fn emit(frames: &[Frame], most: u16) -> (Vec<u8>, u16) {
    let mut bytes = Vec::new();
    let mut longest = 0;
    let mut block = Block::default();
    for Frame { entry, codes } in frames {
        let length = (block.codes.length() + codes.length()).div_ceil(8);
        if *entry || length > usize::from(most) || block.frames == u16::MAX {
            block.finish(&mut bytes, &mut longest);
            block.entry = *entry;
        }
        block.codes.append(codes);
        block.frames += 1;
    }
    block.finish(&mut bytes, &mut longest);
    (bytes, longest as u16)
}

/// A block that is being filled.
#[derive(Default)]
struct Block {
    codes: BitWriter<Vec<u8>>,
    frames: u16,
    first_frame: u32,
    entry: bool,
}

impl Block {
    fn finish(&mut self, bytes: &mut Vec<u8>, longest: &mut usize) {
        if self.frames == 0 {
            return;
        }
        let codes = self.codes.take();
        *longest = codes.len().max(*longest);
        if let Some(header) = BlockHeader::of(&codes, self.frames, self.first_frame, self.entry) {
            bytes.extend(header.emit());
            bytes.extend(codes);
        }
        *self = Self { first_frame: self.first_frame + u32::from(self.frames), ..Self::default() };
    }
}

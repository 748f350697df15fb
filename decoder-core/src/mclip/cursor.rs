//! A position in a block, from which a codec's decoder is led to the next frame.

use super::block::{BLOCK_HEADER_BYTES, BlockHeader};
use crate::codec::contract::FrameDecoder;
use crate::error::{Error, Field};

/// A position in the codes of a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockCursor {
    /// Number of the frame whose codes come next.
    pub frame: u32,
    /// Frames before this one need no more than to be decoded: they are neither a block's first one nor its last one.
    plain: u32,
    /// Frames of the block and of those before it.
    end: u32,
    /// Where the block's header is in the clip.
    at: usize,
    /// What the decoder has to be told before the next frame.
    entering: Entering,
}

/// Whether a block is entered with the next frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Entering {
    /// It was.
    Entered,
    /// It goes on where the one before it ended.
    Continuing,
    /// It is an entry point.
    EntryPoint,
}

impl BlockCursor {
    /// Before the first frame of a block, whose header is at byte `at`.
    pub const fn new(block: BlockHeader, at: usize) -> Self {
        let end = block.first_frame.saturating_add(block.frames as u32);
        let entering = if block.entry { Entering::EntryPoint } else { Entering::Continuing };
        Self { frame: block.first_frame, plain: 0, end, at, entering }
    }

    /// In no block; `frame` comes next.
    pub const fn outside(frame: u32) -> Self {
        Self { frame, plain: 0, end: frame, at: 0, entering: Entering::Entered }
    }

    /// Decodes the next frame where it is one of those that need no more; whether it was.
    ///
    /// # Errors
    /// [`Error::Truncated`].
    #[inline(always)]
    pub fn next_plain(&mut self, decoder: &mut impl FrameDecoder, codes: &[u8]) -> Result<bool, Error> {
        if self.frame >= self.plain {
            return Ok(false);
        }
        if decoder.next_frame(codes).is_none() {
            return Err(self.truncated(codes.len()));
        }
        self.frame = self.frame.wrapping_add(1);
        Ok(true)
    }

    /// Decodes the next frame; false after the last one.
    ///
    /// # Errors
    /// [`Error::Truncated`], or [`Error::Malformed`] after the last one.
    #[inline(always)]
    pub fn next(&mut self, decoder: &mut impl FrameDecoder, codes: &[u8]) -> Result<bool, Error> {
        if self.is_done() {
            return Ok(false);
        }
        let mut decoded = Some(false);
        if self.entering != Entering::Entered {
            decoded = decoder.begin(codes, self.entering == Entering::EntryPoint);
        }
        if decoded == Some(false) {
            decoded = decoder.next_frame(codes).map(|()| true);
        }
        if decoded.is_none() {
            return Err(self.truncated(codes.len()));
        }
        self.entering = Entering::Entered;
        self.plain = self.end.saturating_sub(1);
        let next = self.frame.wrapping_add(1);
        if next >= self.end && decoder.used() != codes.len() {
            return Err(self.too_long(codes.len(), decoder.used()));
        }
        self.frame = next;
        Ok(true)
    }

    /// Whether all of the block's frames were given.
    pub const fn is_done(&self) -> bool {
        self.frame >= self.end
    }

    #[cold]
    const fn truncated(&self, found: usize) -> Error {
        let at = self.at.saturating_add(BLOCK_HEADER_BYTES);
        Error::Truncated { field: Field::Payload, at, needed: found.saturating_add(1), found }
    }

    #[cold]
    const fn too_long(&self, found: usize, used: usize) -> Error {
        let (found, used) = (found as u32, used as u32);
        Error::Malformed { field: Field::BlockLength, at: self.at, found, low: used, high: used }
    }
}

/// Frames that are to be decoded before the first pose is that of a frame, where a codec has a
/// [delay](FrameDecoder::delay). Where that is 0, which the compiler knows for a codec, nothing here takes time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Missing(u32);

impl Missing {
    /// Before an entry point, with poses of nothing before it.
    pub fn at_entry(decoder: &impl FrameDecoder) -> Self {
        Self(decoder.delay().into())
    }

    /// Takes in a frame: whether the pose after it is none of the clip's.
    #[inline(always)]
    pub fn hides_pose(&mut self, decoder: &impl FrameDecoder) -> bool {
        let hidden = decoder.delay() > 0 && self.0 > 0;
        if hidden {
            self.0 = self.0.saturating_sub(1);
        }
        hidden
    }

    /// Number of the frame whose pose comes next, where that whose codes come next is `frame`.
    #[inline(always)]
    pub fn position(self, decoder: &impl FrameDecoder, frame: u32) -> u32 {
        match u32::from(decoder.delay()) {
            0 => frame,
            delay => frame.saturating_sub(delay.saturating_sub(self.0)),
        }
    }
}

/// Whether poses are still to come by [`drain`](FrameDecoder::drain), where all codes of a clip of so many frames were taken and
/// `frame` counts on.
#[inline(always)]
pub(super) fn has_poses_left(decoder: &impl FrameDecoder, frame: u32, frames: u32) -> bool {
    decoder.delay() > 0 && frame < frames.saturating_add(decoder.delay().into())
}

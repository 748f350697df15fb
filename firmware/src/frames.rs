//! Where frames come from.

use crate::demands::{Facts, count};
use decoder_core::{Error, I16F16, mclip, qmd};

/// Where frames come from, in order.
///
/// A frame has one value a channel. Angles are taken to be continuous from frame to frame (the encoder unwraps
/// them): interpolation does not know that 360° is 0°.
pub trait Frames {
    /// Values in a frame.
    fn channels(&self) -> usize;

    /// Frames of the clip.
    fn frames(&self) -> u32;

    /// Frames per second, in hundredths.
    fn rate_centihertz(&self) -> u16;

    /// Digest of the channels' names ([`names_digest`](mclip::Header::names_digest)); `None` where they have none. Takes a pass over
    /// the names.
    fn names(&self) -> Option<u32> {
        None
    }

    /// What the clip says of itself, as much as decides whether it can be played.
    fn facts(&self) -> Facts {
        Facts {
            frames: self.frames(),
            channels: count(self.channels()),
            rate_centihertz: self.rate_centihertz(),
            names: self.names(),
        }
    }

    /// Number of the frame that [`next_frame`](Self::next_frame) gives.
    fn position(&self) -> u32;

    /// The next frame; `None` after the last one.
    ///
    /// # Errors
    /// What is wrong with the clip; it gives no further frame then.
    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error>;

    /// Goes to the last frame at or before `frame` that can be reached without decoding. Takes a short and bounded time,
    /// so it may be far before.
    fn approach(&mut self, frame: u32);
}

impl<F: Frames + ?Sized> Frames for &mut F {
    fn channels(&self) -> usize {
        (**self).channels()
    }

    fn frames(&self) -> u32 {
        (**self).frames()
    }

    fn rate_centihertz(&self) -> u16 {
        (**self).rate_centihertz()
    }

    fn names(&self) -> Option<u32> {
        (**self).names()
    }

    fn position(&self) -> u32 {
        (**self).position()
    }

    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        (**self).next_frame()
    }

    fn approach(&mut self, frame: u32) {
        (**self).approach(frame);
    }
}

impl Frames for qmd::Decoder<'_, '_> {
    fn channels(&self) -> usize {
        self.clip().channels()
    }

    fn frames(&self) -> u32 {
        self.clip().frames()
    }

    fn rate_centihertz(&self) -> u16 {
        self.clip().rate_centihertz()
    }

    fn position(&self) -> u32 {
        self.position()
    }

    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        Ok(self.next_frame())
    }

    fn approach(&mut self, frame: u32) {
        if self.position() > frame {
            self.rewind();
        }
    }
}

impl Frames for mclip::Decoder<'_, '_> {
    fn channels(&self) -> usize {
        self.clip().channels()
    }

    fn frames(&self) -> u32 {
        self.clip().frames()
    }

    fn rate_centihertz(&self) -> u16 {
        self.clip().header().rate_centihertz()
    }

    fn names(&self) -> Option<u32> {
        self.clip().header().names_digest()
    }

    fn position(&self) -> u32 {
        self.position()
    }

    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        self.next_frame()
    }

    fn approach(&mut self, frame: u32) {
        // Where headers of blocks are damaged, decoding from the start comes upon them and says so.
        if self.approach(frame).is_err() {
            self.rewind();
        }
    }
}

//! Plays a clip that lies in memory, frame by frame.

use super::block::Block;
use super::clip::Clip;
use super::cursor::{BlockCursor, Missing, has_poses_left};
use crate::codec::contract::FrameDecoder;
use crate::codec::linked::RunningCodec;
use crate::error::Error;
use crate::memory::Memory;
use fixed::types::I16F16;

/// A position in a clip, and the pose there. Made by [`Clip::decoder`].
pub type Decoder<'a, 's> = ClipDecoder<'a, RunningCodec<'a, 's>>;

/// A position in a clip, and the pose there, by a codec's decoder.
///
/// What every frame needs comes first, where short instructions reach it.
#[derive(Debug)]
#[repr(C)]
pub struct ClipDecoder<'a, D> {
    /// Where it is in the block, or which frame comes next.
    cursor: BlockCursor,
    /// The block's codes.
    codes: &'a [u8],
    decoder: D,
    at: At,
    missing: Missing,
    clip: Clip<'a>,
}

impl<'a> Clip<'a> {
    /// A decoder before the first frame, in memory of at least [`Header::needs`](super::Header::needs).
    ///
    /// # Errors
    /// [`Error::OutputTooSmall`], or [`Error::Encoding`] where the code tables are none.
    pub fn decoder<'s>(&self, memory: Memory<'s>) -> Result<Decoder<'a, 's>, Error> {
        Ok(ClipDecoder::new(*self, self.header().open(memory)?))
    }
}

/// Where in its blocks a decoder is.
#[derive(Clone, Copy, Debug)]
enum At {
    /// Between blocks; the next one's header is at this byte.
    Boundary(usize),
    /// In a block, after which the next one's header is at byte `end`.
    Inside { end: usize },
    /// After an error, which is repeated until the next seek.
    Failed(Error),
}

impl<'a, D: FrameDecoder> ClipDecoder<'a, D> {
    pub(super) fn new(clip: Clip<'a>, decoder: D) -> Self {
        let (at, missing) = (At::Boundary(clip.header_bytes()), Missing::at_entry(&decoder));
        Self { cursor: BlockCursor::outside(0), codes: &[], decoder, at, missing, clip }
    }

    /// Decodes the next frame and returns its pose, an element a channel; `None` after the last one.
    ///
    /// # Errors
    /// [`Error::Checksum`] where the next block was damaged and the clip was not [verified](Clip::verify),
    /// [`Error::Truncated`] or [`Error::Malformed`] where its
    /// codes are not as long as it. After an error only [`seek`](Self::seek) and [`rewind`](Self::rewind) go on.
    #[inline]
    pub fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        let found = match self.cursor.next_plain(&mut self.decoder, self.codes) {
            Ok(false) => self.advance(),
            Ok(true) => Ok(true),
            Err(error) => self.fail(error),
        };
        Ok(if found? { Some(self.decoder.pose()) } else { None })
    }

    /// Goes on to a frame that something comes before or after: a block begins or ends, or poses lag behind.
    #[inline(never)]
    fn advance(&mut self) -> Result<bool, Error> {
        loop {
            let found = match self.cross() {
                Ok(found) => found,
                Err(error) => return self.fail(error),
            };
            if !(found && self.missing.hides_pose(&self.decoder)) {
                return Ok(found);
            }
        }
    }

    #[inline(always)]
    fn cross(&mut self) -> Result<bool, Error> {
        if self.cursor.frame >= self.clip.frames() {
            let found = has_poses_left(&self.decoder, self.cursor.frame, self.clip.frames());
            if found {
                self.decoder.drain();
                self.cursor = BlockCursor::outside(self.cursor.frame.saturating_add(1));
            }
            return Ok(found);
        }
        let end = match self.at {
            At::Failed(error) => return Err(error),
            At::Boundary(at) => self.enter(at)?,
            At::Inside { end } => end,
        };
        let found = self.cursor.next(&mut self.decoder, self.codes)?;
        if self.cursor.is_done() {
            self.at = At::Boundary(end);
        }
        Ok(found)
    }

    #[cold]
    fn fail(&mut self, error: Error) -> Result<bool, Error> {
        self.cursor = BlockCursor::outside(self.cursor.frame);
        self.at = At::Failed(error);
        Err(error)
    }

    /// Enters the block whose header is at byte `at`; gives where the next one's is.
    #[inline(always)]
    fn enter(&mut self, at: usize) -> Result<usize, Error> {
        let block =
            Block::read(self.clip.bytes(), at, self.clip.header().block_bounds(), Some(self.cursor.frame))?;
        let Block { header, at, codes } = block;
        if !self.clip.is_verified() {
            header.verify(codes, at)?;
        }
        let end = block.end();
        (self.at, self.codes) = (At::Inside { end }, codes);
        self.cursor = BlockCursor::new(header, at);
        Ok(end)
    }

    /// Goes back to before the first frame.
    pub fn rewind(&mut self) {
        self.go_to(0, self.clip.header_bytes());
    }

    /// Goes to before an entry point: its first frame, and where the block's header is.
    fn go_to(&mut self, frame: u32, at: usize) {
        self.at = At::Boundary(at);
        self.cursor = BlockCursor::outside(frame);
        self.missing = Missing::at_entry(&self.decoder);
    }

    /// Decodes frame `frame` (0 is the first) and returns its pose; `None` where there is no such frame, which
    /// leaves the position as it was.
    ///
    /// Decodes forward from the last entry point before the frame, or from the position where that is nearer.
    ///
    /// # Errors
    /// As [`next_frame`](Self::next_frame).
    pub fn seek(&mut self, frame: u32) -> Result<Option<&[I16F16]>, Error> {
        if frame >= self.clip.frames() {
            return Ok(None);
        }
        self.approach(frame)?;
        while self.position() < frame {
            self.next_frame()?;
        }
        self.next_frame()
    }

    /// Goes to the last entry point before frame `frame`, unless the position lies between the two already. Nothing is decoded;
    /// past the last frame it does nothing.
    ///
    /// # Errors
    /// As [`next_frame`](Self::next_frame).
    pub fn approach(&mut self, frame: u32) -> Result<(), Error> {
        if frame >= self.clip.frames() {
            return Ok(());
        }
        let entry = self.clip.entry_before(frame)?;
        let nearer = self.position() <= frame && self.position() >= entry.first_frame;
        if !nearer || matches!(self.at, At::Failed(_)) {
            self.go_to(entry.first_frame, entry.at as usize);
        }
        Ok(())
    }

    /// Number of the frame that comes next.
    pub fn position(&self) -> u32 {
        self.missing.position(&self.decoder, self.cursor.frame)
    }

    /// The clip.
    pub const fn clip(&self) -> &Clip<'a> {
        &self.clip
    }
}

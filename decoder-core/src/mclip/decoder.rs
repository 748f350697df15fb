//! Plays a clip that lies in memory, frame by frame.

use super::block::Cursor;
use super::clip::{Block, Clip};
use super::engine::Engine;
use crate::error::Error;
use fixed::types::I16F16;

/// A position in a clip, and the pose there. Made by [`Clip::decoder`].
///
/// What every frame needs comes first, where short instructions reach it.
#[derive(Debug)]
#[repr(C)]
pub struct Decoder<'a, 's> {
    /// Where it is in the block, or which frame comes next.
    cursor: Cursor,
    /// The block's codes.
    codes: &'a [u8],
    engine: Engine<'a, 's>,
    at: At,
    clip: Clip<'a>,
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

impl<'a, 's> Decoder<'a, 's> {
    pub(super) const fn new(clip: Clip<'a>, engine: Engine<'a, 's>) -> Self {
        let at = At::Boundary(clip.header_bytes());
        Self { cursor: Cursor::outside(0), codes: &[], engine, at, clip }
    }

    /// Decodes the next frame and returns its pose, an element a channel; `None` after the last one.
    ///
    /// # Errors
    /// [`Error::Checksum`] where the next block was damaged and the clip was not [verified](Clip::verify),
    /// [`Error::Truncated`] or [`Error::Malformed`] where its
    /// codes are not as long as it. After an error only [`seek`](Self::seek) and [`rewind`](Self::rewind) go on.
    #[inline]
    pub fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        let found = match self.cursor.next_plain(&mut self.engine, self.codes) {
            Ok(false) => self.advance(),
            Ok(true) => Ok(true),
            Err(error) => self.fail(error),
        };
        Ok(if found? { Some(self.engine.pose()) } else { None })
    }

    /// Goes on to a frame that something comes before or after: a block begins or ends.
    #[inline(never)]
    fn advance(&mut self) -> Result<bool, Error> {
        match self.cross() {
            Ok(found) => Ok(found),
            Err(error) => self.fail(error),
        }
    }

    #[inline(always)]
    fn cross(&mut self) -> Result<bool, Error> {
        if self.cursor.frame >= self.clip.frames() {
            return Ok(false);
        }
        if let At::Boundary(at) = self.at {
            self.enter(at)?;
        }
        match self.at {
            At::Failed(error) => Err(error),
            At::Boundary(_) => Ok(false),
            At::Inside { end } => {
                let found = self.cursor.next(&mut self.engine, self.codes)?;
                if self.cursor.is_done() {
                    self.at = At::Boundary(end);
                }
                Ok(found)
            }
        }
    }

    #[cold]
    fn fail(&mut self, error: Error) -> Result<bool, Error> {
        self.cursor = Cursor::outside(self.cursor.frame);
        self.at = At::Failed(error);
        Err(error)
    }

    /// Enters the block whose header is at byte `at`.
    #[inline(always)]
    fn enter(&mut self, at: usize) -> Result<(), Error> {
        let Block { header, at, codes, end } = self.clip.block_here(at, Some(self.cursor.frame))?;
        if !self.clip.is_verified() {
            header.verify(codes, at)?;
        }
        (self.at, self.codes, self.cursor) = (At::Inside { end }, codes, Cursor::new(header, at));
        Ok(())
    }

    /// Goes back to before the first frame.
    pub const fn rewind(&mut self) {
        self.at = At::Boundary(self.clip.header_bytes());
        self.cursor = Cursor::outside(0);
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
        let nearer = self.position() <= frame && self.position() >= entry.header.first_frame;
        if !nearer || matches!(self.at, At::Failed(_)) {
            self.at = At::Boundary(entry.at);
            self.cursor = Cursor::outside(entry.header.first_frame);
        }
        Ok(())
    }

    /// Number of the frame that comes next.
    pub const fn position(&self) -> u32 {
        self.cursor.frame
    }

    /// The clip.
    pub const fn clip(&self) -> &Clip<'a> {
        &self.clip
    }
}

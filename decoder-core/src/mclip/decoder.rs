//! Plays a clip that lies in memory, frame by frame.

use super::block::Cursor;
use super::clip::{Block, Clip};
use super::engine::Engine;
use crate::error::Error;
use fixed::types::I16F16;

/// A position in a clip, and the pose there. Made by [`Clip::decoder`].
#[derive(Debug)]
pub struct Decoder<'a, 's> {
    clip: Clip<'a>,
    engine: Engine<'a, 's>,
    at: At<'a>,
    position: u32,
}

/// Where in its blocks a decoder is.
#[derive(Clone, Copy, Debug)]
enum At<'a> {
    /// Between blocks; the next one's header is at this byte.
    Boundary(usize),
    /// In a block with these codes, after which the next one's header is at byte `end`.
    Inside { codes: &'a [u8], end: usize, cursor: Cursor },
    /// After an error, which is repeated until the next seek.
    Failed(Error),
}

impl<'a, 's> Decoder<'a, 's> {
    pub(super) const fn new(clip: Clip<'a>, engine: Engine<'a, 's>) -> Self {
        Self { clip, engine, at: At::Boundary(clip.header_bytes()), position: 0 }
    }

    /// Decodes the next frame and returns its pose, an element a channel; `None` after the last one.
    ///
    /// # Errors
    /// [`Error::Checksum`] where the next block was damaged and the clip was not [verified](Clip::verify),
    /// [`Error::Truncated`] or [`Error::Malformed`] where its
    /// codes are not as long as it. After an error only [`seek`](Self::seek) and [`rewind`](Self::rewind) go on.
    pub fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        match self.advance() {
            Ok(true) => Ok(Some(self.engine.pose())),
            Ok(false) => Ok(None),
            Err(error) => {
                self.at = At::Failed(error);
                Err(error)
            }
        }
    }

    fn advance(&mut self) -> Result<bool, Error> {
        if self.position >= self.clip.frames() {
            return Ok(false);
        }
        if let At::Boundary(at) = self.at {
            self.enter(at)?;
        }
        match &mut self.at {
            At::Failed(error) => Err(*error),
            At::Boundary(_) => Ok(false),
            At::Inside { codes, end, cursor } => {
                let found = cursor.next(&mut self.engine, codes)?;
                self.position = self.position.wrapping_add(1);
                if cursor.is_done() {
                    self.at = At::Boundary(*end);
                }
                Ok(found)
            }
        }
    }

    /// Enters the block whose header is at byte `at`.
    #[inline(never)]
    fn enter(&mut self, at: usize) -> Result<(), Error> {
        let Block { header, at, codes, end } = self.clip.block(at, Some(self.position))?;
        if !self.clip.is_verified() {
            header.verify(codes, at)?;
        }
        self.at = At::Inside { codes, end, cursor: Cursor::new(header, at) };
        Ok(())
    }

    /// Goes back to before the first frame.
    pub const fn rewind(&mut self) {
        self.at = At::Boundary(self.clip.header_bytes());
        self.position = 0;
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
        while self.position < frame {
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
        let nearer = self.position <= frame && self.position >= entry.header.first_frame;
        if !nearer || matches!(self.at, At::Failed(_)) {
            self.at = At::Boundary(entry.at);
            self.position = entry.header.first_frame;
        }
        Ok(())
    }

    /// Number of the frame that comes next.
    pub const fn position(&self) -> u32 {
        self.position
    }

    /// The clip.
    pub const fn clip(&self) -> &Clip<'a> {
        &self.clip
    }
}

//! A clip that lies in memory: parsed once, read in place.

use super::decoder::Decoder;
use super::segment::{Header, Layout, SEGMENT_HEADER_BYTES, add_frames, check_level};
use crate::error::{Error, Field, Limits};
use crate::float::fixed_from_f32_bits;
use fixed::types::I16F16;

/// A QMD clip whose bytes were checked from the first to the last.
#[derive(Clone, Copy, Debug)]
pub struct Clip<'a> {
    layout: Layout,
    frames: u32,
    segments: u32,
    levels: &'a [u8],
    pose: &'a [u8],
    /// From the first segment's header on, without the levels and the pose.
    first: Segment<'a>,
    /// The bytes after the first segment.
    rest: &'a [u8],
}

/// A segment in place: as many rows as fit exactly, and the table that they index.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment<'a> {
    /// `2^b` floats, little-endian bits.
    pub table: &'a [[u8; 4]],
    /// The rows, one after the other.
    pub rows: &'a [u8],
}

impl<'a> Clip<'a> {
    /// Checks a whole clip and gives access to it. Nothing is copied.
    ///
    /// Takes time in proportion to the number of segments and channels, not of frames.
    ///
    /// # Errors
    /// [`Error::Truncated`] where the bytes end early, [`Error::Malformed`] where a field holds a value that no
    /// encoder writes, [`Error::Limit`] where the clip is larger than `limits`.
    pub fn parse(bytes: &'a [u8], limits: Limits) -> Result<Self, Error> {
        let mut cursor = Cursor { rest: bytes, at: 0 };
        let header = cursor.header(None, limits)?;
        let layout = header.layout;
        let channels = usize::from(layout.channels);
        let levels_at = cursor.at;
        let levels = cursor.take(channels, Field::Level)?;
        for (offset, &level) in levels.iter().enumerate() {
            check_level(level, levels_at.saturating_add(offset))?;
        }
        let pose = cursor.take(channels.saturating_mul(4), Field::Pose)?;
        let first = cursor.segment(header)?;
        let mut frames = add_frames(0, header.rows, limits)?;
        let mut segments = 1u32;
        let rest = cursor.rest;
        while !cursor.rest.is_empty() {
            let header = cursor.header(Some(layout), limits)?;
            cursor.segment(header)?;
            frames = add_frames(frames, header.rows, limits)?;
            segments = segments.saturating_add(1);
        }
        Ok(Self { layout, frames, segments, levels, pose, first, rest })
    }

    /// The shape of its rows and tables.
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// Channels in a frame (`m`).
    pub const fn channels(&self) -> usize {
        self.layout.channels as usize
    }

    /// Frames of all segments together, at least 1.
    pub const fn frames(&self) -> u32 {
        self.frames
    }

    /// Segments, each with a table of its own, at least 1.
    pub const fn segments(&self) -> u32 {
        self.segments
    }

    /// Frames per second in hundredths; 0 where it was not recorded.
    pub const fn rate_centihertz(&self) -> u16 {
        self.layout.rate_centihertz
    }

    /// Entries of a table (`2^b`): the words to lend for a converted one.
    pub const fn table_len(&self) -> usize {
        self.layout.table_len()
    }

    /// Hierarchy level of every channel, 1 for the root's (section 3.2).
    pub const fn levels(&self) -> &'a [u8] {
        self.levels
    }

    /// A decoder before the first frame.
    ///
    /// `pose` holds the channels between frames, one element each. `table`, where it is lent, holds each
    /// segment's table in fixed point: a frame that opens a segment then costs `2^b` conversions more, and the
    /// others one load a channel instead of a conversion.
    ///
    /// # Errors
    /// [`Error::OutputTooSmall`] where `pose` or `table` is.
    pub fn decoder<'s>(
        &self,
        pose: &'s mut [I16F16],
        table: Option<&'s mut [i32]>,
    ) -> Result<Decoder<'a, 's>, Error> {
        Decoder::new(*self, pose, table)
    }

    /// Puts the initial pose into `pose`, which has an element a channel.
    pub(super) fn initial_pose(&self, pose: &mut [I16F16]) {
        let (floats, _) = self.pose.as_chunks::<4>();
        for (value, &float) in pose.iter_mut().zip(floats) {
            *value = I16F16::from_bits(fixed_from_f32_bits(u32::from_le_bytes(float)));
        }
    }

    pub(super) const fn first_segment(&self) -> (Segment<'a>, &'a [u8]) {
        (self.first, self.rest)
    }

    /// The segment at the front of `rest`, and what follows it; `None` at the end of the clip.
    pub(super) fn next_segment(&self, rest: &'a [u8]) -> Option<(Segment<'a>, &'a [u8])> {
        // All was checked by `parse`, so an error here cannot happen, and would end the clip.
        let mut cursor = Cursor { rest, at: 0 };
        let header = cursor.header(Some(self.layout), Limits::MAX).ok()?;
        let segment = cursor.segment(header).ok()?;
        Some((segment, cursor.rest))
    }
}

/// The bytes that are still to be read, and where they start in the clip.
struct Cursor<'a> {
    rest: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, needed: usize, field: Field) -> Result<&'a [u8], Error> {
        let found = self.rest.len();
        let (taken, rest) = self.rest.split_at_checked(needed).ok_or(Error::Truncated {
            field,
            at: self.at,
            needed,
            found,
        })?;
        self.rest = rest;
        self.at = self.at.saturating_add(needed);
        Ok(taken)
    }

    fn header(&mut self, first: Option<Layout>, limits: Limits) -> Result<Header, Error> {
        let at = self.at;
        let bytes = self.take(SEGMENT_HEADER_BYTES, Field::Frames)?;
        match bytes.first_chunk() {
            Some(bytes) => Header::read(bytes, at, first, limits),
            None => Err(Error::Truncated {
                field: Field::Frames,
                at,
                needed: SEGMENT_HEADER_BYTES,
                found: bytes.len(),
            }),
        }
    }

    fn segment(&mut self, header: Header) -> Result<Segment<'a>, Error> {
        let table = self.take(header.layout.table_bytes(), Field::Table)?;
        let (table, _) = table.as_chunks();
        let row_bytes = header.layout.row_bytes();
        // Saturates only where no memory could hold the rows.
        let rows_bytes = usize::try_from(header.rows).unwrap_or(usize::MAX).saturating_mul(row_bytes);
        let rows = self.take(rows_bytes, Field::Rows)?;
        Ok(Segment { table, rows })
    }
}

//! Plays a clip that lies in memory, frame by frame.

use super::clip::{Clip, Segment};
use super::row::{self, NARROW};
use crate::error::{Error, Field};
use crate::memory::front;
use fixed::types::I16F16;

/// A position in a clip, and the pose there. Made by [`Clip::decoder`].
///
/// A frame of `m` channels costs `FDF` conversions and `m − FDF` look-ups. The pose lives in the caller's memory.
#[derive(Debug)]
pub struct Decoder<'a, 's> {
    clip: Clip<'a>,
    pose: &'s mut [I16F16],
    table: Table<'a, 's>,
    /// The segment's rows that are still to come.
    rows: &'a [u8],
    /// What follows the segment.
    rest: &'a [u8],
    /// Bytes of a row.
    row_bytes: usize,
    position: u32,
}

/// The table of the segment that plays: as the file has it, or converted into the words that the caller lent. Where
/// an index has one byte, the compiler sees that there is an entry for each, and drops the check.
#[derive(Debug)]
enum Table<'a, 's> {
    NarrowFloats(&'a [[u8; 4]; NARROW]),
    NarrowWords(&'s mut [i32; NARROW]),
    /// For indices of two bytes; floats where no words were lent.
    Wide(&'a [[u8; 4]], Option<&'s mut [i32]>),
}

impl<'a> Table<'a, '_> {
    /// Takes a segment's floats.
    #[inline(never)]
    fn fill(&mut self, floats: &'a [[u8; 4]]) {
        let words = match self {
            Self::NarrowFloats(table) => {
                if let Some(floats) = floats.first_chunk() {
                    *table = floats;
                }
                return;
            }
            Self::NarrowWords(words) => words.as_mut_slice(),
            Self::Wide(table, words) => {
                *table = floats;
                words.as_deref_mut().unwrap_or_default()
            }
        };
        row::convert(floats, words);
    }
}

impl<'a> Clip<'a> {
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
}

impl<'a, 's> Decoder<'a, 's> {
    fn new(clip: Clip<'a>, pose: &'s mut [I16F16], table: Option<&'s mut [i32]>) -> Result<Self, Error> {
        let pose = front(pose, clip.channels(), Field::Pose)?;
        let (segment, rest) = clip.first_segment();
        let mut table = match (table, segment.table.first_chunk()) {
            (None, Some(floats)) if clip.table_len() == NARROW => Table::NarrowFloats(floats),
            (None, _) => Table::Wide(segment.table, None),
            (Some(words), _) if clip.table_len() == NARROW => {
                let lent = words.len();
                let small = Error::OutputTooSmall { field: Field::Table, needed: NARROW, lent };
                Table::NarrowWords(words.first_chunk_mut().ok_or(small)?)
            }
            (Some(words), _) => {
                Table::Wide(segment.table, Some(front(words, clip.table_len(), Field::Table)?))
            }
        };
        clip.initial_pose(pose);
        let row_bytes = clip.layout().row_bytes();
        table.fill(segment.table);
        Ok(Self { clip, pose, table, rows: segment.rows, rest, row_bytes, position: 0 })
    }

    /// Decodes the next frame and returns its pose, an element a channel; `None` after the last one.
    pub fn next_frame(&mut self) -> Option<&[I16F16]> {
        let (row, rows) = match self.rows.split_at_checked(self.row_bytes) {
            Some(split) => split,
            None => self.next_segment()?,
        };
        self.rows = rows;
        self.position = self.position.wrapping_add(1);
        let (looked_up, indices) = row::add_floats(self.clip.layout().fixed_channels, row, self.pose)?;
        match &self.table {
            Table::NarrowWords(words) => row::add_words(looked_up, indices, words),
            Table::NarrowFloats(table) => row::add_narrow_floats(looked_up, indices, table),
            Table::Wide(floats, words) => {
                let index_bits = self.clip.layout().index_bits;
                match words {
                    Some(words) => row::add_wide(looked_up, indices, index_bits, words),
                    None => row::add_wide_floats(looked_up, indices, index_bits, floats),
                }
            }
        }
        Some(self.pose)
    }

    /// Goes back to before the first frame.
    pub fn rewind(&mut self) {
        let (segment, rest) = self.clip.first_segment();
        self.enter(segment, rest);
        self.clip.initial_pose(self.pose);
        self.position = 0;
    }

    /// Decodes frame `frame` (0 is the first) and returns its pose; `None` where there is no such frame, which
    /// leaves the position as it was.
    ///
    /// A clip has one initial pose, so this decodes all frames in between, and from the start to go back.
    pub fn seek(&mut self, frame: u32) -> Option<&[I16F16]> {
        if frame >= self.clip.frames() {
            return None;
        }
        if frame < self.position {
            self.rewind();
        }
        while self.position < frame {
            self.next_frame()?;
        }
        self.next_frame()
    }

    /// Number of frames decoded since the start: the number of the frame that comes next.
    pub const fn position(&self) -> u32 {
        self.position
    }

    /// The clip.
    pub const fn clip(&self) -> &Clip<'a> {
        &self.clip
    }

    /// Goes on to the next segment: its first row, and the others. Out of the way of the frames that open none.
    #[cold]
    #[inline(never)]
    fn next_segment(&mut self) -> Option<(&'a [u8], &'a [u8])> {
        let (segment, rest) = self.clip.next_segment(self.rest)?;
        self.enter(segment, rest);
        segment.rows.split_at_checked(self.row_bytes)
    }

    fn enter(&mut self, segment: Segment<'a>, rest: &'a [u8]) {
        self.rows = segment.rows;
        self.rest = rest;
        self.table.fill(segment.table);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Limits;
    use crate::qmd::testing::{self, Random};
    use crate::testing::times;
    use std::vec::Vec;

    fn bits(pose: &[I16F16]) -> Vec<i32> {
        pose.iter().map(|value| value.to_bits()).collect()
    }

    #[test]
    fn frames_are_the_references_with_and_without_a_table() {
        for (seed, layout) in
            testing::layouts().into_iter().filter(testing::affordable).step_by(times(1, 6)).enumerate()
        {
            let bytes = testing::clip(layout, &[3, 1, 5], &mut Random::new(seed as u64));
            let clip = Clip::parse(&bytes, Limits::MAX).unwrap();
            let expected = testing::reference(&bytes);
            assert_eq!(clip.frames() as usize, expected.len());
            let mut table = std::vec![0; clip.table_len()];
            for table in [None, Some(table.as_mut_slice())] {
                let mut pose = std::vec![I16F16::ZERO; clip.channels()];
                let mut decoder = clip.decoder(&mut pose, table).unwrap();
                for frame in &expected {
                    assert_eq!(&bits(decoder.next_frame().unwrap()), frame, "{layout:?}");
                }
                assert!(decoder.next_frame().is_none());
            }
        }
    }

    #[test]
    fn seeking_gives_the_frame_that_playing_gives() {
        let mut random = Random::new(9);
        let layout = testing::layouts()[30];
        let bytes = testing::clip(layout, &[7, 4, 9], &mut random);
        let expected = testing::reference(&bytes);
        let clip = Clip::parse(&bytes, Limits::MAX).unwrap();
        let mut pose = std::vec![I16F16::ZERO; clip.channels()];
        let mut table = std::vec![0; clip.table_len()];
        let mut decoder = clip.decoder(&mut pose, Some(&mut table)).unwrap();
        for _ in 0..times(200, 2) {
            let frame = random.below(20);
            assert_eq!(&bits(decoder.seek(frame as u32).unwrap()), &expected[frame]);
            assert_eq!(decoder.position(), frame as u32 + 1);
            assert!(decoder.seek(20).is_none());
            assert_eq!(decoder.position(), frame as u32 + 1);
        }
    }
}

//! Plays a clip that lies in memory, frame by frame.

use super::clip::{Clip, Segment};
use super::row::{self, Table};
use super::segment::lent;
use crate::error::{Error, Field};
use fixed::types::I16F16;

/// A position in a clip, and the pose there. Made by [`Clip::decoder`].
///
/// A frame of `m` channels costs `FDF` conversions and `m − FDF` look-ups. The pose lives in the caller's memory.
#[derive(Debug)]
pub struct Decoder<'a, 's> {
    clip: Clip<'a>,
    pose: &'s mut [I16F16],
    words: Option<&'s mut [i32]>,
    segment: Segment<'a>,
    /// What follows the segment.
    rest: &'a [u8],
    position: u32,
}

impl<'a, 's> Decoder<'a, 's> {
    pub(super) fn new(
        clip: Clip<'a>,
        pose: &'s mut [I16F16],
        table: Option<&'s mut [i32]>,
    ) -> Result<Self, Error> {
        let pose = lent(pose, clip.channels(), Field::Pose)?;
        let words = match table {
            Some(table) => Some(lent(table, clip.table_len(), Field::Table)?),
            None => None,
        };
        let (segment, rest) = clip.first_segment();
        let mut decoder = Self { clip, pose, words, segment, rest, position: 0 };
        decoder.rewind();
        Ok(decoder)
    }

    /// Decodes the next frame and returns its pose, an element a channel; `None` after the last one.
    pub fn next_frame(&mut self) -> Option<&[I16F16]> {
        if self.segment.rows.is_empty() {
            let (segment, rest) = self.clip.next_segment(self.rest)?;
            self.enter(segment, rest);
        }
        let layout = self.clip.layout();
        let (row, rows) = self.segment.rows.split_at_checked(layout.row_bytes())?;
        self.segment.rows = rows;
        let table = match &self.words {
            Some(words) => Table::Words(words),
            None => Table::Floats(self.segment.table),
        };
        row::add(layout, row, table, self.pose);
        self.position = self.position.wrapping_add(1);
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

    fn enter(&mut self, segment: Segment<'a>, rest: &'a [u8]) {
        self.segment = segment;
        self.rest = rest;
        if let Some(words) = &mut self.words {
            row::convert(segment.table, words);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Limits;
    use crate::qmd::testing::{self, Random};
    use std::vec::Vec;

    fn bits(pose: &[I16F16]) -> Vec<i32> {
        pose.iter().map(|value| value.to_bits()).collect()
    }

    #[test]
    fn frames_are_the_references_with_and_without_a_table() {
        for (seed, layout) in testing::layouts().into_iter().enumerate() {
            let bytes = testing::clip(layout, &[3, 1, 5], &mut Random(seed as u64));
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
        let mut random = Random(9);
        let layout = testing::layouts()[30];
        let bytes = testing::clip(layout, &[7, 4, 9], &mut random);
        let expected = testing::reference(&bytes);
        let clip = Clip::parse(&bytes, Limits::MAX).unwrap();
        let mut pose = std::vec![I16F16::ZERO; clip.channels()];
        let mut table = std::vec![0; clip.table_len()];
        let mut decoder = clip.decoder(&mut pose, Some(&mut table)).unwrap();
        for _ in 0..200 {
            let frame = random.below(20);
            assert_eq!(&bits(decoder.seek(frame as u32).unwrap()), &expected[frame]);
            assert_eq!(decoder.position(), frame as u32 + 1);
            assert!(decoder.seek(20).is_none());
            assert_eq!(decoder.position(), frame as u32 + 1);
        }
    }
}

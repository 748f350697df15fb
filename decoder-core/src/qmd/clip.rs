//! A clip that lies in memory: parsed once, read in place.

use super::segment::{Header, Layout, SEGMENT_HEADER_BYTES, add_frames, check_level};
use crate::error::{Error, Field, Limits};
use crate::word::fixed_from_f32_bits;
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
        // Before what follows the header, as a stream does, so that both name the same of two errors.
        let mut frames = add_frames(0, header.rows, limits)?;
        let channels = usize::from(layout.channels);
        let levels_at = cursor.at;
        let levels = cursor.take(channels, Field::Level)?;
        for (offset, &level) in levels.iter().enumerate() {
            check_level(level, levels_at.saturating_add(offset))?;
        }
        let pose = cursor.take(channels.saturating_mul(4), Field::Pose)?;
        let first = cursor.segment(header)?;
        let mut segments = 1u32;
        let rest = cursor.rest;
        while !cursor.rest.is_empty() {
            let header = cursor.header(Some(layout), limits)?;
            frames = add_frames(frames, header.rows, limits)?;
            cursor.segment(header)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qmd::testing::{self, Random};
    use crate::testing::{stride, times};
    use std::vec;

    const SMALL: Layout = Layout { channels: 3, rate_centihertz: 12000, fixed_channels: 1, index_bits: 8 };

    fn decode_all(bytes: &[u8]) -> Result<u32, Error> {
        let clip = Clip::parse(bytes, Limits { channels: 64, frames: 1000 })?;
        let mut pose = vec![I16F16::ZERO; clip.channels()];
        let mut table = vec![0; clip.table_len()];
        let frames = clip.frames();
        let mut decoder = clip.decoder(&mut pose, None)?;
        let mut count = 0;
        while decoder.next_frame().is_some() {
            count += 1;
        }
        assert_eq!(count, frames);
        let mut decoder = clip.decoder(&mut pose, Some(&mut table))?;
        assert!(decoder.seek(frames - 1).is_some());
        assert!(decoder.next_frame().is_none());
        Ok(frames)
    }

    #[test]
    fn the_size_is_the_papers() {
        // 1037 + 5m + n(4 FDF + m − FDF) for FDF = 6, b = 8 and one segment: Table 1 prints 11.9 KiB for the jog
        // of 136 frames, 28.1 for the walk of 343, 177.2 for the sword play of 2251.
        let layout = Layout { channels: 62, rate_centihertz: 0, fixed_channels: 6, index_bits: 8 };
        for (frames, tenths_of_kib) in [(136, 119), (343, 281), (2251, 1772)].into_iter().step_by(stride(3)) {
            let bytes = testing::clip(layout, &[frames], &mut Random::new(1));
            assert_eq!(bytes.len(), 1037 + 5 * 62 + frames as usize * (4 * 6 + 62 - 6));
            assert_eq!((bytes.len() as f64 / 102.4).round() as u32, tenths_of_kib);
            assert_eq!(Clip::parse(&bytes, Limits::MAX).unwrap().frames(), frames);
        }
    }

    #[test]
    fn fields_are_read_where_they_are_written() {
        let bytes = testing::clip(SMALL, &[2, 5], &mut Random::new(2));
        let clip = Clip::parse(&bytes, Limits::MAX).unwrap();
        assert_eq!(clip.layout(), SMALL);
        assert_eq!((clip.frames(), clip.segments(), clip.table_len()), (7, 2, 256));
        assert_eq!(clip.levels(), &bytes[13..16]);
    }

    #[test]
    fn every_truncation_is_an_error_unless_a_segment_ends_there() {
        let bytes = testing::clip(SMALL, &[4, 3], &mut Random::new(3));
        let first =
            SEGMENT_HEADER_BYTES + SMALL.opening_bytes() + SMALL.table_bytes() + 4 * SMALL.row_bytes();
        for len in (0..bytes.len()).step_by(stride(41)) {
            match decode_all(&bytes[..len]) {
                Ok(frames) => assert_eq!((len, frames), (first, 4)),
                Err(Error::Truncated { at, needed, found, .. }) => {
                    assert_eq!(at + found, len);
                    assert!(found < needed);
                }
                Err(other) => panic!("{len}: {other}"),
            }
        }
    }

    #[test]
    fn every_bit_flip_is_decoded_or_refused() {
        let bytes = testing::clip(SMALL, &[4, 3], &mut Random::new(4));
        let mut refused = 0;
        for bit in (0..bytes.len() * 8).step_by(stride(397)) {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            refused += u32::from(decode_all(&flipped).is_err());
        }
        // Nearly all of both headers: all bits but those of the first rate, and of a level that stays above 0.
        assert!(cfg!(miri) || refused > 100, "{refused}");
    }

    #[test]
    fn random_bytes_are_refused() {
        let mut random = Random::new(5);
        for _ in 0..times(20_000, 20) {
            let len = random.below(2000);
            let bytes: Vec<u8> = (0..len).map(|_| random.next() as u8).collect();
            assert!(decode_all(&bytes).is_err());
        }
    }

    #[test]
    fn limits_hold() {
        let bytes = testing::clip(SMALL, &[4, 3], &mut Random::new(6));
        assert_eq!(
            Clip::parse(&bytes, Limits { channels: 2, frames: 10 }).unwrap_err(),
            Error::Limit { field: Field::Channels, found: 3, limit: 2 }
        );
        assert_eq!(
            Clip::parse(&bytes, Limits { channels: 3, frames: 6 }).unwrap_err(),
            Error::Limit { field: Field::Frames, found: 7, limit: 6 }
        );
        let clip = Clip::parse(&bytes, Limits { channels: 3, frames: 7 }).unwrap();
        assert_eq!(
            clip.decoder(&mut [I16F16::ZERO; 2], None).unwrap_err(),
            Error::OutputTooSmall { field: Field::Pose, needed: 3, lent: 2 }
        );
        assert_eq!(
            clip.decoder(&mut [I16F16::ZERO; 3], Some(&mut [0; 255])).unwrap_err(),
            Error::OutputTooSmall { field: Field::Table, needed: 256, lent: 255 }
        );
    }

    #[test]
    fn values_that_no_encoder_writes_are_refused_where_they_are() {
        let sound = testing::clip(SMALL, &[4, 3], &mut Random::new(8));
        for (field, at, value, found, low, high) in [
            (Field::Frames, 0, &[0; 4][..], 0, 1, u32::MAX),
            (Field::Channels, 4, &[0, 0], 0, 1, 65535),
            (Field::FixedChannels, 8, &[4, 0, 0, 0], 4, 0, 3),
            (Field::FixedChannels, 8, &[1, 0, 1, 0], 0x1_0001, 0, 3),
            (Field::IndexBits, 12, &[7], 7, 8, 16),
            (Field::IndexBits, 12, &[17], 17, 8, 16),
            (Field::Level, 13, &[0], 0, 1, 255),
            (Field::Level, 15, &[0], 0, 1, 255),
        ] {
            let mut bytes = sound.clone();
            bytes[at..at + value.len()].copy_from_slice(value);
            let error = Error::Malformed { field, at, found, low, high };
            assert_eq!(Clip::parse(&bytes, Limits::MAX).unwrap_err(), error);
        }
    }

    #[test]
    fn a_later_segment_must_repeat_the_layout() {
        let mut bytes = testing::clip(SMALL, &[1, 1], &mut Random::new(7));
        let second = bytes.len() - SEGMENT_HEADER_BYTES - SMALL.table_bytes() - SMALL.row_bytes();
        bytes[second + 12] = 9;
        assert_eq!(
            Clip::parse(&bytes, Limits::MAX).unwrap_err(),
            Error::Malformed { field: Field::IndexBits, at: second + 12, found: 9, low: 8, high: 8 }
        );
    }
}

//! Plays a clip that arrives in chunks of any size (paper, section 4).
//!
//! The bytes are those of the file, in its order: pose, table, rows, and so on. A unit (a header, a float, a row)
//! that lies whole in a chunk is read there; one that is split between chunks is put together in the caller's
//! buffer. Frames and errors are the same for every way to cut the bytes into chunks.

use super::row;
use super::segment::{Header, Layout, SEGMENT_HEADER_BYTES, add_frames, check_level};
use crate::error::{Error, Field, Limits};
use crate::memory::front;
use crate::word::fixed_from_f32_bits;
use fixed::types::I16F16;

/// A clip that is being received.
#[derive(Debug)]
pub struct Stream<'s> {
    limits: Limits,
    pose: &'s mut [I16F16],
    words: &'s mut [i32],
    unit: Unit<'s>,
    expect: Expect,
    layout: Option<Layout>,
    /// Rows of the segment that are still to come.
    rows: u32,
    frames: u32,
    /// Bytes of the clip before the unit.
    at: usize,
}

/// The next unit of the file.
#[derive(Clone, Copy, Debug)]
enum Expect {
    Header,
    Level { channel: usize },
    Pose { channel: usize },
    Entry { index: usize },
    Row,
    Nothing { because: Error },
}

impl<'s> Stream<'s> {
    /// A stream before its first byte.
    ///
    /// `pose` takes an element a channel, `table` `2^b` words. `buffer` takes a row, `4 FDF + ⌈b/8⌉ (m − FDF)`
    /// bytes, and at least [`SEGMENT_HEADER_BYTES`]. How much of each a clip needs is known with its header;
    /// [`next_frame`](Self::next_frame) says so if it is more than was lent.
    pub const fn new(
        limits: Limits,
        pose: &'s mut [I16F16],
        table: &'s mut [i32],
        buffer: &'s mut [u8],
    ) -> Self {
        Self {
            limits,
            pose,
            words: table,
            unit: Unit { buffer, filled: 0 },
            expect: Expect::Header,
            layout: None,
            rows: 0,
            frames: 0,
            at: 0,
        }
    }

    /// Takes bytes off the front of `chunk` until a frame is whole, and returns its pose; `None` once all
    /// of `chunk` was taken.
    ///
    /// # Errors
    /// As [`Clip::parse`](super::Clip::parse), at the same byte, and [`Error::OutputTooSmall`] where the clip
    /// needs more memory than was lent. After an error the stream takes no more and repeats it.
    pub fn next_frame(&mut self, chunk: &mut &[u8]) -> Result<Option<&[I16F16]>, Error> {
        loop {
            match self.step(chunk) {
                Ok(Step::Unit) => {}
                Ok(Step::Starved) => return Ok(None),
                Ok(Step::Frame { channels }) => return Ok(self.pose.get(..channels)),
                Err(because) => {
                    self.expect = Expect::Nothing { because };
                    return Err(because);
                }
            }
        }
    }

    /// Frames so far.
    pub const fn frames(&self) -> u32 {
        self.frames
    }

    /// The shape of the clip's rows and tables, once its header is there.
    pub const fn layout(&self) -> Option<Layout> {
        self.layout
    }

    /// Says whether the bytes so far are a whole clip. A clip does not say how many segments it has, so only
    /// the sender knows its end.
    ///
    /// # Errors
    /// [`Error::Truncated`] where a segment is not whole, or the stream's earlier error.
    pub const fn finish(&self) -> Result<(), Error> {
        let (field, needed) = match self.expect {
            Expect::Nothing { because } => return Err(because),
            Expect::Header if self.unit.filled == 0 && self.frames > 0 => return Ok(()),
            Expect::Header => (Field::Frames, SEGMENT_HEADER_BYTES),
            Expect::Level { .. } => (Field::Level, 1),
            Expect::Pose { .. } => (Field::Pose, 4),
            Expect::Entry { .. } => (Field::Table, 4),
            Expect::Row => (Field::Rows, row_bytes(self.layout)),
        };
        Err(Error::Truncated { field, at: self.at, needed, found: self.unit.filled })
    }

    fn unit_bytes(&self) -> Result<usize, Error> {
        Ok(match self.expect {
            Expect::Header => SEGMENT_HEADER_BYTES,
            Expect::Level { .. } => 1,
            Expect::Pose { .. } | Expect::Entry { .. } => 4,
            Expect::Row => row_bytes(self.layout),
            Expect::Nothing { because } => return Err(because),
        })
    }

    /// Takes the next unit, if all of it is there.
    fn step(&mut self, chunk: &mut &[u8]) -> Result<Step, Error> {
        let needed = self.unit_bytes()?;
        let Some(unit) = self.unit.fill(chunk, needed)? else {
            return Ok(Step::Starved);
        };
        let mut step = Step::Unit;
        let read = match self.expect {
            Expect::Header => match unit.first_chunk() {
                Some(bytes) => Read::Header(Header::read(bytes, self.at, self.layout, self.limits)?),
                None => return Ok(Step::Starved),
            },
            Expect::Level { channel } => {
                check_level(unit.first().copied().unwrap_or(0), self.at)?;
                Read::Level { channel }
            }
            Expect::Pose { channel } => Read::Pose { channel, value: float(unit) },
            Expect::Entry { index } => Read::Entry { index, value: float(unit) },
            Expect::Row => {
                if let Some(layout) = self.layout {
                    let channels = usize::from(layout.channels);
                    let pose = front(self.pose, channels, Field::Pose)?;
                    if let Some((values, indices)) = row::add_floats(layout.fixed_channels, unit, pose) {
                        match self.words.first_chunk() {
                            Some(words) if layout.index_bits == 8 => row::add_words(values, indices, words),
                            _ => row::add_wide(values, indices, layout.index_bits, self.words),
                        }
                    }
                    step = Step::Frame { channels };
                }
                Read::Row
            }
            Expect::Nothing { because } => return Err(because),
        };
        self.expect = self.apply(read)?;
        self.at = self.at.saturating_add(needed);
        Ok(step)
    }

    /// Takes in what a unit said, and says which unit comes next.
    fn apply(&mut self, read: Read) -> Result<Expect, Error> {
        match read {
            Read::Header(header) => {
                let layout = header.layout;
                self.rows = header.rows;
                add_frames(self.frames, header.rows, self.limits)?;
                front(self.pose, usize::from(layout.channels), Field::Pose)?;
                front(self.words, layout.table_len(), Field::Table)?;
                front(self.unit.buffer, layout.row_bytes(), Field::Rows)?;
                Ok(match self.layout.replace(layout) {
                    None => Expect::Level { channel: 0 },
                    Some(_) => Expect::Entry { index: 0 },
                })
            }
            Read::Row => {
                self.frames = self.frames.saturating_add(1);
                self.rows = self.rows.saturating_sub(1);
                Ok(if self.rows == 0 { Expect::Header } else { Expect::Row })
            }
            Read::Level { channel } => Ok(match self.following(channel, Field::Level) {
                Some(channel) => Expect::Level { channel },
                None => Expect::Pose { channel: 0 },
            }),
            Read::Pose { channel, value } => {
                if let Some(slot) = self.pose.get_mut(channel) {
                    *slot = I16F16::from_bits(value);
                }
                Ok(match self.following(channel, Field::Pose) {
                    Some(channel) => Expect::Pose { channel },
                    None => Expect::Entry { index: 0 },
                })
            }
            Read::Entry { index, value } => {
                if let Some(slot) = self.words.get_mut(index) {
                    *slot = value;
                }
                Ok(match self.following(index, Field::Table) {
                    Some(index) => Expect::Entry { index },
                    None => Expect::Row,
                })
            }
        }
    }

    /// The number after `index` in a field that has one unit a channel, or a table entry; `None` at its end.
    fn following(&self, index: usize, field: Field) -> Option<usize> {
        let layout = self.layout?;
        let count = match field {
            Field::Table => layout.table_len(),
            _ => usize::from(layout.channels),
        };
        let next = index.saturating_add(1);
        (next < count).then_some(next)
    }
}

/// What came of one call of [`Stream::step`].
enum Step {
    /// A unit that is no frame.
    Unit,
    /// A frame of so many channels.
    Frame { channels: usize },
    /// The chunk ended before the unit did.
    Starved,
}

/// What a unit said. A row is added where its bytes are borrowed, so it says no more than that it was there.
#[derive(Clone, Copy)]
enum Read {
    Row,
    Header(Header),
    Level { channel: usize },
    Pose { channel: usize, value: i32 },
    Entry { index: usize, value: i32 },
}

const fn row_bytes(layout: Option<Layout>) -> usize {
    match layout {
        Some(layout) => layout.row_bytes(),
        None => 0,
    }
}

fn float(unit: &[u8]) -> i32 {
    unit.first_chunk().map_or(0, |&bytes| fixed_from_f32_bits(u32::from_le_bytes(bytes)))
}

/// The bytes of a unit that is split between chunks.
#[derive(Debug)]
struct Unit<'s> {
    buffer: &'s mut [u8],
    filled: usize,
}

impl Unit<'_> {
    /// Takes bytes off `chunk` until the unit has `needed` of them; `None` while it has fewer.
    fn fill<'u, 'c: 'u>(
        &'u mut self,
        chunk: &mut &'c [u8],
        needed: usize,
    ) -> Result<Option<&'u [u8]>, Error> {
        if self.filled == 0
            && let Some((unit, rest)) = chunk.split_at_checked(needed)
        {
            *chunk = rest;
            return Ok(Some(unit));
        }
        let lent = self.buffer.len();
        let space = self.buffer.get_mut(self.filled..needed).ok_or(Error::OutputTooSmall {
            field: Field::Rows,
            needed,
            lent,
        })?;
        let count = space.len().min(chunk.len());
        let Some((taken, rest)) = chunk.split_at_checked(count) else {
            return Ok(None);
        };
        for (slot, &byte) in space.iter_mut().zip(taken) {
            *slot = byte;
        }
        *chunk = rest;
        self.filled = self.filled.saturating_add(count);
        if self.filled < needed {
            return Ok(None);
        }
        self.filled = 0;
        Ok(self.buffer.get(..needed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qmd::testing::{self, Random};
    use crate::qmd::{Clip, MAX_INDEX_BITS};
    use crate::testing::stride;
    use std::vec;
    use std::vec::Vec;

    /// All frames of a stream that is cut where `cut` says, and how it ended.
    fn play(
        bytes: &[u8],
        limits: Limits,
        mut cut: impl FnMut() -> usize,
    ) -> (Vec<Vec<i32>>, Result<(), Error>) {
        let mut pose = vec![I16F16::ZERO; 300];
        let mut table = vec![0; 1 << MAX_INDEX_BITS];
        let mut buffer = vec![0xaa; 1200];
        let mut stream = Stream::new(limits, &mut pose, &mut table, &mut buffer);
        let mut frames = Vec::new();
        let mut rest = bytes;
        while !rest.is_empty() {
            let (mut chunk, after) = rest.split_at(cut().min(rest.len()));
            rest = after;
            loop {
                match stream.next_frame(&mut chunk) {
                    Ok(Some(pose)) => frames.push(pose.iter().map(|value| value.to_bits()).collect()),
                    Ok(None) => break,
                    Err(error) => {
                        assert_eq!(stream.next_frame(&mut chunk), Err(error), "an error is repeated");
                        return (frames, Err(error));
                    }
                }
            }
            assert!(chunk.is_empty());
        }
        assert_eq!(stream.frames() as usize, frames.len());
        (frames, stream.finish())
    }

    #[test]
    fn any_chunking_gives_the_frames_of_the_clip_in_memory() {
        let mut random = Random::new(11);
        for layout in testing::layouts().into_iter().filter(testing::affordable).step_by(stride(6)) {
            let bytes = testing::clip(layout, &[2, 3], &mut random);
            let expected = testing::reference(&bytes);
            for size in [1, 2, 3, 5, 13, 64, 1021, usize::MAX].into_iter().step_by(stride(8)) {
                let (frames, end) = play(&bytes, Limits::MAX, || size);
                assert_eq!((frames.as_slice(), end), (expected.as_slice(), Ok(())), "{layout:?} by {size}");
            }
            let (frames, end) = play(&bytes, Limits::MAX, || 1 + random.below(200));
            assert_eq!((frames.as_slice(), end), (expected.as_slice(), Ok(())), "{layout:?}");
        }
    }

    #[test]
    fn damage_is_found_at_the_byte_where_parse_finds_it() {
        let mut random = Random::new(12);
        let layout = testing::layouts()[18];
        let sound = testing::clip(layout, &[2, 3], &mut random);
        let limits = Limits { channels: 3, frames: 5 };
        let mut refused = 0;
        for bit in (0..sound.len() * 8).step_by(stride(1201)) {
            let mut bytes = sound.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let whole = Clip::parse(&bytes, limits).map(|clip| clip.frames());
            let (frames, end) = play(&bytes, limits, || 7);
            match whole {
                Ok(count) => assert_eq!((frames.len(), end), (count as usize, Ok(()))),
                // A whole field is missing there, a unit of it here.
                Err(Error::Truncated { .. }) => assert!(end.is_err()),
                Err(error) => assert_eq!(end, Err(error)),
            }
            refused += u32::from(end.is_err());
        }
        assert!(cfg!(miri) || refused > 100, "{refused}");
    }

    #[test]
    fn of_two_errors_both_name_the_first() {
        let mut bytes = testing::clip(testing::layouts()[18], &[2, 3], &mut Random::new(15));
        bytes[SEGMENT_HEADER_BYTES] = 0;
        let limits = Limits { channels: 3, frames: 1 };
        let error = Error::Limit { field: Field::Frames, found: 2, limit: 1 };
        assert_eq!(Clip::parse(&bytes, limits).unwrap_err(), error);
        assert_eq!(play(&bytes, limits, || 7).1, Err(error));
    }

    #[test]
    fn every_truncation_is_told_at_the_end() {
        let bytes = testing::clip(testing::layouts()[18], &[2, 3], &mut Random::new(13));
        for len in (0..bytes.len()).step_by(stride(97)) {
            let (_, end) = play(&bytes[..len], Limits::MAX, || 19);
            assert_eq!(end.is_ok(), Clip::parse(&bytes[..len], Limits::MAX).is_ok(), "{len}");
        }
    }

    #[test]
    fn memory_that_is_too_small_is_told_with_the_size_that_is_needed() {
        let layout = Layout { channels: 62, rate_centihertz: 0, fixed_channels: 6, index_bits: 9 };
        let bytes = testing::clip(layout, &[1], &mut Random::new(14));
        let row = 4 * 6 + 2 * 56;
        for (pose, table, buffer, error) in [
            (61, 512, row, Error::OutputTooSmall { field: Field::Pose, needed: 62, lent: 61 }),
            (62, 511, row, Error::OutputTooSmall { field: Field::Table, needed: 512, lent: 511 }),
            (62, 512, row - 1, Error::OutputTooSmall { field: Field::Rows, needed: row, lent: row - 1 }),
        ] {
            let mut pose = vec![I16F16::ZERO; pose];
            let mut table = vec![0; table];
            let mut buffer = vec![0; buffer];
            let mut stream = Stream::new(Limits::MAX, &mut pose, &mut table, &mut buffer);
            assert_eq!(stream.next_frame(&mut bytes.as_slice()), Err(error));
        }
    }
}

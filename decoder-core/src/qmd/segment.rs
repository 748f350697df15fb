//! The header of a segment, and the sizes that follow from it (paper, section 5.1, equations 2 and 3).

use crate::error::{Error, Field, Limits};

/// Bytes of a segment's header before its table: three 4-byte integers and a byte (equation 2).
pub const SEGMENT_HEADER_BYTES: usize = 13;

/// Fewest bits of an index (section 5.1).
pub const MIN_INDEX_BITS: u8 = 8;

/// Most bits of an index (section 5.1).
pub const MAX_INDEX_BITS: u8 = 16;

const CHANNELS_AT: usize = 4;
const RATE_AT: usize = 6;
const FIXED_CHANNELS_AT: usize = 8;
const INDEX_BITS_AT: usize = 12;

/// What all segments of a clip share: the shape of a row and of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Channels in a frame (`m`), 1 to 65535.
    pub channels: u16,
    /// Frames per second in hundredths; 0 where it was not recorded.
    pub rate_centihertz: u16,
    /// Leading channels that hold floats (`FDF`), 0 to `channels`.
    pub fixed_channels: u16,
    /// Bits of an index (`b`), 8 to 16.
    pub index_bits: u8,
}

impl Layout {
    /// Entries of a table: `2^b`.
    pub const fn table_len(self) -> usize {
        1usize.wrapping_shl(self.index_bits as u32)
    }

    /// Bytes of a table.
    pub const fn table_bytes(self) -> usize {
        self.table_len().wrapping_mul(4)
    }

    /// Bytes of an index: 1 for 8 bits, 2 for more (`⌈b/8⌉`).
    pub const fn index_bytes(self) -> usize {
        if self.index_bits > 8 { 2 } else { 1 }
    }

    /// Bytes of a row: `4 FDF + ⌈b/8⌉ (m − FDF)`, at most 262,140 (equation 3).
    pub const fn row_bytes(self) -> usize {
        let indices = (self.channels as usize).saturating_sub(self.fixed_channels as usize);
        (self.fixed_channels as usize).wrapping_mul(4).wrapping_add(self.index_bytes().wrapping_mul(indices))
    }

    /// Bytes that only the first segment has: one level and one float a channel.
    pub const fn opening_bytes(self) -> usize {
        (self.channels as usize).wrapping_mul(5)
    }
}

/// A segment's header: its number of rows, and the layout.
#[derive(Clone, Copy, Debug)]
pub(super) struct Header {
    pub rows: u32,
    pub layout: Layout,
}

impl Header {
    /// Reads and checks a header that starts at byte `at` of the clip. `first` is the layout of the first
    /// segment, which the others repeat.
    pub fn read(
        bytes: &[u8; SEGMENT_HEADER_BYTES],
        at: usize,
        first: Option<Layout>,
        limits: Limits,
    ) -> Result<Self, Error> {
        let [n0, n1, n2, n3, m0, m1, r0, r1, f0, f1, f2, f3, index_bits] = *bytes;
        let rows = u32::from_le_bytes([n0, n1, n2, n3]);
        let channels = u16::from_le_bytes([m0, m1]);
        let rate_centihertz = u16::from_le_bytes([r0, r1]);
        let fixed_channels = u32::from_le_bytes([f0, f1, f2, f3]);

        // A later segment's layout is the first one's: the range is that one value.
        let range = |low: u32, high: u32, same: fn(Layout) -> u32| match first {
            Some(layout) => (same(layout), same(layout)),
            None => (low, high),
        };
        let check = |field, offset, found, (low, high): (u32, u32)| {
            if found < low || found > high {
                let at = usize::saturating_add(at, offset);
                return Err(Error::Malformed { field, at, found, low, high });
            }
            Ok(())
        };
        check(Field::Frames, 0, rows, (1, u32::MAX))?;
        let any_channels = range(1, u32::from(u16::MAX), |layout| u32::from(layout.channels));
        check(Field::Channels, CHANNELS_AT, u32::from(channels), any_channels)?;
        let any_rate = range(0, u32::from(u16::MAX), |layout| u32::from(layout.rate_centihertz));
        check(Field::Rate, RATE_AT, u32::from(rate_centihertz), any_rate)?;
        let any_fixed = range(0, u32::from(channels), |layout| u32::from(layout.fixed_channels));
        check(Field::FixedChannels, FIXED_CHANNELS_AT, fixed_channels, any_fixed)?;
        let any_bits = range(u32::from(MIN_INDEX_BITS), u32::from(MAX_INDEX_BITS), |layout| {
            u32::from(layout.index_bits)
        });
        check(Field::IndexBits, INDEX_BITS_AT, u32::from(index_bits), any_bits)?;

        if channels > limits.channels {
            return Err(Error::Limit {
                field: Field::Channels,
                found: u32::from(channels),
                limit: u32::from(limits.channels),
            });
        }
        // At most `channels`, so it fits.
        let fixed_channels = fixed_channels as u16;
        Ok(Self { rows, layout: Layout { channels, rate_centihertz, fixed_channels, index_bits } })
    }
}

/// Adds a segment's rows to the frames before it, up to the caller's limit.
pub(super) fn add_frames(frames: u32, rows: u32, limits: Limits) -> Result<u32, Error> {
    let sum = frames.saturating_add(rows);
    if sum > limits.frames {
        return Err(Error::Limit { field: Field::Frames, found: sum, limit: limits.frames });
    }
    Ok(sum)
}

/// Checks the level of one channel, the byte at `at`.
pub(super) fn check_level(level: u8, at: usize) -> Result<(), Error> {
    if level == 0 {
        return Err(Error::Malformed { field: Field::Level, at, found: 0, low: 1, high: 255 });
    }
    Ok(())
}

//! The header of a clip: a prefix of fixed size, then postcard structures that are borrowed in place.

use super::codec::{Codec, CodecId, EntropyId};
use super::cursor::Cursor;
use super::engine::Needs;
use crate::entropy::huffman::Shape;
use crate::entropy::{AdaptiveHuffman, adaptive_huffman};
use crate::error::{Error, Field, Limits};
use crate::quantise::MAX_BITS;
use crate::quantise::step::MAX_STEP;
use crate::quantise::uniform::MAX_EXPONENT;
use crc::{CRC_32_ISO_HDLC, Crc};
use serde::Serialize;

/// The first bytes of a file.
pub const MAGIC: [u8; 4] = *b"MCLP";

/// The version of the format that this decoder reads.
pub const VERSION: u16 = 1;

/// Bytes before the header: magic, version, two zero bytes, length of the header.
pub const PREFIX_BYTES: usize = 12;

/// Bytes of a checksum.
const CHECKSUM_BYTES: usize = 4;

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// The CRC-32 (ISO-HDLC: that of zlib and PNG) of two slices, one after the other.
pub fn checksum(first: &[u8], second: &[u8]) -> u32 {
    let mut digest = CRC.digest();
    digest.update(first);
    digest.update(second);
    digest.finalize()
}

/// What the first bytes of a file say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Prefix {
    /// Bytes of prefix, header and checksum together: where the blocks start.
    pub header_bytes: usize,
}

impl Prefix {
    /// Reads and checks the prefix.
    ///
    /// # Errors
    /// [`Error::Truncated`], [`Error::Malformed`] where these are no clip's bytes, [`Error::Unsupported`] where
    /// the version is another.
    pub fn read(bytes: &[u8]) -> Result<Self, Error> {
        let Some(&[m0, m1, m2, m3, v0, v1, z0, z1, l0, l1, l2, l3]) = bytes.first_chunk::<PREFIX_BYTES>()
        else {
            return Err(Error::Truncated {
                field: Field::Header,
                at: 0,
                needed: PREFIX_BYTES,
                found: bytes.len(),
            });
        };
        if [m0, m1, m2, m3] != MAGIC {
            let expected = u32::from_le_bytes(MAGIC);
            let found = u32::from_le_bytes([m0, m1, m2, m3]);
            return Err(Error::Malformed {
                field: Field::Magic,
                at: 0,
                found,
                low: expected,
                high: expected,
            });
        }
        let version = u16::from_le_bytes([v0, v1]);
        if version != VERSION {
            return Err(Error::Unsupported { field: Field::Version, found: version.into() });
        }
        let zero = u32::from(u16::from_le_bytes([z0, z1]));
        if zero != 0 {
            return Err(Error::Malformed { field: Field::Version, at: 6, found: zero, low: 0, high: 0 });
        }
        let length = u32::from_le_bytes([l0, l1, l2, l3]);
        let around = PREFIX_BYTES.saturating_add(CHECKSUM_BYTES);
        let header_bytes = usize::try_from(length).unwrap_or(usize::MAX).saturating_add(around);
        Ok(Self { header_bytes })
    }
}

/// The header's first structure, as it is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Opening<'a> {
    /// Frames per second are this …
    pub rate_numerator: u32,
    /// … over this.
    pub rate_denominator: u32,
    /// Frames in the clip, 1 to 2³¹ − 1.
    pub frames: u32,
    /// Channels in a frame, at least 1.
    pub channels: u16,
    /// Bytes of the longest block's codes.
    pub block_bytes: u16,
    /// Bytes of memory that a decoder needs: [`Needs::bytes`].
    pub ram: u32,
    /// Frames that a decoder must have received beyond the one that it gives.
    pub delay: u16,
    /// The codec ([`CodecId`]).
    pub codec: u8,
    /// The entropy stage ([`EntropyId`]).
    pub entropy: u8,
    /// The codec's parameters.
    pub parameters: &'a [u8],
    /// The entropy stage's tables.
    pub tables: &'a [u8],
    /// Certified worst-case cycles of a frame: 5 bytes a core, its number and 4 bytes of cycles.
    pub cycles: &'a [u8],
}

impl<'a> Opening<'a> {
    fn read(cursor: &mut Cursor<'a>) -> Result<Self, Error> {
        Ok(Self {
            rate_numerator: cursor.u32(Field::Rate)?,
            rate_denominator: cursor.u32(Field::Rate)?,
            frames: cursor.u32(Field::Frames)?,
            channels: cursor.u16(Field::Channels)?,
            block_bytes: cursor.u16(Field::BlockLength)?,
            ram: cursor.u32(Field::Ram)?,
            delay: cursor.u16(Field::Delay)?,
            codec: cursor.u8(Field::Codec)?,
            entropy: cursor.u8(Field::Entropy)?,
            parameters: cursor.bytes(Field::Parameters)?,
            tables: cursor.bytes(Field::CodeTables)?,
            cycles: cursor.bytes(Field::Cycles)?,
        })
    }
}

/// A channel, as it is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Channel<'a> {
    /// Its name, for instance `rradius.rx`.
    pub name: &'a str,
    /// Its unit ([`Unit`]).
    pub unit: u8,
    /// Its lowest value, a word.
    pub low: i32,
    /// Its highest value, a word, not below `low`.
    pub high: i32,
    /// Places by which its values are shifted at an entry point, 0 to 31.
    pub entry_shift: u8,
    /// Bits of a code, 0 to 16; with 0, the channel keeps its value from one entry point to the next.
    pub bits: u8,
    /// Index of its step, or of its first step where it adapts; pcm: the exponent of Δ.
    pub step: u8,
    /// Its group of code tables.
    pub group: u8,
    /// Coefficients of its predictor in 16384ths; pcm: the first is the mantissa of Δ.
    pub coefficients: [i16; 2],
}

impl<'a> Channel<'a> {
    fn read(cursor: &mut Cursor<'a>) -> Result<Self, Error> {
        let name = cursor.str(Field::Channel)?;
        Self::read_unnamed(cursor, name)
    }

    /// Reads what follows the name.
    fn read_unnamed(cursor: &mut Cursor<'a>, name: &'a str) -> Result<Self, Error> {
        let field = Field::Channel;
        Ok(Self {
            name,
            unit: cursor.u8(field)?,
            low: cursor.i32(field)?,
            high: cursor.i32(field)?,
            entry_shift: cursor.u8(field)?,
            bits: cursor.u8(field)?,
            step: cursor.u8(field)?,
            group: cursor.u8(field)?,
            coefficients: [cursor.i16(field)?, cursor.i16(field)?],
        })
    }

    /// Bits of the channel's value at an entry point.
    pub const fn entry_bits(&self) -> u32 {
        32u32.saturating_sub((self.low.abs_diff(self.high) >> (self.entry_shift & 31)).leading_zeros())
    }
}

/// What a channel's values are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A rotation, in degrees.
    Degrees,
    /// A length, in centimetres.
    Centimetres,
}

impl Unit {
    /// Its number in a header.
    pub const fn id(self) -> u8 {
        match self {
            Self::Degrees => 0,
            Self::Centimetres => 1,
        }
    }

    /// The unit with this number.
    pub const fn from_id(id: u8) -> Option<Self> {
        match id {
            0 => Some(Self::Degrees),
            1 => Some(Self::Centimetres),
            _ => None,
        }
    }
}

/// A header whose every field was checked.
#[derive(Clone, Copy, Debug)]
pub struct Header<'a> {
    opening: Opening<'a>,
    codec: Codec<'a>,
    entropy: EntropyId,
    channels: &'a [u8],
}

impl<'a> Header<'a> {
    /// Reads and checks prefix, header and checksum; `bytes` may go on behind them.
    ///
    /// # Errors
    /// [`Error`] with the byte at which the header is wrong, or too large for `limits`.
    pub fn parse(bytes: &'a [u8], limits: Limits) -> Result<Self, Error> {
        let prefix = Prefix::read(bytes)?;
        let truncated =
            Error::Truncated { field: Field::Header, at: 0, needed: prefix.header_bytes, found: bytes.len() };
        let header = bytes.get(..prefix.header_bytes).ok_or(truncated)?;
        let (covered, stored) = header.split_last_chunk::<CHECKSUM_BYTES>().ok_or(truncated)?;
        let (found, expected) = (checksum(covered, &[]), u32::from_le_bytes(*stored));
        if found != expected {
            return Err(Error::Checksum { field: Field::Header, at: 0, found, expected });
        }
        let body = covered.get(PREFIX_BYTES..).ok_or(truncated)?;
        let mut cursor = Cursor { rest: body, end: covered.len() };
        let opening = Opening::read(&mut cursor)?;
        let channels = cursor.rest;
        let header = Self::check(opening, channels, limits)?;
        header.check_channels(covered.len())?;
        let needed = header.needs().bytes() as u32;
        check(Field::Ram, PREFIX_BYTES, opening.ram, needed, u32::MAX)?;
        Ok(header)
    }

    /// Checks the first structure.
    fn check(opening: Opening<'a>, channels: &'a [u8], limits: Limits) -> Result<Self, Error> {
        let at = PREFIX_BYTES;
        check(Field::Rate, at, opening.rate_numerator, 1, u32::MAX)?;
        check(Field::Rate, at, opening.rate_denominator, 1, u32::MAX)?;
        check(Field::Frames, at, opening.frames, 1, i32::MAX as u32)?;
        check(Field::Channels, at, opening.channels.into(), 1, u16::MAX.into())?;
        for (field, found, limit) in [
            (Field::Channels, opening.channels.into(), limits.channels.into()),
            (Field::Frames, opening.frames, limits.frames),
        ] {
            if found > limit {
                return Err(Error::Limit { field, found, limit });
            }
        }
        let unsupported = |field, id: u8| Error::Unsupported { field, found: id.into() };
        let codec = CodecId::from_id(opening.codec).ok_or(unsupported(Field::Codec, opening.codec))?;
        let codec = Codec::read(codec, opening.parameters, at)?;
        let entropy =
            EntropyId::from_id(opening.entropy).ok_or(unsupported(Field::Entropy, opening.entropy))?;
        let tables = Error::Encoding { field: Field::CodeTables, at };
        match (entropy, opening.tables) {
            (EntropyId::FixedWidth, []) => {}
            (EntropyId::Huffman, tables_bytes) => {
                Shape::read(tables_bytes).map_err(|_| tables)?;
            }
            (EntropyId::AdaptiveHuffman, &[bits]) => {
                check(Field::CodeTables, at, bits.into(), 1, adaptive_huffman::MAX_BITS.into())?;
            }
            _ => return Err(tables),
        }
        if opening.cycles.len().checked_rem(5) != Some(0) {
            return Err(Error::Encoding { field: Field::Header, at });
        }
        Ok(Self { opening, codec, entropy, channels })
    }

    /// Checks every channel; `end` is where the header ends.
    fn check_channels(&self, end: usize) -> Result<(), Error> {
        let groups = match (self.entropy, Shape::read(self.opening.tables)) {
            (EntropyId::Huffman, Ok(shape)) => shape.groups,
            _ => 1,
        };
        let highest_step = if matches!(self.codec, Codec::Pcm) { MAX_EXPONENT } else { MAX_STEP };
        let mut cursor = Cursor { rest: self.channels, end };
        for _ in 0..self.opening.channels {
            let at = cursor.at();
            let channel = Channel::read(&mut cursor)?;
            check(Field::Unit, at, channel.unit.into(), 0, Unit::Centimetres.id().into())?;
            if channel.low > channel.high {
                return Err(Error::Encoding { field: Field::Range, at });
            }
            check(Field::EntryShift, at, channel.entry_shift.into(), 0, 31)?;
            check(Field::Bits, at, channel.bits.into(), 0, self.codec.most_bits().min(MAX_BITS).into())?;
            check(Field::Step, at, channel.step.into(), 0, highest_step.into())?;
            check(Field::Group, at, channel.group.into(), 0, u32::from(groups.saturating_sub(1)))?;
        }
        if cursor.rest.is_empty() {
            return Ok(());
        }
        Err(Error::Encoding { field: Field::Channel, at: cursor.at() })
    }

    /// The first structure as it is stored.
    pub const fn opening(&self) -> &Opening<'a> {
        &self.opening
    }

    /// The codec and its parameters.
    pub const fn codec(&self) -> &Codec<'a> {
        &self.codec
    }

    /// The entropy stage.
    pub const fn entropy(&self) -> EntropyId {
        self.entropy
    }

    /// Number of channels in a frame.
    pub const fn channel_count(&self) -> usize {
        self.opening.channels as usize
    }

    /// Frames in the clip.
    pub const fn frames(&self) -> u32 {
        self.opening.frames
    }

    /// Frames per second in hundredths, rounded; [`u16::MAX`] where it is more.
    pub fn rate_centihertz(&self) -> u16 {
        let (numerator, denominator) =
            (u64::from(self.opening.rate_numerator), u64::from(self.opening.rate_denominator));
        let doubled = numerator.saturating_mul(200).saturating_add(denominator);
        let rate = doubled.checked_div(denominator.saturating_mul(2)).unwrap_or(u64::MAX);
        u16::try_from(rate).unwrap_or(u16::MAX)
    }

    /// The channels, in the order of a frame.
    pub const fn channels(&self) -> Channels<'a> {
        Channels { cursor: Cursor { rest: self.channels, end: self.channels.len() } }
    }

    /// The channels without their names: to check those takes most of the time.
    pub(super) fn unnamed_channels(&self) -> impl Iterator<Item = Channel<'a>> {
        let mut channels = self.channels();
        core::iter::from_fn(move || {
            channels.cursor.bytes(Field::Channel).ok()?;
            Channel::read_unnamed(&mut channels.cursor, "").ok()
        })
    }

    /// The memory that a decoder needs.
    pub fn needs(&self) -> Needs {
        let channels = self.channel_count();
        let words = match (self.entropy, self.opening.tables) {
            (EntropyId::Huffman, tables) => Shape::read(tables).map_or(0, Shape::words),
            (EntropyId::AdaptiveHuffman, &[bits]) => AdaptiveHuffman::words(bits),
            _ => 0,
        };
        let words = words.saturating_add(self.codec.ring_words().saturating_mul(channels));
        let correlations = if self.codec.adapts_predictor() { channels } else { 0 };
        Needs { channels, correlations, words }
    }
}

/// The channels of a header.
#[derive(Clone, Debug)]
pub struct Channels<'a> {
    cursor: Cursor<'a>,
}

impl<'a> Iterator for Channels<'a> {
    type Item = Channel<'a>;

    fn next(&mut self) -> Option<Channel<'a>> {
        // Checked by `Header::parse`: an error is the end.
        Channel::read(&mut self.cursor).ok()
    }
}

/// Checks a number that was read in the structure at byte `at`.
pub(super) fn check(field: Field, at: usize, found: u32, low: u32, high: u32) -> Result<(), Error> {
    if found < low || found > high {
        return Err(Error::Malformed { field, at, found, low, high });
    }
    Ok(())
}

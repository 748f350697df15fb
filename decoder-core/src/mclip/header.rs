//! The header of a clip: a prefix of fixed size, then a postcard structure that is borrowed in place.

use super::codec::{Codec, CodecId, EntropyId};
use super::cursor::Cursor;
use super::engine::Needs;
use super::record::{Bounds, Channels};
use crate::entropy::huffman::Shape;
use crate::entropy::{AdaptiveHuffman, adaptive_huffman};
use crate::error::{Error, Field, Limits};
use crate::quantise::MAX_BITS;
use crate::quantise::step::MAX_STEP;
use crate::quantise::uniform::MAX_EXPONENT;
use crc::{CRC_32_ISO_HDLC, Crc, Digest};
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

/// The same CRC-32, of bytes that come piece by piece.
pub fn digest() -> Digest<'static, u32> {
    CRC.digest()
}

/// The CRC-32 (ISO-HDLC: that of zlib and PNG) of two slices, one after the other.
pub fn checksum(first: &[u8], second: &[u8]) -> u32 {
    let mut digest = digest();
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

/// The header, as it is stored.
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
    /// Predictors' coefficients: `i16`, 2 bytes each.
    pub predictors: &'a [u8],
    /// The channels' records, a bit string: see [`Channels`].
    pub records: &'a [u8],
    /// The joints' names, each a length and as many bytes of UTF-8; or nothing.
    pub names: &'a [u8],
}

impl<'a> Opening<'a> {
    /// Reads it, and where in the clip the records end.
    fn read(cursor: &mut Cursor<'a>) -> Result<(Self, usize), Error> {
        let records_end;
        let opening = Self {
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
            predictors: cursor.bytes(Field::Predictor)?,
            records: {
                let records = cursor.bytes(Field::Channel)?;
                records_end = cursor.at();
                records
            },
            names: cursor.bytes(Field::Names)?,
        };
        Ok((opening, records_end))
    }
}

/// A header whose every field was checked.
#[derive(Clone, Copy, Debug)]
pub struct Header<'a> {
    opening: Opening<'a>,
    codec: Codec<'a>,
    entropy: EntropyId,
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
        let (opening, records_end) = Opening::read(&mut cursor)?;
        if !cursor.rest.is_empty() {
            return Err(Error::Encoding { field: Field::Header, at: cursor.at() });
        }
        let header = Self::check(opening, limits)?;
        header.check_channels(records_end, covered.len())?;
        let needed = header.needs().bytes() as u32;
        check(Field::Ram, PREFIX_BYTES, opening.ram, needed, u32::MAX)?;
        Ok(header)
    }

    /// Checks all but the channels.
    fn check(opening: Opening<'a>, limits: Limits) -> Result<Self, Error> {
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
        codec.check_linked()?;
        entropy.check_linked()?;
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
        if opening.predictors.len().checked_rem(2) != Some(0) {
            return Err(Error::Encoding { field: Field::Predictor, at });
        }
        Ok(Self { opening, codec, entropy })
    }

    /// Checks every channel. Records and names end at these bytes of the clip.
    fn check_channels(&self, records_end: usize, names_end: usize) -> Result<(), Error> {
        let groups = match (self.entropy, Shape::read(self.opening.tables)) {
            (EntropyId::Huffman, Ok(shape)) => shape.groups,
            _ => 1,
        };
        self.channels_at(records_end, names_end).check(Bounds {
            bits: self.codec.most_bits().min(MAX_BITS),
            step: if matches!(self.codec, Codec::Pcm) { MAX_EXPONENT } else { MAX_STEP },
            group: groups.saturating_sub(1),
        })
    }

    /// The header as it is stored.
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
    pub fn channels(&self) -> Channels<'a> {
        self.channels_at(0, 0)
    }

    fn channels_at(&self, records_end: usize, names_end: usize) -> Channels<'a> {
        Channels::new(&self.opening, records_end, names_end, matches!(self.codec, Codec::Pcm))
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
        let correlations = if self.codec.correlates() { channels } else { 0 };
        Needs { channels, correlations, words }
    }
}

/// Checks a number that was read in the structure at byte `at`.
pub(super) fn check(field: Field, at: usize, found: u32, low: u32, high: u32) -> Result<(), Error> {
    if found < low || found > high {
        return Err(Error::Malformed { field, at, found, low, high });
    }
    Ok(())
}

//! The header of a clip, checked, and what follows from it.

use super::bounds::BlockBounds;
use super::fields::{CHECKSUM_BYTES, HeaderFields, PREFIX_BYTES, Prefix, checksum, digest};
use super::postcard::Cursor;
use super::record::Records;
use crate::codec::contract::Shape;
use crate::codec::linked::{LinkedCodec, RunningCodec};
use crate::entropy::linked::LinkedStage;
use crate::error::{Error, Field, Limits, check};
use crate::ids::{CodecId, EntropyId};
use crate::memory::{Memory, Needs};

/// A header whose every field was checked.
#[derive(Clone, Copy, Debug)]
pub struct Header<'a> {
    fields: HeaderFields<'a>,
    codec: LinkedCodec<'a>,
    entropy: EntropyId,
    /// Groups of code tables.
    groups: u8,
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
        let (fields, records_end) = HeaderFields::read(&mut cursor)?;
        if !cursor.rest.is_empty() {
            return Err(Error::Encoding { field: Field::Header, at: cursor.at() });
        }
        let header = Self::check(fields, limits)?;
        header.check_channels(records_end, covered.len())?;
        let needed = header.needs().bytes() as u32;
        check(Field::Ram, PREFIX_BYTES, fields.ram, needed, u32::MAX)?;
        Ok(header)
    }

    /// Checks all but the channels.
    fn check(fields: HeaderFields<'a>, limits: Limits) -> Result<Self, Error> {
        let at = PREFIX_BYTES;
        check(Field::Rate, at, fields.rate_numerator, 1, u32::MAX)?;
        check(Field::Rate, at, fields.rate_denominator, 1, u32::MAX)?;
        check(Field::Frames, at, fields.frames, 1, i32::MAX as u32)?;
        check(Field::Channels, at, fields.channels.into(), 1, u16::MAX.into())?;
        for (field, found, limit) in [
            (Field::Channels, fields.channels.into(), limits.channels.into()),
            (Field::Frames, fields.frames, limits.frames),
        ] {
            if found > limit {
                return Err(Error::Limit { field, found, limit });
            }
        }
        let unsupported = |field, id: u8| Error::Unsupported { field, found: id.into() };
        let codec = CodecId::from_id(fields.codec).ok_or(unsupported(Field::Codec, fields.codec))?;
        let codec = LinkedCodec::parse(codec, fields.parameters, at)?;
        let entropy =
            EntropyId::from_id(fields.entropy).ok_or(unsupported(Field::Entropy, fields.entropy))?;
        let groups = LinkedStage::check(entropy, fields.tables, at)?;
        check(Field::Delay, at, fields.delay.into(), codec.delay().into(), codec.delay().into())?;
        if fields.cycles.len().checked_rem(5) != Some(0) {
            return Err(Error::Encoding { field: Field::Header, at });
        }
        if fields.predictors.len().checked_rem(2) != Some(0) {
            return Err(Error::Encoding { field: Field::Predictor, at });
        }
        Ok(Self { fields, codec, entropy, groups })
    }

    /// Checks every channel. Records and names end at these bytes of the clip.
    fn check_channels(&self, records_end: usize, names_end: usize) -> Result<(), Error> {
        self.records_at(records_end, names_end).check(self.groups.saturating_sub(1))
    }

    /// The header as it is stored.
    pub const fn fields(&self) -> &HeaderFields<'a> {
        &self.fields
    }

    /// The codec and its parameters.
    pub const fn codec(&self) -> &LinkedCodec<'a> {
        &self.codec
    }

    /// The entropy stage.
    pub const fn entropy(&self) -> EntropyId {
        self.entropy
    }

    /// Number of channels in a frame.
    pub const fn channel_count(&self) -> usize {
        self.fields.channels as usize
    }

    /// What the clip's blocks keep to: enough to read a block's header without this one.
    pub const fn block_bounds(&self) -> BlockBounds {
        BlockBounds { bytes: self.fields.block_bytes, frames: self.fields.frames }
    }

    /// Frames in the clip.
    pub const fn frames(&self) -> u32 {
        self.fields.frames
    }

    /// Frames per second in hundredths, rounded; [`u16::MAX`] where it is more.
    pub fn rate_centihertz(&self) -> u16 {
        let (numerator, denominator) =
            (u64::from(self.fields.rate_numerator), u64::from(self.fields.rate_denominator));
        let doubled = numerator.saturating_mul(200).saturating_add(denominator);
        let rate = doubled.checked_div(denominator.saturating_mul(2)).unwrap_or(u64::MAX);
        u16::try_from(rate).unwrap_or(u16::MAX)
    }

    /// The channels, in the order of a frame.
    pub fn channels(&self) -> Records<'a> {
        self.records_at(0, 0)
    }

    /// The CRC-32 of the channels' names, each with a line feed behind it: of `root.ty\nrradius.rx\n`. `None` of a clip that
    /// names no joints.
    ///
    /// Reads all records and names once.
    pub fn names_digest(&self) -> Option<u32> {
        if self.fields.names.is_empty() {
            return None;
        }
        let mut digest = digest();
        for channel in self.channels() {
            if !channel.joint.is_empty() {
                digest.update(channel.joint.as_bytes());
                digest.update(b".");
            }
            digest.update(channel.kind.name().as_bytes());
            digest.update(b"\n");
        }
        Some(digest.finalize())
    }

    fn records_at(&self, records_end: usize, names_end: usize) -> Records<'a> {
        Records::new(&self.fields, records_end, names_end, self.codec.rules())
    }

    fn shape(&self) -> Shape<'a> {
        let HeaderFields { tables, .. } = self.fields;
        Shape { channels: self.channel_count(), entropy: self.entropy, tables, at: PREFIX_BYTES }
    }

    /// The memory that a decoder needs.
    pub fn needs(&self) -> Needs {
        self.codec.needs(&self.shape())
    }

    /// A decoder of the codec, before any block.
    ///
    /// # Errors
    /// [`Error::OutputTooSmall`], or [`Error::Encoding`] where the code tables are none.
    pub fn open<'s>(&self, memory: Memory<'s>) -> Result<RunningCodec<'a, 's>, Error> {
        self.codec.open(self.shape(), self.channels().unnamed(), memory)
    }
}

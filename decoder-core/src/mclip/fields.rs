//! The header of a clip as it is stored: a prefix of fixed size, then a postcard structure that is borrowed in place.

use super::postcard::{Cursor, put_bytes, put_number};
use crate::error::{Error, Field};
use crc::{CRC_32_ISO_HDLC, Crc, Digest};

/// The first bytes of a file.
pub const MAGIC: [u8; 4] = *b"MCLP";

/// The version of the format that this decoder reads.
pub const VERSION: u16 = 1;

/// Bytes before the header: magic, version, two zero bytes, length of the header.
pub const PREFIX_BYTES: usize = 12;

/// Bytes of a checksum.
pub(super) const CHECKSUM_BYTES: usize = 4;

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// The same CRC-32, of bytes that come piece by piece.
pub fn digest() -> Digest<'static, u32> {
    CRC.digest()
}

/// The CRC-32 (ISO-HDLC: that of zlib and PNG) of two slices, one after the other.
#[inline(never)]
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeaderFields<'a> {
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
    /// Bytes of memory that a decoder needs: [`Needs::bytes`](crate::memory::Needs::bytes).
    pub ram: u32,
    /// Frames by which a pose lags behind its codes: the codec's [`delay`](crate::codec::Codec::delay).
    pub delay: u16,
    /// The codec ([`CodecId`](crate::ids::CodecId)).
    pub codec: u8,
    /// The entropy stage ([`EntropyId`](crate::ids::EntropyId)).
    pub entropy: u8,
    /// The codec's parameters.
    pub parameters: &'a [u8],
    /// The entropy stage's tables.
    pub tables: &'a [u8],
    /// Certified worst-case cycles of a frame: 5 bytes a core, its number and 4 bytes of cycles.
    pub cycles: &'a [u8],
    /// Predictors' coefficients: `i16`, 2 bytes each.
    pub predictors: &'a [u8],
    /// The channels' records, a bit string: see [`Records`](super::record::Records).
    pub records: &'a [u8],
    /// The joints' names, each a length and as many bytes of UTF-8; or nothing.
    pub names: &'a [u8],
}

impl<'a> HeaderFields<'a> {
    /// Reads it, and where in the clip the records end.
    pub(super) fn read(cursor: &mut Cursor<'a>) -> Result<(Self, usize), Error> {
        let records_end;
        let fields = Self {
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
        Ok((fields, records_end))
    }

    /// Writes prefix, header and checksum, as [`Header::parse`](super::header::Header::parse) reads them.
    pub fn emit(&self, out: &mut impl Extend<u8>) {
        let mut length = Count(0);
        self.emit_fields(&mut length);
        let mut covered = Checked { out, digest: digest() };
        covered.extend(MAGIC);
        covered.extend(VERSION.to_le_bytes());
        covered.extend([0; 2]);
        covered.extend(length.0.to_le_bytes());
        self.emit_fields(&mut covered);
        let checksum = covered.digest.finalize();
        out.extend(checksum.to_le_bytes());
    }

    /// Writes the fields alone, in the order in which they are read.
    fn emit_fields(&self, out: &mut impl Extend<u8>) {
        put_number(self.rate_numerator, out);
        put_number(self.rate_denominator, out);
        put_number(self.frames, out);
        put_number(self.channels.into(), out);
        put_number(self.block_bytes.into(), out);
        put_number(self.ram, out);
        put_number(self.delay.into(), out);
        out.extend([self.codec, self.entropy]);
        put_bytes(self.parameters, out);
        put_bytes(self.tables, out);
        put_bytes(self.cycles, out);
        put_bytes(self.predictors, out);
        put_bytes(self.records, out);
        put_bytes(self.names, out);
    }
}

/// Counts the bytes that it takes.
struct Count(u32);

impl Extend<u8> for Count {
    fn extend<I: IntoIterator<Item = u8>>(&mut self, bytes: I) {
        self.0 = bytes.into_iter().fold(self.0, |count, _| count.saturating_add(1));
    }
}

/// Hands on the bytes that it takes, and computes their checksum.
struct Checked<'o, O> {
    out: &'o mut O,
    digest: Digest<'static, u32>,
}

impl<O: Extend<u8>> Extend<u8> for Checked<'_, O> {
    fn extend<I: IntoIterator<Item = u8>>(&mut self, bytes: I) {
        let digest = &mut self.digest;
        self.out.extend(bytes.into_iter().inspect(|&byte| digest.update(&[byte])));
    }
}

//! The bytes of the directory: a header and a record for every clip, each of 64 bytes. docs/STORE.md has the tables.

use super::entry::{Entry, NAME_BYTES, Name};

/// Bytes of a record, and of the header.
pub(super) const RECORD_BYTES: usize = 64;

const MAGIC: [u8; 4] = *b"BNKD";
const VERSION: u16 = 1;

/// Bytes of the header before its checksum, which covers them and the records.
const COVERED_BYTES: usize = 12;

/// Where a record's name is.
const NAME_AT: usize = 32;

/// What a directory begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub count: u16,
    pub generation: u32,
    pub crc: u32,
}

impl Header {
    /// The header's bytes that the checksum covers.
    pub fn covered(&self) -> [u8; COVERED_BYTES] {
        let mut bytes = [0; COVERED_BYTES];
        put(&mut bytes, 0, &MAGIC);
        put(&mut bytes, 4, &VERSION.to_le_bytes());
        put(&mut bytes, 6, &self.count.to_le_bytes());
        put(&mut bytes, 8, &self.generation.to_le_bytes());
        bytes
    }

    pub fn encode(&self) -> [u8; RECORD_BYTES] {
        let mut bytes = [0; RECORD_BYTES];
        put(&mut bytes, 0, &self.covered());
        put(&mut bytes, COVERED_BYTES, &self.crc.to_le_bytes());
        bytes
    }

    /// The header, if these are the bytes of one.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let header =
            Self { count: u16_at(bytes, 6)?, generation: u32_at(bytes, 8)?, crc: u32_at(bytes, 12)? };
        (bytes.get(..COVERED_BYTES)? == header.covered()).then_some(header)
    }
}

impl Entry {
    pub(super) fn encode(&self) -> [u8; RECORD_BYTES] {
        let mut bytes = [0; RECORD_BYTES];
        put(&mut bytes, 0, &self.clip.to_le_bytes());
        put(&mut bytes, 2, &[self.name.len() as u8]);
        put(&mut bytes, 4, &self.at.to_le_bytes());
        put(&mut bytes, 8, &self.bytes.to_le_bytes());
        put(&mut bytes, 12, &self.crc.to_le_bytes());
        put(&mut bytes, 16, &self.frames.to_le_bytes());
        put(&mut bytes, 20, &self.channels.to_le_bytes());
        put(&mut bytes, 22, &self.rate_centihertz.to_le_bytes());
        put(&mut bytes, NAME_AT, self.name.as_bytes());
        bytes
    }

    /// The record of these bytes, whose checksum was right.
    pub(super) fn decode(bytes: &[u8]) -> Option<Self> {
        let length = usize::from(*bytes.get(2)?).min(NAME_BYTES);
        let name = core::str::from_utf8(bytes.get(NAME_AT..)?.get(..length)?).unwrap_or_default();
        Some(Self {
            clip: u16_at(bytes, 0)?,
            name: Name::try_from(name).unwrap_or_default(),
            at: u32_at(bytes, 4)?,
            bytes: u32_at(bytes, 8)?,
            crc: u32_at(bytes, 12)?,
            frames: u32_at(bytes, 16)?,
            channels: u16_at(bytes, 20)?,
            rate_centihertz: u16_at(bytes, 22)?,
        })
    }
}

/// Puts bytes into their place, as far as there is one.
fn put(bytes: &mut [u8], at: usize, field: &[u8]) {
    let places = bytes.iter_mut().skip(at);
    places.zip(field).for_each(|(place, &byte)| *place = byte);
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..)?.first_chunk().copied().map(u16::from_le_bytes)
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().copied().map(u32::from_le_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_the_bytes_of_the_table() {
        let entry = Entry {
            clip: 0x0102,
            name: Name::try_from("wälk").unwrap(),
            at: 0x1020_3040,
            bytes: 0x0506_0708,
            crc: 0xdead_beef,
            frames: 0x0a0b_0c0d,
            channels: 62,
            rate_centihertz: 12000,
        };
        let bytes = entry.encode();
        let mut expected = std::vec![2, 1, 5, 0, 0x40, 0x30, 0x20, 0x10, 8, 7, 6, 5, 0xef, 0xbe, 0xad, 0xde];
        expected.extend([0x0d, 0x0c, 0x0b, 0x0a, 62, 0, 0xe0, 0x2e, 0, 0, 0, 0, 0, 0, 0, 0]);
        expected.extend("wälk".bytes());
        expected.resize(64, 0);
        assert_eq!(bytes.as_slice(), expected);
        assert_eq!(Entry::decode(&bytes), Some(entry));
        assert_eq!(Entry::decode(&bytes[..20]), None);
    }

    #[test]
    fn names_that_are_none_are_empty() {
        let mut bytes = [0; RECORD_BYTES];
        (bytes[2], bytes[32]) = (200, 0xff);
        assert_eq!(Entry::decode(&bytes).unwrap().name, "");
    }

    #[test]
    fn a_header_is_told_from_other_bytes() {
        let header = Header { count: 3, generation: 7, crc: 0x0102_0304 };
        let bytes = header.encode();
        assert_eq!(bytes[..16], *b"BNKD\x01\0\x03\0\x07\0\0\0\x04\x03\x02\x01");
        assert_eq!(Header::decode(&bytes), Some(header));
        for bit in 0..48 {
            let mut bytes = bytes;
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(Header::decode(&bytes), None);
        }
        assert_eq!(Header::decode(&[0xff; RECORD_BYTES]), None);
    }
}

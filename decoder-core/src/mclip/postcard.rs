//! Reads and writes postcard's wire format (<https://postcard.jamesmunns.com>), in place.
//!
//! The reader of the crate `postcard` has an overflow check that the compiler cannot rule out, and does not say where bytes
//! are wrong. This is what a header needs: integers, slices and strings.

use crate::error::{Error, Field};

/// The bytes that are still to be read, and where they end in the clip.
#[derive(Clone, Copy, Debug)]
pub struct Cursor<'a> {
    pub rest: &'a [u8],
    /// Byte of the clip after the last one.
    pub end: usize,
}

impl<'a> Cursor<'a> {
    /// Where the next byte is in the clip.
    pub const fn at(&self) -> usize {
        self.end.saturating_sub(self.rest.len())
    }

    const fn truncated(&self, field: Field, needed: usize) -> Error {
        Error::Truncated { field, at: self.at(), needed, found: self.rest.len() }
    }

    /// A byte as it is.
    pub fn u8(&mut self, field: Field) -> Result<u8, Error> {
        let (&byte, rest) = self.rest.split_first().ok_or(self.truncated(field, 1))?;
        self.rest = rest;
        Ok(byte)
    }

    /// A number of at most `most`, which is 2^n − 1, seven bits a byte, the lowest first.
    fn varint(&mut self, field: Field, most: u32) -> Result<u32, Error> {
        let at = self.at();
        let (mut value, mut shift, mut room) = (0u32, 0u32, most);
        loop {
            let byte = self.u8(field)?;
            let bits = u32::from(byte & 0x7f);
            if bits > room {
                return Err(Error::Encoding { field, at });
            }
            value |= bits.wrapping_shl(shift);
            if byte & 0x80 == 0 {
                return Ok(value);
            }
            // As many bytes as the type's bits take.
            room >>= 7;
            if room == 0 {
                return Err(Error::Encoding { field, at });
            }
            shift = shift.wrapping_add(7);
        }
    }

    pub fn u32(&mut self, field: Field) -> Result<u32, Error> {
        self.varint(field, u32::MAX)
    }

    pub fn u16(&mut self, field: Field) -> Result<u16, Error> {
        Ok(self.varint(field, u16::MAX.into())? as u16)
    }

    /// A length and as many bytes.
    pub fn bytes(&mut self, field: Field) -> Result<&'a [u8], Error> {
        let needed = usize::try_from(self.u32(field)?).unwrap_or(usize::MAX);
        let (bytes, rest) = self.rest.split_at_checked(needed).ok_or(self.truncated(field, needed))?;
        self.rest = rest;
        Ok(bytes)
    }

    /// A length and as many bytes of UTF-8.
    pub fn str(&mut self, field: Field) -> Result<&'a str, Error> {
        let at = self.at();
        core::str::from_utf8(self.bytes(field)?).map_err(|_| Error::Encoding { field, at })
    }
}

/// Writes a number, seven bits a byte, the lowest first, with the top bit set in all bytes but the last.
pub fn put_number(mut value: u32, out: &mut impl Extend<u8>) {
    while value >= 0x80 {
        out.extend([value as u8 | 0x80]);
        value >>= 7;
    }
    out.extend([value as u8]);
}

/// Writes a length and as many bytes.
pub fn put_bytes(bytes: &[u8], out: &mut impl Extend<u8>) {
    put_number(u32::try_from(bytes.len()).unwrap_or(u32::MAX), out);
    out.extend(bytes.iter().copied());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, stride, times};

    const FIELD: Field = Field::Header;

    /// Against the crate that writes our headers.
    #[test]
    fn what_postcard_writes_is_read() {
        let unsigned = (0..32).flat_map(|bit| [(1u32 << bit) - 1, 1 << bit, u32::MAX - (1 << bit)]);
        for value in unsigned {
            let mut buffer = [0; 64];
            let tuple = (value, value as u16, value as u8, "Ωx", &b"abc"[..]);
            let bytes = postcard::to_slice(&tuple, &mut buffer).unwrap();
            let mut cursor = Cursor { rest: bytes, end: 100 };
            assert_eq!(cursor.u32(FIELD), Ok(value));
            assert_eq!(cursor.u16(FIELD), Ok(value as u16));
            assert_eq!(cursor.u8(FIELD), Ok(value as u8));
            assert_eq!(cursor.str(FIELD), Ok("Ωx"));
            assert_eq!(cursor.bytes(FIELD), Ok(&b"abc"[..]));
            assert_eq!((cursor.rest.len(), cursor.at()), (0, 100));
        }
    }

    #[test]
    fn what_is_written_is_postcards() {
        for value in (0..32).flat_map(|bit| [(1u32 << bit) - 1, 1 << bit, u32::MAX - (1 << bit)]) {
            let (mut found, mut buffer) = (Vec::new(), [0; 64]);
            put_number(value, &mut found);
            put_bytes("Ωx".as_bytes(), &mut found);
            assert_eq!(found, postcard::to_slice(&(value, "Ωx"), &mut buffer).unwrap());
        }
    }

    /// Every sequence of up to three bytes as a 16-bit number, and samples of five as a 32-bit one.
    #[test]
    fn what_postcard_refuses_is_refused() {
        for value in (0..1u32 << 24).step_by(stride(20_011)) {
            let [a, b, c, _] = value.to_le_bytes();
            let bytes = [a, b, c];
            let found = Cursor { rest: &bytes, end: 3 }.u16(FIELD).ok();
            assert_eq!(found, postcard::from_bytes::<u16>(&bytes).ok(), "{bytes:x?}");
        }
        let mut random = Random::new(13);
        for _ in 0..times(1_000_000, 500) {
            let mut bytes = [0xff; 6];
            bytes.iter_mut().take(random.below(6)).for_each(|byte| *byte = random.next() as u8 | 0x80);
            if let Some(last) = bytes.get_mut(random.below(8)) {
                *last = random.next() as u8 & 0x7f;
            }
            let found = Cursor { rest: &bytes, end: 6 }.u32(FIELD).ok();
            assert_eq!(found, postcard::from_bytes::<u32>(&bytes).ok(), "{bytes:x?}");
        }
    }

    #[test]
    fn ends_are_told_with_their_place() {
        let mut cursor = Cursor { rest: &[5, 1, 2], end: 13 };
        let truncated = Error::Truncated { field: FIELD, at: 11, needed: 5, found: 2 };
        assert_eq!(cursor.bytes(FIELD), Err(truncated));
        let mut cursor = Cursor { rest: &[1, 0xff], end: 2 };
        assert_eq!(cursor.str(FIELD), Err(Error::Encoding { field: FIELD, at: 0 }));
    }
}

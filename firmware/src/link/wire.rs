//! The bytes of messages: numbers, options, texts and lists, and how a choice gets its number.
//!
//! The encoding is that of [postcard](https://postcard.jamesmunns.com/wire-format), with the numbers of choices written down
//! (`numbers`) instead of counted from the order of Rust's variants. Nothing here allocates or panics.

use super::cobs_writer::CobsWriter;
use heapless::{String, Vec};

/// Bytes of a varint of 32 bits at most.
const VARINT_BYTES: usize = 5;

/// What can be written on the link.
pub trait Encode {
    /// Writes it. Where there is no room, the writer notes that.
    fn encode(&self, out: &mut CobsWriter<'_>);
}

/// What can be read from the link.
pub trait Decode<'b>: Sized {
    /// Takes it off the front of `input`; `None` where the bytes are something else, or end.
    fn decode(input: &mut &'b [u8]) -> Option<Self>;
}

/// A message's bytes as they are: what another version may send, or nobody.
#[derive(Clone, Copy, Debug)]
pub struct Raw<'b>(pub &'b [u8]);

impl Encode for Raw<'_> {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        self.0.iter().for_each(|&byte| out.put(byte));
    }
}

/// Reads a message that takes all of the bytes.
pub fn decode_all<'b, T: Decode<'b>>(bytes: &'b [u8]) -> Option<T> {
    let mut rest = bytes;
    let message = T::decode(&mut rest)?;
    rest.is_empty().then_some(message)
}

fn take<'b>(input: &mut &'b [u8], count: usize) -> Option<&'b [u8]> {
    let (front, rest) = input.split_at_checked(count)?;
    *input = rest;
    Some(front)
}

impl Encode for u8 {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        out.put(*self);
    }
}

impl Decode<'_> for u8 {
    fn decode(input: &mut &[u8]) -> Option<Self> {
        let (&byte, rest) = input.split_first()?;
        *input = rest;
        Some(byte)
    }
}

impl Encode for bool {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        out.put(u8::from(*self));
    }
}

impl Decode<'_> for bool {
    fn decode(input: &mut &[u8]) -> Option<Self> {
        match u8::decode(input)? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}

impl Encode for u32 {
    /// A varint: seven bits a byte, the lowest first; the top bit is set on all but the last byte.
    fn encode(&self, out: &mut CobsWriter<'_>) {
        let mut left = *self;
        while left > 0x7f {
            out.put(left as u8 | 0x80);
            left >>= 7;
        }
        out.put(left as u8);
    }
}

impl Decode<'_> for u32 {
    fn decode(input: &mut &[u8]) -> Option<Self> {
        let mut value = 0u64;
        for place in 0..VARINT_BYTES {
            let byte = u8::decode(input)?;
            value |= u64::from(byte & 0x7f).wrapping_shl(7u32.wrapping_mul(place as u32));
            if byte < 0x80 {
                return Self::try_from(value).ok();
            }
        }
        None
    }
}

impl Encode for u16 {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        u32::from(*self).encode(out);
    }
}

impl Decode<'_> for u16 {
    fn decode(input: &mut &[u8]) -> Option<Self> {
        Self::try_from(u32::decode(input)?).ok()
    }
}

impl Encode for i32 {
    /// A varint of its zigzag: 0, −1, 1, −2 … for 0, 1, 2, 3 …
    fn encode(&self, out: &mut CobsWriter<'_>) {
        let zigzag = (self.wrapping_shl(1) ^ (*self >> 31)) as u32;
        zigzag.encode(out);
    }
}

impl Decode<'_> for i32 {
    fn decode(input: &mut &[u8]) -> Option<Self> {
        let zigzag = u32::decode(input)?;
        Some((zigzag >> 1) as Self ^ ((zigzag & 1) as Self).wrapping_neg())
    }
}

impl Encode for i16 {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        i32::from(*self).encode(out);
    }
}

impl Decode<'_> for i16 {
    fn decode(input: &mut &[u8]) -> Option<Self> {
        Self::try_from(i32::decode(input)?).ok()
    }
}

impl<T: Encode> Encode for Option<T> {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        out.put(u8::from(self.is_some()));
        if let Some(value) = self {
            value.encode(out);
        }
    }
}

impl<'b, T: Decode<'b>> Decode<'b> for Option<T> {
    fn decode(input: &mut &'b [u8]) -> Option<Self> {
        if bool::decode(input)? { T::decode(input).map(Some) } else { Some(None) }
    }
}

impl Encode for &[u8] {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        (self.len() as u32).encode(out);
        self.iter().for_each(|&byte| out.put(byte));
    }
}

impl<'b> Decode<'b> for &'b [u8] {
    fn decode(input: &mut &'b [u8]) -> Option<Self> {
        let count = u32::decode(input)?;
        take(input, usize::try_from(count).ok()?)
    }
}

impl Encode for &str {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        self.as_bytes().encode(out);
    }
}

impl<'b> Decode<'b> for &'b str {
    fn decode(input: &mut &'b [u8]) -> Option<Self> {
        core::str::from_utf8(<&[u8]>::decode(input)?).ok()
    }
}

impl<const N: usize> Encode for String<N> {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        self.as_str().encode(out);
    }
}

impl<const N: usize> Decode<'_> for String<N> {
    fn decode(input: &mut &[u8]) -> Option<Self> {
        Self::try_from(<&str>::decode(input)?).ok()
    }
}

impl<T: Encode, const N: usize> Encode for Vec<T, N> {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        (self.len() as u32).encode(out);
        self.iter().for_each(|value| value.encode(out));
    }
}

impl<'b, T: Decode<'b>, const N: usize> Decode<'b> for Vec<T, N> {
    fn decode(input: &mut &'b [u8]) -> Option<Self> {
        let count = u32::decode(input)?;
        let mut values = Self::new();
        for _ in 0..count {
            values.push(T::decode(input)?).ok()?;
        }
        Some(values)
    }
}

/// The fields of a message in their order: writes, reads and describes them.
macro_rules! wire_struct {
    ($name:ident { $($field:ident: $type:ty),* $(,)? }) => {
        impl Encode for $name {
            fn encode(&self, out: &mut CobsWriter<'_>) {
                let Self { $($field),* } = self;
                $(<$type as Encode>::encode($field, out);)*
            }
        }

        impl<'b> Decode<'b> for $name {
            fn decode(input: &mut &'b [u8]) -> Option<Self> {
                Some(Self { $($field: <$type as Decode>::decode(input)?),* })
            }
        }

        #[cfg(test)]
        impl Described for $name {
            const ROWS: &'static [Row] =
                &[Row { number: None, name: "", fields: &[$((stringify!($field), stringify!($type))),*] }];
        }
    };
}

/// The numbers of a choice, each with its fields in their order: writes, reads and describes them. A variant without a
/// number does not compile, and neither does a number that is given twice.
macro_rules! wire_enum {
    ($name:ident $(<$life:lifetime>)? {
        $($number:literal $variant:ident $({ $($field:ident: $type:ty),* })? $(( $item:ident: $item_type:ty ))?),* $(,)?
    }) => {
        impl$(<$life>)? Encode for $name$(<$life>)? {
            fn encode(&self, out: &mut CobsWriter<'_>) {
                match self {
                    $(Self::$variant $({ $($field),* })? $(($item))? => {
                        <u32 as Encode>::encode(&$number, out);
                        $($(<$type as Encode>::encode($field, out);)*)?
                        $(<$item_type as Encode>::encode($item, out);)?
                    })*
                }
            }
        }

        impl<'b> Decode<'b> for wire_enum!(@decoded $name $($life)?) {
            #[deny(unreachable_patterns)]
            fn decode(input: &mut &'b [u8]) -> Option<Self> {
                Some(match u32::decode(input)? {
                    $($number => Self::$variant
                        $({ $($field: <$type as Decode>::decode(input)?),* })?
                        $((<$item_type as Decode>::decode(input)?))?,)*
                    _ => return None,
                })
            }
        }

        #[cfg(test)]
        impl$(<$life>)? Described for $name$(<$life>)? {
            const ROWS: &'static [Row] = &[$(Row {
                number: Some($number),
                name: stringify!($variant),
                fields: &[
                    $($((stringify!($field), stringify!($type)),)*)?
                    $((stringify!($item), stringify!($item_type)),)?
                ],
            }),*];
        }
    };
    (@decoded $name:ident) => { $name };
    (@decoded $name:ident $life:lifetime) => { $name<'b> };
}

pub(super) use {wire_enum, wire_struct};

/// What docs/LINK.md has to say of a type: a row for each number, or one of all fields.
#[cfg(test)]
pub(super) trait Described {
    const ROWS: &'static [Row];
}

#[cfg(test)]
pub(super) struct Row {
    pub number: Option<u32>,
    pub name: &'static str,
    pub fields: &'static [(&'static str, &'static str)],
}

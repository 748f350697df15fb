//! What a header says of its channels: a bit string of one record a channel, and the names of the joints.
//!
//! A record has a few bits for each field, counted from the least value that any channel has, so that what all channels
//! share costs nothing. The bytes are in docs/FORMAT.md, "Channels".

use super::cursor::Cursor;
use super::header::{Opening, check};
use crate::arithmetic::signed;
use crate::bits::BitReader;
use crate::error::{Error, Field};
use core::fmt;

/// Bits of the mantissa of a pcm channel's Δ.
pub const MANTISSA_BITS: u32 = 15;

/// Most bits of a value at an entry point.
pub const MAX_ENTRY_BITS: u8 = 32;

/// What a channel moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ChannelKind {
    /// Translation along x, in centimetres.
    Tx,
    /// Translation along y, in centimetres.
    Ty,
    /// Translation along z, in centimetres.
    Tz,
    /// Rotation about x, in degrees.
    Rx,
    /// Rotation about y, in degrees.
    Ry,
    /// Rotation about z, in degrees.
    Rz,
    /// Length of the bone beyond its rest length, in centimetres (ASF `l`).
    Length,
}

impl ChannelKind {
    /// All kinds, in the order of their numbers.
    pub const ALL: [Self; 7] = [Self::Tx, Self::Ty, Self::Tz, Self::Rx, Self::Ry, Self::Rz, Self::Length];

    /// Its number in a header.
    pub const fn id(self) -> u8 {
        self as u8
    }

    /// The kind with this number.
    pub fn from_id(id: u8) -> Option<Self> {
        Self::ALL.get(usize::from(id)).copied()
    }

    /// Its name in an ASF file, in lower case: `tx`, `rz`, `l`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tx => "tx",
            Self::Ty => "ty",
            Self::Tz => "tz",
            Self::Rx => "rx",
            Self::Ry => "ry",
            Self::Rz => "rz",
            Self::Length => "l",
        }
    }

    /// Whether it is a rotation, in degrees; the others are lengths, in centimetres.
    pub const fn is_rotation(self) -> bool {
        matches!(self, Self::Rx | Self::Ry | Self::Rz)
    }

    /// 0, 1 or 2 for a rotation about, or a translation along, x, y or z; `None` for [`Length`](Self::Length).
    pub const fn axis(self) -> Option<usize> {
        match self {
            Self::Tx | Self::Rx => Some(0),
            Self::Ty | Self::Ry => Some(1),
            Self::Tz | Self::Rz => Some(2),
            Self::Length => None,
        }
    }
}

/// A channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel<'a> {
    /// Name of its joint; empty where the clip names none.
    pub joint: &'a str,
    /// What it moves.
    pub kind: ChannelKind,
    /// A word: pcm: the lowest value of its grid; with 0 bits, its value in the whole clip; else 0.
    pub low: i32,
    /// Bits of its value at an entry point, 1 to [`MAX_ENTRY_BITS`]; pcm and channels of 0 bits have no such values.
    pub entry_bits: u8,
    /// Places by which its values are shifted at an entry point, and `low` is stored with, 0 to 27.
    pub entry_shift: u8,
    /// Bits of a code, 0 to 16; with 0, the channel keeps its value.
    pub bits: u8,
    /// Index of its step, or of its first step where it adapts; pcm: the exponent of Δ.
    pub step: u8,
    /// Its group of code tables.
    pub group: u8,
    /// Coefficient of its predictor; pcm: the mantissa of Δ.
    pub coefficient: i16,
}

/// `rradius.rx`, or `rx` where the clip names no joints.
impl fmt::Display for Channel<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.joint.is_empty() {
            formatter.write_str(self.joint)?;
            formatter.write_str(".")?;
        }
        formatter.write_str(self.kind.name())
    }
}

/// Places by which values are shifted at an entry point, where the step is as this index says: steps are told apart to
/// 2^precision parts at least. In pcm, the lowest value is in units of the mantissa's.
pub const fn entry_shift(step: u8, precision: u8, is_pcm: bool) -> u8 {
    if is_pcm { step } else { (step >> 3).wrapping_add(3).saturating_sub(precision) }
}

/// A field of all records: the least value, and the bits of what is added to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Packing {
    /// The least value.
    pub least: u8,
    /// Bits, such that no sum is above 255.
    pub width: u8,
}

impl Packing {
    fn read(bits: &mut BitReader<'_>) -> Self {
        Self { least: bits.take(8) as u8, width: bits.take(4) as u8 }
    }

    fn is_sound(self) -> bool {
        u32::from(self.least).wrapping_add(1u32.wrapping_shl(self.width.into())) <= 256
    }

    #[inline(always)]
    fn take(self, bits: &mut BitReader<'_>) -> u8 {
        self.least.wrapping_add(bits.take(self.width.into()) as u8)
    }
}

/// How fields are packed: what a bit string of records begins with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Packings {
    /// Binary places of a step that values at an entry point are told apart to, 0 to 15.
    pub precision: u8,
    /// [`Channel::bits`].
    pub bits: Packing,
    /// [`Channel::step`].
    pub step: Packing,
    /// [`Channel::entry_bits`].
    pub entry_bits: Packing,
    /// [`Channel::group`].
    pub group: Packing,
    /// Which coefficient.
    pub predictor: Packing,
}

impl Packings {
    fn read(bits: &mut BitReader<'_>) -> Self {
        Self {
            precision: bits.take(4) as u8,
            bits: Packing::read(bits),
            step: Packing::read(bits),
            entry_bits: Packing::read(bits),
            group: Packing::read(bits),
            predictor: Packing::read(bits),
        }
    }

    fn are_sound(&self) -> bool {
        [self.bits, self.step, self.entry_bits, self.group, self.predictor].into_iter().all(Packing::is_sound)
    }
}

/// The highest values of fields, by codec and tables.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub bits: u8,
    pub step: u8,
    pub group: u8,
}

/// The channels of a header, in the order of a frame.
#[derive(Clone, Debug)]
pub struct Channels<'a> {
    bits: BitReader<'a>,
    packings: Packings,
    left: u16,
    is_pcm: bool,
    predictors: &'a [u8],
    names: Cursor<'a>,
    joint: &'a str,
    /// Where the records begin and end in the clip.
    start: usize,
    end: usize,
}

impl<'a> Channels<'a> {
    /// Before the first. Records and names end at these bytes of the clip.
    pub(super) fn new(header: &Opening<'a>, end: usize, names_end: usize, is_pcm: bool) -> Self {
        let mut bits = BitReader::new(header.records);
        let packings = Packings::read(&mut bits);
        Self {
            bits,
            packings,
            left: header.channels,
            is_pcm,
            predictors: header.predictors,
            names: Cursor { rest: header.names, end: names_end },
            joint: "",
            start: end.saturating_sub(header.records.len()),
            end,
        }
    }

    /// Leaves joints without their names: to check those takes most of the time.
    pub(super) fn unnamed(self) -> Self {
        Self { names: Cursor { rest: &[], end: 0 }, ..self }
    }

    /// The byte of the clip that the next bit is in.
    fn at(&self) -> usize {
        self.start.saturating_add(self.bits.position() >> 3)
    }

    /// Reads all channels and checks them.
    pub(super) fn check(mut self, bounds: Bounds) -> Result<(), Error> {
        if !self.packings.are_sound() {
            return Err(Error::Encoding { field: Field::Channel, at: self.start });
        }
        let has_names = !self.names.rest.is_empty();
        while self.left > 0 {
            let at = self.at();
            let channel = self.read(has_names)?;
            check(Field::Bits, at, channel.bits.into(), 0, bounds.bits.into())?;
            check(Field::Step, at, channel.step.into(), 0, bounds.step.into())?;
            if channel.bits > 0 && !self.is_pcm {
                check(Field::EntryBits, at, channel.entry_bits.into(), 1, MAX_ENTRY_BITS.into())?;
            }
            check(Field::Group, at, channel.group.into(), 0, bounds.group.into())?;
        }
        let bytes = self.bits.position().saturating_add(7) >> 3;
        let used = self.start.saturating_add(bytes);
        if self.bits.overrun() || used != self.end {
            return Err(Error::Encoding { field: Field::Channel, at: used });
        }
        if self.names.rest.is_empty() {
            return Ok(());
        }
        Err(Error::Encoding { field: Field::Names, at: self.names.at() })
    }

    fn read(&mut self, has_names: bool) -> Result<Channel<'a>, Error> {
        let at = self.at();
        let Self { bits, packings, predictors, names, .. } = self;
        self.left = self.left.saturating_sub(1);
        if bits.take(1) == 1 && has_names {
            self.joint = names.str(Field::Names)?;
        }
        let kind = bits.take(3);
        let last = (ChannelKind::ALL.len() as u32).saturating_sub(1);
        let malformed = Error::Malformed { field: Field::Kind, at, found: kind, low: 0, high: last };
        let kind = ChannelKind::from_id(kind as u8).ok_or(malformed)?;
        let channel_bits = packings.bits.take(bits);
        let step = packings.step.take(bits);
        let entry_shift = entry_shift(step, packings.precision, self.is_pcm);
        let (mut group, mut coefficient, mut entry_bits, mut low) = (0, 0, 0, 0);
        if channel_bits > 0 {
            group = packings.group.take(bits);
            if self.is_pcm {
                coefficient = bits.take(MANTISSA_BITS) as i16;
            } else {
                entry_bits = packings.entry_bits.take(bits);
                coefficient = predictor(predictors, packings.predictor.take(bits), at)?;
            }
        }
        if channel_bits == 0 || self.is_pcm {
            low = signed(number(bits)).wrapping_shl(entry_shift.into());
        }
        let (joint, bits) = (self.joint, channel_bits);
        Ok(Channel { joint, kind, low, entry_bits, entry_shift, bits, step, group, coefficient })
    }
}

impl<'a> Iterator for Channels<'a> {
    type Item = Channel<'a>;

    fn next(&mut self) -> Option<Channel<'a>> {
        // Checked by `Header::parse`: an error is the end.
        if self.left == 0 { None } else { self.read(!self.names.rest.is_empty()).ok() }
    }
}

/// Coefficient `index`; zero, which predicts the last value, where there is none at all.
fn predictor(coefficients: &[u8], index: u8, at: usize) -> Result<i16, Error> {
    let (coefficients, _) = coefficients.as_chunks::<2>();
    match coefficients.get(usize::from(index)) {
        Some(&coefficient) => Ok(i16::from_le_bytes(coefficient)),
        None if coefficients.is_empty() && index == 0 => Ok(0),
        None => {
            let high = (coefficients.len() as u32).saturating_sub(1);
            Err(Error::Malformed { field: Field::Predictor, at, found: index.into(), low: 0, high })
        }
    }
}

/// A number, three bits at a time, the lowest first, each after a bit that is 1 in all but the last.
fn number(bits: &mut BitReader<'_>) -> u32 {
    let (mut value, mut shift) = (0u32, 0u32);
    loop {
        let part = bits.take(4);
        value |= (part & 7).checked_shl(shift).unwrap_or(0);
        shift = shift.wrapping_add(3);
        // Past the end come zeros, so this ends.
        if part < 8 {
            return value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;
    use std::vec::Vec;

    const CHANNEL: Channel<'_> = Channel {
        joint: "rradius",
        kind: ChannelKind::Rx,
        low: 0,
        entry_bits: 10,
        entry_shift: 13,
        bits: 8,
        step: 104,
        group: 0,
        coefficient: 0,
    };

    #[test]
    fn channels_are_named_by_joint_and_kind() {
        assert_eq!(CHANNEL.to_string(), "rradius.rx");
        assert_eq!(Channel { joint: "", kind: ChannelKind::Length, ..CHANNEL }.to_string(), "l");
        for (id, kind) in ChannelKind::ALL.into_iter().enumerate() {
            assert_eq!((usize::from(kind.id()), ChannelKind::from_id(id as u8)), (id, Some(kind)));
        }
        assert_eq!(ChannelKind::from_id(7), None);
    }

    #[test]
    fn kinds_are_named_as_in_asf_and_turn_or_not() {
        let all = ChannelKind::ALL.map(|kind| (kind.name(), kind.is_rotation(), kind.axis()));
        let expected = [
            ("tx", false, Some(0)),
            ("ty", false, Some(1)),
            ("tz", false, Some(2)),
            ("rx", true, Some(0)),
            ("ry", true, Some(1)),
            ("rz", true, Some(2)),
            ("l", false, None),
        ];
        assert_eq!(all, expected);
    }

    #[test]
    fn entry_shifts_follow_the_octave_of_the_step() {
        for step in 0..=199u8 {
            let octave = crate::quantise::step::size(step).ilog2() as u8;
            for precision in 0..16 {
                assert_eq!(entry_shift(step, precision, false), octave.saturating_sub(precision));
            }
        }
        assert_eq!(entry_shift(9, 3, true), 9);
    }

    #[test]
    fn numbers_come_in_threes() {
        let read = |bytes: &[u8]| {
            let mut bits = BitReader::new(bytes);
            (number(&mut bits), bits.position())
        };
        assert_eq!(read(&[0x70]), (7, 4));
        assert_eq!(read(&[0x81]), (8, 8));
        assert_eq!(read(&[0xff, 0xff, 0xff, 0xff, 0xff, 0x30]), (u32::MAX, 44));
        // What is above 32 bits is dropped, for however long.
        assert_eq!(read(&[0x9f; 100]), (read(&[0x9f; 6]).0, 804));
        assert_eq!(read(&[0x8f, 0xff]).1, 20, "the end is read as zeros");
    }

    #[test]
    fn packings_whose_sums_are_no_bytes_are_refused() {
        for (least, width, sound) in
            [(0, 8, true), (1, 8, false), (255, 0, true), (254, 1, true), (255, 1, false)]
        {
            assert_eq!(Packing { least, width }.is_sound(), sound);
        }
        assert!(!Packing { least: 0, width: 15 }.is_sound());
    }

    #[test]
    fn predictors_are_numbered_and_the_last_value_where_there_are_none() {
        let bytes: Vec<u8> = [1i16, -2, 300].iter().flat_map(|part| part.to_le_bytes()).collect();
        assert_eq!([0, 1, 2].map(|index| predictor(&bytes, index, 9)), [Ok(1), Ok(-2), Ok(300)]);
        assert_eq!(predictor(&[], 0, 9), Ok(0));
        let error =
            |found, high| Err(Error::Malformed { field: Field::Predictor, at: 9, found, low: 0, high });
        assert_eq!(predictor(&bytes, 3, 9), error(3, 2));
        assert_eq!(predictor(&[], 1, 9), error(1, 0));
    }
}

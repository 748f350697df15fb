//! What a header says of its channels: a bit string of one record a channel, and the names of the joints.
//!
//! A record has a few bits for each field, counted from the least value that any channel has, so that what all channels
//! share costs nothing. The bytes are in docs/FORMAT.md, "Channels".

use super::fields::HeaderFields;
use super::postcard::{Cursor, put_bytes};
use crate::arithmetic::{signed, unsigned};
use crate::bits::reader::BitReader;
use crate::bits::writer::BitWriter;
use crate::channel::{Channel, ChannelKind, MANTISSA_BITS, MAX_ENTRY_BITS, Rules, entry_shift};
use crate::error::{Error, Field, check};

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

    fn emit(self, out: &mut BitWriter<impl Extend<u8>>) {
        out.put(self.least.into(), 8);
        out.put(self.width.into(), 4);
    }

    /// The narrowest packing that has room for these values.
    fn covering(values: impl Iterator<Item = u8>) -> Self {
        let (least, most) =
            values.fold((u8::MAX, 0), |(least, most), value| (value.min(least), value.max(most)));
        let least = least.min(most);
        let width = u8::BITS.wrapping_sub(most.wrapping_sub(least).leading_zeros());
        // Down where the highest sum would not be a byte.
        let least = u32::from(least).min(256u32.wrapping_sub(1u32.wrapping_shl(width)));
        Self { least: least as u8, width: width as u8 }
    }

    fn put(self, value: u8, out: &mut BitWriter<impl Extend<u8>>) {
        out.put(value.wrapping_sub(self.least).into(), self.width.into());
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

    fn emit(&self, out: &mut BitWriter<impl Extend<u8>>) {
        out.put(self.precision.into(), 4);
        for packing in [self.bits, self.step, self.entry_bits, self.group, self.predictor] {
            packing.emit(out);
        }
    }

    /// The narrowest packings that have room for these channels and the numbers of their coefficients.
    fn covering<'c>(
        channels: impl Iterator<Item = Channel<'c>> + Clone,
        coefficients: &[i16],
        precision: u8,
    ) -> Self {
        let active = || channels.clone().filter(|channel| channel.bits > 0);
        Self {
            precision,
            bits: Packing::covering(channels.clone().map(|channel| channel.bits)),
            step: Packing::covering(channels.clone().map(|channel| channel.step)),
            entry_bits: Packing::covering(active().map(|channel| channel.entry_bits)),
            group: Packing::covering(active().map(|channel| channel.group)),
            predictor: Packing::covering(active().map(|channel| nearest(coefficients, channel.coefficient))),
        }
    }

    fn are_sound(&self) -> bool {
        [self.bits, self.step, self.entry_bits, self.group, self.predictor].into_iter().all(Packing::is_sound)
    }
}

/// Writes the records of channels as [`Records`] reads them: a bit string of its own. The entry shifts of the channels are those
/// of `precision`, and each channel gets the nearest of the coefficients.
pub fn emit_records<'c>(
    channels: impl Iterator<Item = Channel<'c>> + Clone,
    coefficients: &[i16],
    precision: u8,
    grid: bool,
    out: &mut BitWriter<impl Extend<u8>>,
) {
    let packings = Packings::covering(channels.clone(), coefficients, precision);
    packings.emit(out);
    let mut before = None;
    for channel in channels {
        out.put((before.replace(channel.joint) != Some(channel.joint)).into(), 1);
        out.put(channel.kind.id().into(), 3);
        packings.bits.put(channel.bits, out);
        packings.step.put(channel.step, out);
        if channel.bits > 0 {
            packings.group.put(channel.group, out);
            if grid {
                out.put(channel.coefficient as u32, MANTISSA_BITS);
            } else {
                packings.entry_bits.put(channel.entry_bits, out);
                packings.predictor.put(nearest(coefficients, channel.coefficient), out);
            }
        }
        if channel.bits == 0 || grid {
            put_number(unsigned(channel.low.wrapping_shr(channel.entry_shift.into())), out);
        }
    }
}

/// Writes the names of the channels' joints, where any has one: each once for the channels of it that follow each other.
pub fn emit_names<'c>(channels: impl Iterator<Item = Channel<'c>> + Clone, out: &mut impl Extend<u8>) {
    if channels.clone().all(|channel| channel.joint.is_empty()) {
        return;
    }
    let mut before = None;
    for channel in channels {
        if before.replace(channel.joint) != Some(channel.joint) {
            put_bytes(channel.joint.as_bytes(), out);
        }
    }
}

/// The number of the coefficient that is nearest; the first 256 have one.
fn nearest(coefficients: &[i16], to: i16) -> u8 {
    let numbered = (0..=u8::MAX).zip(coefficients);
    numbered.min_by_key(|(_, coefficient)| coefficient.abs_diff(to)).map_or(0, |(number, _)| number)
}

/// The channels of a header, in the order of a frame.
#[derive(Clone, Debug)]
pub struct Records<'a> {
    bits: BitReader<'a>,
    packings: Packings,
    left: u16,
    rules: Rules,
    predictors: &'a [u8],
    names: Cursor<'a>,
    joint: &'a str,
    /// Where the records begin and end in the clip.
    start: usize,
    end: usize,
}

impl<'a> Records<'a> {
    /// Before the first. Records and names end at these bytes of the clip.
    pub(super) fn new(header: &HeaderFields<'a>, end: usize, names_end: usize, rules: Rules) -> Self {
        let mut bits = BitReader::new(header.records);
        let packings = Packings::read(&mut bits);
        Self {
            bits,
            packings,
            left: header.channels,
            rules,
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
    pub(super) fn check(mut self, last_group: u8) -> Result<(), Error> {
        if !self.packings.are_sound() {
            return Err(Error::Encoding { field: Field::Channel, at: self.start });
        }
        let has_names = !self.names.rest.is_empty();
        while self.left > 0 {
            let at = self.at();
            let channel = self.read(has_names)?;
            check(Field::Bits, at, channel.bits.into(), 0, self.rules.bits.into())?;
            check(Field::Step, at, channel.step.into(), 0, self.rules.step.into())?;
            if channel.bits > 0 && !self.rules.grid {
                check(Field::EntryBits, at, channel.entry_bits.into(), 1, MAX_ENTRY_BITS.into())?;
            }
            check(Field::Group, at, channel.group.into(), 0, last_group.into())?;
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
        let entry_shift = entry_shift(step, packings.precision, self.rules.grid);
        let (mut group, mut coefficient, mut entry_bits, mut low) = (0, 0, 0, 0);
        if channel_bits > 0 {
            group = packings.group.take(bits);
            if self.rules.grid {
                coefficient = bits.take(MANTISSA_BITS) as i16;
            } else {
                entry_bits = packings.entry_bits.take(bits);
                coefficient = predictor(predictors, packings.predictor.take(bits), at)?;
            }
        }
        if channel_bits == 0 || self.rules.grid {
            low = signed(number(bits)).wrapping_shl(entry_shift.into());
        }
        let (joint, bits) = (self.joint, channel_bits);
        Ok(Channel { joint, kind, low, entry_bits, entry_shift, bits, step, group, coefficient })
    }
}

impl<'a> Iterator for Records<'a> {
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

/// Writes a number as [`number`] reads it.
fn put_number(mut value: u32, out: &mut BitWriter<impl Extend<u8>>) {
    loop {
        let rest = value >> 3;
        out.put(value & 7 | if rest > 0 { 8 } else { 0 }, 4);
        value = rest;
        if value == 0 {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

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

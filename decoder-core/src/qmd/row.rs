//! One row of differences onto the pose: the hot path.
//!
//! A channel costs one load of the index, one of the table entry, one of the pose, an addition and a store: 10 cycles
//! on Cortex-M0+, where a load or store takes 2 and the index has to be shifted.
//! Additions wrap (docs/FORMAT.md): saturating ones would cost Cortex-M0+ four cycles a channel, and only a
//! damaged clip can leave the range, whose goal positions are limited behind the decoder anyway.

use super::segment::Layout;
use crate::float::fixed_from_f32_bits;
use fixed::types::I16F16;

/// The table of a segment: as the file has it, or converted into words that the caller lent.
#[derive(Clone, Copy)]
pub(super) enum Table<'t> {
    Floats(&'t [[u8; 4]]),
    /// For one-byte indices. The compiler sees that a byte is always inside, and drops the check.
    Narrow(&'t [i32; NARROW]),
    /// For two-byte indices.
    Words(&'t [i32]),
}

impl<'t> Table<'t> {
    /// Converted words, of which there are [`Layout::table_len`].
    pub fn of(words: &'t [i32], layout: Layout) -> Self {
        match words.first_chunk() {
            Some(narrow) if layout.table_len() == NARROW => Self::Narrow(narrow),
            _ => Self::Words(words),
        }
    }
}

/// Entries of a table for one-byte indices.
pub(super) const NARROW: usize = 256;

/// Converts a table of floats into fixed-point words.
pub(super) fn convert(floats: &[[u8; 4]], words: &mut [i32]) {
    for (word, &float) in words.iter_mut().zip(floats) {
        *word = fixed(float);
    }
}

/// Adds one row to `pose`. `row` has [`Layout::row_bytes`] bytes, `pose` an element a channel, the table
/// [`Layout::table_len`] entries; whatever is missing in one of them leaves channels as they were.
///
/// The loops over a table are functions of their own, never inlined: together they would share registers, and the
/// hot one would keep its pointers on the stack.
#[inline]
pub(super) fn add(layout: Layout, row: &[u8], table: Table<'_>, pose: &mut [I16F16]) {
    let (mut indices, mut looked_up) = (row, pose);
    if layout.fixed_channels > 0 {
        let fixed_channels = usize::from(layout.fixed_channels);
        let (Some((floats, rest)), Some((exact, others))) = (
            indices.split_at_checked(fixed_channels.wrapping_mul(4)),
            looked_up.split_at_mut_checked(fixed_channels),
        ) else {
            return;
        };
        add_floats(exact, floats);
        (indices, looked_up) = (rest, others);
    }
    match table {
        Table::Narrow(words) => add_words(looked_up, indices, words),
        Table::Words(words) => add_wide(looked_up, indices, layout.index_bits, words),
        Table::Floats(floats) => add_converted(looked_up, indices, layout.index_bits, floats),
    }
}

/// Channels that the hot path handles at a time: the loop's own instructions are shared by eight channels, and on
/// Cortex-M4 loads follow each other. With four, M4 is as fast and M0+ slower; with sixteen, M4 runs out of registers.
const GROUP: usize = 8;

/// Adds the words of a table to each value. The hot path.
#[inline(never)]
fn add_words(values: &mut [I16F16], indices: &[u8], words: &[i32; NARROW]) {
    // One length for both, so that the loops have one end to look for.
    let count = values.len().min(indices.len());
    let (Some(values), Some(indices)) = (values.get_mut(..count), indices.get(..count)) else {
        return;
    };
    let (groups, last_values) = values.as_chunks_mut::<GROUP>();
    let (index_groups, last_indices) = indices.as_chunks::<GROUP>();
    let word = |index: &u8| words.get(usize::from(*index)).copied().unwrap_or(0);
    // The rest goes first: nothing has to be kept for it then.
    add_each(last_values, last_indices, word);
    for (indices, values) in index_groups.iter().zip(groups) {
        // Arrays: this loop is unrolled.
        for (value, index) in values.iter_mut().zip(indices) {
            step(value, word(index));
        }
    }
}

/// Adds floats to each value. Few channels are floats, so a call would cost as much as one of them.
#[inline(always)]
fn add_floats(values: &mut [I16F16], floats: &[u8]) {
    let (floats, _) = floats.as_chunks::<4>();
    add_each(values, floats, |&float| fixed(float));
}

/// Adds the words of a table of any size to each value.
#[inline(never)]
fn add_wide(values: &mut [I16F16], indices: &[u8], index_bits: u8, words: &[i32]) {
    let (indices, _) = indices.as_chunks::<2>();
    let mask = mask(index_bits);
    add_each(values, indices, |index| words.get(entry(index, mask)).copied().unwrap_or(0));
}

/// Adds the floats of a table to each value.
#[inline(never)]
fn add_converted(values: &mut [I16F16], indices: &[u8], index_bits: u8, floats: &[[u8; 4]]) {
    if let Some(floats) = floats.first_chunk::<NARROW>()
        && index_bits == 8
    {
        add_each(values, indices, |&index| floats.get(usize::from(index)).map_or(0, |&float| fixed(float)));
        return;
    }
    let (indices, _) = indices.as_chunks::<2>();
    let mask = mask(index_bits);
    add_each(values, indices, |index| floats.get(entry(index, mask)).map_or(0, |&float| fixed(float)));
}

/// Bits of a two-byte index that count.
const fn mask(index_bits: u8) -> usize {
    1usize.wrapping_shl(index_bits as u32).wrapping_sub(1)
}

/// The entry that a two-byte index means. Bits above `b` are not looked at, so there always is one.
const fn entry(index: &[u8; 2], mask: usize) -> usize {
    u16::from_le_bytes(*index) as usize & mask
}

/// Adds to each value what its index means.
#[inline(always)]
fn add_each<I>(values: &mut [I16F16], indices: &[I], difference: impl Fn(&I) -> i32) {
    for (value, index) in values.iter_mut().zip(indices) {
        step(value, difference(index));
    }
}

#[inline(always)]
fn fixed(float: [u8; 4]) -> i32 {
    fixed_from_f32_bits(u32::from_le_bytes(float))
}

#[inline(always)]
fn step(value: &mut I16F16, difference: i32) {
    *value = value.wrapping_add(I16F16::from_bits(difference));
}

//! One row of differences onto the pose: the hot path.
//!
//! A channel costs one load of the index, one of the table entry, one of the pose, an addition and a store.
//! Additions wrap (docs/FORMAT.md): saturating ones would cost Cortex-M0+ four cycles a channel, and only a
//! damaged clip can leave the range, whose goal positions are limited behind the decoder anyway.

use super::segment::Layout;
use crate::float::fixed_from_f32_bits;
use fixed::types::I16F16;

/// The table of a segment: as the file has it, or converted into words that the caller lent.
#[derive(Clone, Copy)]
pub(super) enum Table<'t> {
    Floats(&'t [[u8; 4]]),
    Words(&'t [i32]),
}

/// Converts a table of floats into fixed-point words.
pub(super) fn convert(floats: &[[u8; 4]], words: &mut [i32]) {
    for (word, &float) in words.iter_mut().zip(floats) {
        *word = fixed(float);
    }
}

/// Adds one row to `pose`. `row` has [`Layout::row_bytes`] bytes, `pose` an element a channel, the table
/// [`Layout::table_len`] entries; whatever is missing in one of them leaves channels as they were.
#[inline]
pub(super) fn add(layout: Layout, row: &[u8], table: Table<'_>, pose: &mut [I16F16]) {
    let fixed_channels = usize::from(layout.fixed_channels);
    let (Some((floats, indices)), Some((exact, looked_up))) =
        (row.split_at_checked(fixed_channels.wrapping_mul(4)), pose.split_at_mut_checked(fixed_channels))
    else {
        return;
    };
    let (floats, _) = floats.as_chunks::<4>();
    for (value, &float) in exact.iter_mut().zip(floats) {
        step(value, fixed(float));
    }
    if layout.index_bits == 8 {
        // The compiler sees that a byte is always inside an array of 256, and drops the check.
        match table {
            Table::Words(words) => {
                if let Some(words) = words.first_chunk::<256>() {
                    let word = |&index: &u8| words.get(usize::from(index)).copied().unwrap_or(0);
                    add_each::<GROUP, _>(looked_up, indices, word);
                }
            }
            Table::Floats(floats) => {
                if let Some(floats) = floats.first_chunk::<256>() {
                    let float = |&index: &u8| floats.get(usize::from(index)).map_or(0, |&float| fixed(float));
                    add_each::<1, _>(looked_up, indices, float);
                }
            }
        }
    } else {
        // Bits of an index above `b` are not looked at, so there is always an entry.
        let mask = layout.table_len().wrapping_sub(1);
        let (indices, _) = indices.as_chunks::<2>();
        let entry = |index: &[u8; 2]| usize::from(u16::from_le_bytes(*index)) & mask;
        match table {
            Table::Words(words) => {
                add_each::<1, _>(looked_up, indices, |index| words.get(entry(index)).copied().unwrap_or(0));
            }
            Table::Floats(floats) => {
                add_each::<1, _>(looked_up, indices, |index| {
                    floats.get(entry(index)).map_or(0, |&float| fixed(float))
                });
            }
        }
    }
}

/// Channels that the hot path handles at a time: the loop's own instructions are shared by eight channels, and on
/// Cortex-M4 loads follow each other.
const GROUP: usize = 8;

/// Adds to each value what its index means, `N` of them at a time.
#[inline(always)]
fn add_each<const N: usize, I>(values: &mut [I16F16], indices: &[I], difference: impl Fn(&I) -> i32) {
    let (values, last_values) = values.as_chunks_mut::<N>();
    let (indices, last_indices) = indices.as_chunks::<N>();
    // `zip` over arrays of a known length is unrolled.
    for (values, indices) in values.iter_mut().zip(indices) {
        for (value, index) in values.iter_mut().zip(indices) {
            step(value, difference(index));
        }
    }
    for (value, index) in last_values.iter_mut().zip(last_indices) {
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

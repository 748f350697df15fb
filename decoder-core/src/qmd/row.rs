//! One row of differences onto the pose: the hot path.
//!
//! A channel costs one load of the index, one of the table entry, one of the pose, an addition and a store: 10 cycles
//! on Cortex-M0+, where a load or store takes 2 and the index has to be shifted. What is written here in an unusual
//! way keeps the loops in the few registers of that core; docs/CYCLES.md, "Where a frame's cycles go", has the counts.
//! Additions wrap (docs/FORMAT.md): saturating ones would cost Cortex-M0+ four cycles a channel, and only a
//! damaged clip can leave the range, whose goal positions are limited behind the decoder anyway.

use crate::word::{far, fixed_from_f32_bits, near};
use fixed::types::I16F16;

/// Entries of a table for one-byte indices.
pub(super) const NARROW: usize = 256;

/// Converts a table of floats into fixed-point words.
pub(super) fn convert(floats: &[[u8; 4]], words: &mut [i32]) {
    for (word, &float) in words.iter_mut().zip(floats) {
        *word = fixed(float);
    }
}

/// Adds the floats at the front of `row` to the first channels of `pose`; what is left are the other channels and
/// their indices.
#[inline(always)]
pub(super) fn add_floats<'p, 'r>(
    fixed_channels: u16,
    row: &'r [u8],
    pose: &'p mut [I16F16],
) -> Option<(&'p mut [I16F16], &'r [u8])> {
    let fixed_channels = usize::from(fixed_channels);
    if fixed_channels == 0 {
        return Some((pose, row));
    }
    let (floats, indices) = row.split_at_checked(fixed_channels.wrapping_mul(4))?;
    let (exact, looked_up) = pose.split_at_mut_checked(fixed_channels)?;
    let (floats, _) = floats.as_chunks::<4>();
    add_each(exact, floats, |&float| fixed(float));
    Some((looked_up, indices))
}

/// Channels that the hot path handles at a time: the loop's own instructions are shared by eight channels, and on
/// Cortex-M4 loads follow each other. With four, M4 is as fast and M0+ slower; with sixteen, M4 runs out of registers.
const GROUP: usize = 8;

/// Adds the words of a table to each value. The hot path.
///
/// What no group of eight takes goes first, unrolled like the groups; the loop then has one end and one counter.
#[inline(always)]
pub(super) fn add_words(mut values: &mut [I16F16], mut indices: &[u8], words: &[i32; NARROW]) {
    if values.len() != indices.len() {
        return;
    }
    if values.len() & 1 != 0 {
        let Some(rest) = add_group::<1>(values, indices, words) else { return };
        (values, indices) = rest;
    }
    if values.len() & 2 != 0 {
        let Some(rest) = add_group::<2>(values, indices, words) else { return };
        (values, indices) = rest;
    }
    if values.len() & 4 != 0 {
        let Some(rest) = add_group::<4>(values, indices, words) else { return };
        (values, indices) = rest;
    }
    while values.len() >= GROUP {
        let Some(rest) = add_group::<GROUP>(values, indices, words) else { return };
        (values, indices) = rest;
    }
}

#[inline(always)]
fn add_group<'v, 'i, const N: usize>(
    values: &'v mut [I16F16],
    indices: &'i [u8],
    words: &[i32; NARROW],
) -> Option<(&'v mut [I16F16], &'i [u8])> {
    let (group, values) = values.split_first_chunk_mut::<N>()?;
    let (index_group, indices) = indices.split_first_chunk::<N>()?;
    for (value, &index) in group.iter_mut().zip(index_group) {
        step(value, words.get(usize::from(index)).copied().unwrap_or(0));
    }
    Some((values, indices))
}

/// Adds the words of a table of any size to each value.
#[inline(never)]
pub(super) fn add_wide(values: &mut [I16F16], indices: &[u8], index_bits: u8, words: &[i32]) {
    let (indices, _) = indices.as_chunks::<2>();
    let mask = mask(index_bits);
    add_each(values, indices, |index| words.get(entry(index, mask)).copied().unwrap_or(0));
}

/// Adds the floats of a table for one-byte indices to each value, two at a time. With more, Cortex-M0+ loads what has
/// no register from the stack.
#[inline(always)]
pub(super) fn add_narrow_floats(values: &mut [I16F16], indices: &[u8], floats: &[[u8; 4]; NARROW]) {
    if values.len() != indices.len() {
        return;
    }
    let float = |&index: &u8| {
        let bits = u32::from_le_bytes(floats.get(usize::from(index)).copied().unwrap_or_default());
        // No case for zero, as in `fixed`: it takes a register of this loop.
        near(bits).unwrap_or_else(|| far(bits))
    };
    // One first where their number is odd: the loop over pairs then is all that is left.
    let (first, pairs) = values.as_rchunks_mut::<2>();
    let (first_index, index_pairs) = indices.as_rchunks::<2>();
    add_each(first, first_index, float);
    for (values, indices) in pairs.iter_mut().zip(index_pairs) {
        add_each(values, indices, float);
    }
}

/// Adds the floats of a table of any size to each value.
#[inline(never)]
pub(super) fn add_wide_floats(values: &mut [I16F16], indices: &[u8], index_bits: u8, floats: &[[u8; 4]]) {
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
        let difference = difference(index);
        step(value, difference);
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

//! Codes of fixed width, eight channels at a time: eight codes of one width are whole bytes, and each is where the compiler
//! knows.

use super::loops::{CHUNK, serial_of_codes, step_channel};
use crate::arithmetic::BYTES_ONLY;
use crate::bits::reader::BitReader;
use crate::entropy::fixed_width::{GROUP, field};
use crate::predict::fixed::Predict;
use crate::quantise::adaptive::Adaptive;
use crate::quantise::quantiser::Quantise;
use crate::quantise::uniform::Uniform;
use crate::state::State;
use core::mem;
use fixed::types::I16F16;

/// Widths that loops are compiled for.
const WIDTHS: core::ops::RangeInclusive<u8> = 4..=8;

/// Marks groups of channels whose codes all have as many bits: in the first channel these bits, or 0
/// where they differ, and in the second how many groups in sequence are like it, as far as a byte can say. The last group
/// may have fewer channels.
pub fn mark_widths(states: &mut [State]) {
    let (mut width_after, mut alike) = (0u8, 0u8);
    for group in states.chunks_mut(GROUP).rev() {
        let bits = group.first().map_or(0, State::bits);
        let same = group.iter().all(|channel| channel.bits() == bits);
        let width = if same && WIDTHS.contains(&bits) { bits } else { 0 };
        alike = if width == width_after { alike.saturating_add(1) } else { 1 };
        width_after = width;
        group.iter_mut().zip([width, alike]).for_each(|(channel, context)| channel.context = context);
    }
}

/// Takes the codes of the channels out of their bits; gives the bytes that are left.
#[inline(never)]
pub fn unpack<'b>(mut states: &[State], out: &mut [i32; CHUNK], mut codes: &'b [u8]) -> Option<&'b [u8]> {
    let mut out = out.as_mut_slice();
    while let Some(first) = states.first() {
        let (now, later) = alike(states)?;
        states = later;
        let (out_now, out_later) =
            mem::take(&mut out).split_at_mut_checked(now.len().wrapping_add(GROUP - 1) & !(GROUP - 1))?;
        out = out_later;
        codes = match first.context {
            4 => unpack_width::<4>(now.len(), out_now, codes)?,
            5 => unpack_width::<5>(now.len(), out_now, codes)?,
            6 => unpack_width::<6>(now.len(), out_now, codes)?,
            7 => unpack_width::<7>(now.len(), out_now, codes)?,
            8 => unpack_width::<8>(now.len(), out_now, codes)?,
            _ => unpack_mixed(now, out_now, codes)?,
        };
    }
    Some(codes)
}

/// The channels of the groups that are like the first one, or of that alone where its widths differ; and those after them.
fn alike(states: &[State]) -> Option<(&[State], &[State])> {
    let groups = match states {
        [first, second, ..] if first.context > 0 => usize::from(second.context),
        _ => 1,
    };
    states.split_at_checked(groups.wrapping_mul(GROUP).min(states.len()))
}

/// So many codes of one width; those behind them, up to a whole group, are any.
fn unpack_width<'b, const BITS: usize>(count: usize, out: &mut [i32], codes: &'b [u8]) -> Option<&'b [u8]> {
    let bytes = count.wrapping_mul(BITS).wrapping_add(7) >> 3;
    let (now, later) = codes.split_at_checked(bytes)?;
    let (groups, rest) = now.as_chunks::<BITS>();
    let (out, _) = out.as_chunks_mut::<GROUP>();
    let mut out = out.iter_mut();
    for (group, out) in groups.iter().zip(&mut out) {
        for (place, out) in (0..GROUP).zip(out) {
            *out = field(group, place);
        }
    }
    if let Some(out) = out.next() {
        unpack_group::<BITS>(out, rest);
    }
    Some(later)
}

/// Eight codes of one width, or fewer.
#[inline(always)]
fn unpack_group<const BITS: usize>(out: &mut [i32; GROUP], codes: &[u8]) {
    let scratch;
    let group = if let Some(group) = codes.first_chunk::<BITS>() {
        group
    } else {
        scratch = filled(codes);
        &scratch
    };
    for (place, out) in (0..GROUP).zip(out) {
        *out = field(group, place);
    }
}

/// Bytes, and zeros up to a whole group.
#[cold]
#[inline(never)]
fn filled<const BITS: usize>(bytes: &[u8]) -> [u8; BITS] {
    let mut group = [0; BITS];
    group.iter_mut().zip(bytes).for_each(|(slot, &byte)| *slot = byte);
    group
}

/// Codes of any widths, up to a whole byte.
#[inline(never)]
fn unpack_mixed<'b>(states: &[State], out: &mut [i32], codes: &'b [u8]) -> Option<&'b [u8]> {
    let mut reader = BitReader::new(codes);
    for (state, out) in states.iter().zip(out) {
        let bits = state.bits();
        *out = if bits == 0 { 0 } else { reader.take_signed(bits.into()) };
    }
    codes.get(reader.position().wrapping_add(7) >> 3..)
}

/// A loop over a frame's channels, chosen when a clip is opened: takes the codes off the front of a block's, and gives
/// those that are left.
pub type GroupLoop = for<'b> fn(&mut Channels<'_>, &Adaptive, &'b [u8]) -> Option<&'b [u8]>;

/// What such a loop changes: all channels of a frame, or some of them.
#[derive(Debug)]
pub struct Channels<'s> {
    /// Their last values.
    pub pose: &'s mut [I16F16],
    /// Their states.
    pub states: &'s mut [State],
}

/// A quantiser that such a loop can have: the one of all channels that is handed to it, or one that needs nothing.
pub trait Shared: Quantise + Sized {
    /// It, where `adaptive` is the one that a clip has.
    fn of(adaptive: &Adaptive) -> &Self;
}

impl Shared for Uniform {
    #[inline(always)]
    fn of(_: &Adaptive) -> &Self {
        &Self
    }
}

impl Shared for Adaptive {
    #[inline(always)]
    fn of(adaptive: &Adaptive) -> &Self {
        adaptive
    }
}

/// The loop for these widths.
pub fn loop_for<P: Predict + Default, Q: Shared>(states: &[State]) -> GroupLoop {
    // Where all of them have codes of one width: the shortest way.
    let width = match states {
        [first, second, ..] if usize::from(second.context).wrapping_mul(GROUP) >= states.len() => {
            first.context
        }
        _ => 0,
    };
    match width {
        4 => one_width::<4, P, Q>,
        5 => one_width::<5, P, Q>,
        6 => one_width::<6, P, Q>,
        7 => one_width::<7, P, Q>,
        8 => one_width::<8, P, Q>,
        _ => any_widths::<P, Q>,
    }
}

/// One run of groups of one width after the other.
fn any_widths<'b, P: Predict + Default, Q: Shared>(
    channels: &mut Channels<'_>,
    adaptive: &Adaptive,
    mut codes: &'b [u8],
) -> Option<&'b [u8]> {
    let (mut pose, mut states) = (&mut *channels.pose, &mut *channels.states);
    while let Some(first) = states.first() {
        let alike = usize::from(states.get(1).map_or(1, |second| second.context));
        let width = first.context;
        let groups = if width == 0 { 1 } else { alike };
        let count = groups.wrapping_mul(GROUP).min(states.len());
        let (now, later) = pose.split_at_mut_checked(count)?;
        let (states_now, states_later) = states.split_at_mut_checked(count)?;
        let mut channels = Channels { pose: now, states: states_now };
        codes = match width {
            4 => one_width::<4, P, Q>(&mut channels, adaptive, codes)?,
            5 => one_width::<5, P, Q>(&mut channels, adaptive, codes)?,
            6 => one_width::<6, P, Q>(&mut channels, adaptive, codes)?,
            7 => one_width::<7, P, Q>(&mut channels, adaptive, codes)?,
            8 => one_width::<8, P, Q>(&mut channels, adaptive, codes)?,
            _ => {
                let mut buffer = [0; GROUP];
                let left = unpack_mixed(channels.states, &mut buffer, codes)?;
                serial_of_codes(channels.pose, channels.states, &P::default(), Q::of(adaptive), &buffer);
                left
            }
        };
        (pose, states) = (later, states_later);
    }
    Some(codes)
}

/// Channels whose codes all have `BITS` bits.
fn one_width<'b, const BITS: usize, P: Predict + Default, Q: Shared>(
    channels: &mut Channels<'_>,
    adaptive: &Adaptive,
    codes: &'b [u8],
) -> Option<&'b [u8]> {
    let quantise = Q::of(adaptive);
    // All slices are cut to one number of groups, in 16 bits, so that the compiler need not look which ends first.
    let count = usize::from((channels.pose.len() / GROUP) as u16);
    let whole_channels = count.wrapping_mul(GROUP);
    let (pose, last) = channels.pose.split_at_mut_checked(whole_channels)?;
    let (states, last_states) = channels.states.split_at_mut_checked(whole_channels)?;
    let (whole, rest) = codes.split_at_checked(count.wrapping_mul(BITS))?;
    let (pose, states, whole) =
        (pose.as_chunks_mut::<GROUP>().0, states.as_chunks_mut::<GROUP>().0, whole.as_chunks::<BITS>().0);
    if (BYTES_ONLY && (5..8).contains(&BITS)) || Q::KEEPS {
        for ((values, states), codes) in pose.iter_mut().zip(states).zip(whole) {
            group_apart::<BITS, P, Q>(values, states, codes, quantise);
        }
    } else {
        for ((values, states), codes) in pose.iter_mut().zip(states).zip(whole) {
            group::<BITS, P, Q>(values, states, codes, quantise);
        }
    }
    if last.is_empty() {
        return Some(rest);
    }
    let after = rest.get(last.len().wrapping_mul(BITS).wrapping_add(7) >> 3..)?;
    // Bytes behind the last code are any: only at a block's end there may be none.
    match rest.first_chunk::<BITS>() {
        Some(group) => last_group::<BITS, P, Q>(last, last_states, group, quantise),
        None => last_group::<BITS, P, Q>(last, last_states, &filled(rest), quantise),
    }
    Some(after)
}

/// Groups in a function of their own, where pointers are all that the registers have to hold.
#[inline(never)]
fn group_apart<const BITS: usize, P: Predict + Default, Q: Quantise>(
    values: &mut [I16F16; GROUP],
    states: &mut [State; GROUP],
    codes: &[u8; BITS],
    quantise: &Q,
) {
    group::<BITS, P, Q>(values, states, codes, quantise);
}

/// Eight channels.
#[inline(always)]
fn group<const BITS: usize, P: Predict + Default, Q: Quantise>(
    values: &mut [I16F16; GROUP],
    states: &mut [State; GROUP],
    codes: &[u8; BITS],
    quantise: &Q,
) {
    // Arrays: this loop is unrolled, and each code is at a place that the compiler knows.
    for (place, (value, state)) in (0..GROUP).zip(values.iter_mut().zip(states)) {
        step_channel(value, state, &P::default(), quantise, field(codes, place), BITS as u8);
    }
}

/// The channels after the last whole group, fewer than eight.
#[inline(never)]
fn last_group<const BITS: usize, P: Predict + Default, Q: Quantise>(
    values: &mut [I16F16],
    states: &mut [State],
    codes: &[u8; BITS],
    quantise: &Q,
) {
    // Measured: only where codes take few registers is it faster to look once whether there are four.
    let four = (values.split_first_chunk_mut::<4>(), states.split_first_chunk_mut::<4>());
    if BITS == 4
        && let (Some((now, later)), Some((states_now, states_later))) = four
    {
        for (place, (value, state)) in (0..4).zip(now.iter_mut().zip(states_now)) {
            step_channel(value, state, &P::default(), quantise, field(codes, place), BITS as u8);
        }
        one_by_one::<4, BITS, P, Q>(later, states_later, codes, quantise);
    } else {
        one_by_one::<0, BITS, P, Q>(values, states, codes, quantise);
    }
}

/// Channels from place `FIRST` to at most the one before the last.
#[inline(always)]
fn one_by_one<const FIRST: usize, const BITS: usize, P: Predict + Default, Q: Quantise>(
    values: &mut [I16F16],
    states: &mut [State],
    codes: &[u8; BITS],
    quantise: &Q,
) {
    let Some(states) = states.get_mut(..values.len()) else { return };
    for at in 0..GROUP.wrapping_sub(FIRST).wrapping_sub(1) {
        let (Some(value), Some(state)) = (values.get_mut(at), states.get_mut(at)) else { break };
        step_channel(value, state, &P::default(), quantise, field(codes, FIRST.wrapping_add(at)), BITS as u8);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::{Channel, ChannelKind};
    use crate::predict::fixed::FirstByHalves;
    use crate::quantise::quantiser::Step;
    use crate::quantise::step::MAX_STEP;
    use crate::quantise::step::size;
    use crate::testing::{Random, stride};
    use std::vec::Vec;

    fn states(widths: &[u8]) -> Vec<State> {
        let channel = |&bits: &u8| Channel {
            joint: "",
            kind: ChannelKind::Rx,
            low: 0,
            entry_bits: 8,
            entry_shift: 0,
            bits,
            step: 104,
            group: 0,
            coefficient: 0,
        };
        let mut states: Vec<State> =
            widths.iter().map(|bits| State::new(&channel(bits), Step::of(size(104)), 0)).collect();
        mark_widths(&mut states);
        states
    }

    /// One code after the other, and the bytes that they take.
    fn one_after_the_other(widths: &[u8], codes: &[u8]) -> (Vec<i32>, usize) {
        let mut reader = BitReader::new(codes);
        let mut found = Vec::new();
        for group in widths.chunks(GROUP) {
            found.extend(group.iter().map(|&bits| reader.take_signed(bits.into())));
            reader.align();
        }
        (found, reader.position() >> 3)
    }

    /// Every number of channels of every width, and groups of several: with more bytes behind them, and at the end of a block.
    #[test]
    fn codes_are_those_of_a_reader_of_bits() {
        let mut random = Random::new(12);
        let mut all: Vec<Vec<u8>> = Vec::new();
        for width in 3..=9u8 {
            all.extend((1..=CHUNK).step_by(stride(9)).map(|count| std::vec![width; count]));
        }
        all.push([[5; GROUP], [5; GROUP], [7; GROUP], [3; GROUP], [7; GROUP]].concat());
        all.push([&[6; GROUP][..], &[4, 5, 6], &[]].concat());
        for widths in all {
            let codes: Vec<u8> = (0..2 * widths.len() + 20).map(|_| random.next() as u8).collect();
            let (expected, bytes) = one_after_the_other(&widths, &codes);
            for codes in [&codes[..], &codes[..bytes]] {
                let mut states = states(&widths);
                let mut out = [0; CHUNK];
                let rest = unpack(&states, &mut out, codes).map(<[u8]>::len);
                assert_eq!(rest, Some(codes.len() - bytes), "{widths:?}");
                assert_eq!(out[..widths.len()], expected, "{widths:?}");
                let mut pose = std::vec![I16F16::ZERO; widths.len()];
                let adaptive = Adaptive::new([0; 16], 0, MAX_STEP);
                let run = loop_for::<FirstByHalves, Uniform>(&states);
                let mut channels = Channels { pose: &mut pose, states: &mut states };
                let rest = run(&mut channels, &adaptive, codes).map(<[u8]>::len);
                assert_eq!(rest, Some(codes.len() - bytes), "{widths:?}");
                let steps: Vec<i32> = pose.iter().map(|value| value.to_bits() / size(104)).collect();
                assert_eq!(steps, expected, "{widths:?}");
                // A byte less is none too many.
                let mut channels = Channels { pose: &mut pose, states: &mut states };
                assert!(run(&mut channels, &adaptive, &codes[..bytes - 1]).is_none());
            }
        }
    }
}

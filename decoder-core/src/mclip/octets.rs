//! Codes of fixed width, eight channels at a time: eight codes of one width are whole bytes, and each is where the compiler
//! knows.

use super::channels::{CHUNK, given};
use super::state::State;
use crate::bits::BitReader;
use crate::entropy::fixed_width::{OCTET, field};
use crate::predict::Predict;
use crate::quantise::Quantise;
use core::mem;
use fixed::types::I16F16;

/// Widths that loops are compiled for.
const WIDTHS: core::ops::RangeInclusive<u8> = 4..=8;

/// Marks octets of channels whose codes all have as many bits: in the first channel these bits, or 0
/// where they differ, and in the second how many octets in sequence are like it, as far as a byte can say. The last octet
/// may have fewer channels.
pub(super) fn mark(states: &mut [State]) {
    let (mut width_after, mut alike) = (0u8, 0u8);
    for octet in states.chunks_mut(OCTET).rev() {
        let bits = octet.first().map_or(0, State::bits);
        let same = octet.iter().all(|channel| channel.bits() == bits);
        let width = if same && WIDTHS.contains(&bits) { bits } else { 0 };
        alike = if width == width_after { alike.saturating_add(1) } else { 1 };
        width_after = width;
        octet.iter_mut().zip([width, alike]).for_each(|(channel, context)| channel.context = context);
    }
}

/// Takes the codes of the channels out of their bits; gives the bytes that are left.
#[inline(never)]
pub(super) fn unpack<'b>(
    mut states: &[State],
    out: &mut [i32; CHUNK],
    mut codes: &'b [u8],
) -> Option<&'b [u8]> {
    let mut out = out.as_mut_slice();
    while let Some(first) = states.first() {
        let (now, later) = alike(states)?;
        states = later;
        let (out_now, out_later) =
            mem::take(&mut out).split_at_mut_checked(now.len().wrapping_add(OCTET - 1) & !(OCTET - 1))?;
        out = out_later;
        codes = match first.context {
            4 => all::<4>(now.len(), out_now, codes)?,
            5 => all::<5>(now.len(), out_now, codes)?,
            6 => all::<6>(now.len(), out_now, codes)?,
            7 => all::<7>(now.len(), out_now, codes)?,
            8 => all::<8>(now.len(), out_now, codes)?,
            _ => mixed(now, out_now, codes)?,
        };
    }
    Some(codes)
}

/// The channels of the octets that are like the first one, or of that alone where its widths differ; and those after them.
fn alike(states: &[State]) -> Option<(&[State], &[State])> {
    let octets = match states {
        [first, second, ..] if first.context > 0 => usize::from(second.context),
        _ => 1,
    };
    states.split_at_checked(octets.wrapping_mul(OCTET).min(states.len()))
}

/// So many codes of one width; those behind them, up to a whole octet, are any.
fn all<'b, const BITS: usize>(count: usize, out: &mut [i32], codes: &'b [u8]) -> Option<&'b [u8]> {
    let bytes = count.wrapping_mul(BITS).wrapping_add(7) >> 3;
    let (now, later) = codes.split_at_checked(bytes)?;
    let (octets, rest) = now.as_chunks::<BITS>();
    let (out, _) = out.as_chunks_mut::<OCTET>();
    let mut out = out.iter_mut();
    for (octet, out) in octets.iter().zip(&mut out) {
        for (lane, out) in (0..OCTET).zip(out) {
            *out = field(octet, lane);
        }
    }
    if let Some(out) = out.next() {
        whole::<BITS>(out, rest);
    }
    Some(later)
}

/// Eight codes of one width, or fewer.
#[inline(always)]
fn whole<const BITS: usize>(out: &mut [i32; OCTET], codes: &[u8]) {
    let scratch;
    let octet = if let Some(octet) = codes.first_chunk::<BITS>() {
        octet
    } else {
        scratch = filled(codes);
        &scratch
    };
    for (lane, out) in (0..OCTET).zip(out) {
        *out = field(octet, lane);
    }
}

/// Bytes, and zeros up to a whole octet.
fn filled<const BITS: usize>(bytes: &[u8]) -> [u8; BITS] {
    let mut octet = [0; BITS];
    octet.iter_mut().zip(bytes).for_each(|(slot, &byte)| *slot = byte);
    octet
}

/// Codes of any widths, up to a whole byte.
#[inline(never)]
fn mixed<'b>(states: &[State], out: &mut [i32], codes: &'b [u8]) -> Option<&'b [u8]> {
    let mut reader = BitReader::new(codes);
    for (state, out) in states.iter().zip(out) {
        let bits = state.bits();
        *out = if bits == 0 { 0 } else { reader.take_signed(bits.into()) };
    }
    codes.get(reader.position().wrapping_add(7) >> 3..)
}

/// Goes on to the next frame of codes with uniform steps; gives the bytes that are left.
#[inline(never)]
pub(super) fn step<'b, P: Predict, Q: Quantise>(
    pose: &mut [I16F16],
    states: &mut [State],
    predict: &P,
    quantise: &Q,
    codes: &'b [u8],
) -> Option<&'b [u8]> {
    let (Some(first), Some(second)) = (states.first(), states.get(1)) else {
        return run(pose, states, predict, quantise, codes);
    };
    // All of them have codes of one width: the shortest way.
    let width =
        if usize::from(second.context).wrapping_mul(OCTET) < states.len() { 0 } else { first.context };
    match width {
        4 => equal::<4, P, Q>(pose, states, predict, quantise, codes),
        5 => equal::<5, P, Q>(pose, states, predict, quantise, codes),
        6 => equal::<6, P, Q>(pose, states, predict, quantise, codes),
        7 => equal::<7, P, Q>(pose, states, predict, quantise, codes),
        8 => equal::<8, P, Q>(pose, states, predict, quantise, codes),
        _ => run(pose, states, predict, quantise, codes),
    }
}

/// The same, run by run of octets of one width.
#[inline(never)]
fn run<'b, P: Predict, Q: Quantise>(
    mut pose: &mut [I16F16],
    mut states: &mut [State],
    predict: &P,
    quantise: &Q,
    mut codes: &'b [u8],
) -> Option<&'b [u8]> {
    while let Some(first) = states.first() {
        let alike = usize::from(states.get(1).map_or(1, |second| second.context));
        let width = first.context;
        let octets = if width == 0 { 1 } else { alike };
        let count = octets.wrapping_mul(OCTET).min(states.len());
        let (now, later) = pose.split_at_mut_checked(count)?;
        let (states_now, states_later) = states.split_at_mut_checked(count)?;
        codes = match width {
            4 => equal::<4, P, Q>(now, states_now, predict, quantise, codes)?,
            5 => equal::<5, P, Q>(now, states_now, predict, quantise, codes)?,
            6 => equal::<6, P, Q>(now, states_now, predict, quantise, codes)?,
            7 => equal::<7, P, Q>(now, states_now, predict, quantise, codes)?,
            8 => equal::<8, P, Q>(now, states_now, predict, quantise, codes)?,
            _ => {
                let mut buffer = [0; OCTET];
                let left = mixed(states_now, &mut buffer, codes)?;
                given(now, states_now, predict, quantise, &buffer);
                left
            }
        };
        (pose, states) = (later, states_later);
    }
    Some(codes)
}

/// Channels whose codes all have `BITS` bits; gives the bytes that are left.
#[inline(never)]
fn equal<'b, const BITS: usize, P: Predict, Q: Quantise>(
    pose: &mut [I16F16],
    states: &mut [State],
    predict: &P,
    quantise: &Q,
    codes: &'b [u8],
) -> Option<&'b [u8]> {
    let (octets, last) = pose.as_chunks_mut::<OCTET>();
    let (octets_states, last_states) = states.as_chunks_mut::<OCTET>();
    // In 16 bits, so that the compiler sees that the product does not wrap, and need not divide by the width.
    let count = octets.len() as u16;
    let (whole, rest) = codes.split_at_checked(usize::from(count).wrapping_mul(BITS))?;
    let (whole, _) = whole.as_chunks::<BITS>();
    for ((octet, states), codes) in octets.iter_mut().zip(octets_states).zip(whole) {
        // Arrays: this loop is unrolled, and each code is at a place that the compiler knows.
        for (lane, (value, state)) in (0..OCTET).zip(octet.iter_mut().zip(states)) {
            next(value, state, predict, quantise, field(codes, lane), BITS as u8);
        }
    }
    if last.is_empty() {
        return Some(rest);
    }
    let (now, left) = rest.split_at_checked(last.len().wrapping_mul(BITS).wrapping_add(7) >> 3)?;
    let mut buffer = [0; OCTET];
    self::whole::<BITS>(&mut buffer, now);
    for ((value, state), code) in last.iter_mut().zip(last_states).zip(buffer) {
        next(value, state, predict, quantise, code, BITS as u8);
    }
    Some(left)
}

/// A channel's next value, after a code.
#[inline(always)]
pub(super) fn next<P: Predict, Q: Quantise>(
    value: &mut I16F16,
    state: &mut State,
    predict: &P,
    quantise: &Q,
    code: i32,
    bits: u8,
) {
    let last = value.to_bits();
    let predicted = predict.predict(last, state.second, state.coefficient);
    if P::KEEPS {
        state.second = last;
    }
    *value = I16F16::from_bits(predicted.wrapping_add(quantise.difference(code, &mut state.step, bits)));
}

//! Codes of fixed width, eight channels at a time: eight codes of one width are whole bytes, and each is where the compiler
//! knows.

use super::channels::{CHUNK, given};
use super::codec::{Adpcm, Codec};
use super::state::State;
use crate::bits::BitReader;
use crate::entropy::fixed_width::{BYTES_ONLY, OCTET, field};
use crate::predict::{Constant, FirstByHalves, Predict, Second};
use crate::quantise::{Adaptive, Quantise, Uniform};
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
#[cold]
#[inline(never)]
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

/// A loop over a frame's channels, chosen when a clip is opened: takes the codes off the front of a block's, and gives
/// those that are left.
pub(super) type Loop = for<'b> fn(&mut Lanes<'_>, &Codec<'_>, &'b [u8]) -> Option<&'b [u8]>;

/// What such a loop changes.
#[derive(Debug)]
pub(super) struct Lanes<'s> {
    pub pose: &'s mut [I16F16],
    pub states: &'s mut [State],
}

/// A quantiser that needs no more than is in a codec.
pub(super) trait OfCodec: Quantise + Sized {
    fn of<'c>(codec: &'c Codec<'_>) -> Option<&'c Self>;
}

impl OfCodec for Uniform {
    #[inline(always)]
    fn of<'c>(_: &'c Codec<'_>) -> Option<&'c Self> {
        Some(&Self)
    }
}

impl OfCodec for Adaptive {
    #[inline(always)]
    fn of<'c>(codec: &'c Codec<'_>) -> Option<&'c Self> {
        if let Codec::Adpcm(Adpcm { quantiser, .. }) = codec { Some(quantiser) } else { None }
    }
}

/// The loop for a codec, where there is one for octets.
pub(super) fn choose(codec: &Codec<'_>, states: &[State]) -> Option<Loop> {
    match codec {
        Codec::Pcm if cfg!(feature = "pcm") => Some(by_width::<Constant, Uniform>(states)),
        Codec::Dpcm { order: 0 | 1 } if cfg!(feature = "dpcm") => {
            Some(by_width::<FirstByHalves, Uniform>(states))
        }
        Codec::Dpcm { .. } if cfg!(feature = "dpcm") => Some(by_width::<Second, Uniform>(states)),
        Codec::Adpcm(Adpcm { quantiser, predictor: None })
            if cfg!(feature = "adaptive-step") && quantiser.adapts() =>
        {
            Some(by_width::<Second, Adaptive>(states))
        }
        _ => None,
    }
}

/// The loop for these widths.
fn by_width<P: Predict + Default, Q: OfCodec>(states: &[State]) -> Loop {
    // Where all of them have codes of one width: the shortest way.
    let width = match states {
        [first, second, ..] if usize::from(second.context).wrapping_mul(OCTET) >= states.len() => {
            first.context
        }
        _ => 0,
    };
    match width {
        4 => equal::<4, P, Q>,
        5 => equal::<5, P, Q>,
        6 => equal::<6, P, Q>,
        7 => equal::<7, P, Q>,
        8 => equal::<8, P, Q>,
        _ => run::<P, Q>,
    }
}

/// Run by run of octets of one width.
fn run<'b, P: Predict + Default, Q: OfCodec>(
    lanes: &mut Lanes<'_>,
    codec: &Codec<'_>,
    mut codes: &'b [u8],
) -> Option<&'b [u8]> {
    let (mut pose, mut states) = (&mut *lanes.pose, &mut *lanes.states);
    while let Some(first) = states.first() {
        let alike = usize::from(states.get(1).map_or(1, |second| second.context));
        let width = first.context;
        let octets = if width == 0 { 1 } else { alike };
        let count = octets.wrapping_mul(OCTET).min(states.len());
        let (now, later) = pose.split_at_mut_checked(count)?;
        let (states_now, states_later) = states.split_at_mut_checked(count)?;
        let mut lanes = Lanes { pose: now, states: states_now };
        codes = match width {
            4 => equal::<4, P, Q>(&mut lanes, codec, codes)?,
            5 => equal::<5, P, Q>(&mut lanes, codec, codes)?,
            6 => equal::<6, P, Q>(&mut lanes, codec, codes)?,
            7 => equal::<7, P, Q>(&mut lanes, codec, codes)?,
            8 => equal::<8, P, Q>(&mut lanes, codec, codes)?,
            _ => {
                let mut buffer = [0; OCTET];
                let left = mixed(lanes.states, &mut buffer, codes)?;
                given(lanes.pose, lanes.states, &P::default(), Q::of(codec)?, &buffer);
                left
            }
        };
        (pose, states) = (later, states_later);
    }
    Some(codes)
}

/// Channels whose codes all have `BITS` bits.
fn equal<'b, const BITS: usize, P: Predict + Default, Q: OfCodec>(
    lanes: &mut Lanes<'_>,
    codec: &Codec<'_>,
    codes: &'b [u8],
) -> Option<&'b [u8]> {
    let quantise = Q::of(codec)?;
    // All slices are cut to one number of octets, in 16 bits, so that the compiler need not look which ends first.
    let count = usize::from((lanes.pose.len() / OCTET) as u16);
    let channels = count.wrapping_mul(OCTET);
    let (pose, last) = lanes.pose.split_at_mut_checked(channels)?;
    let (states, last_states) = lanes.states.split_at_mut_checked(channels)?;
    let (whole, rest) = codes.split_at_checked(count.wrapping_mul(BITS))?;
    let (pose, states, whole) =
        (pose.as_chunks_mut::<OCTET>().0, states.as_chunks_mut::<OCTET>().0, whole.as_chunks::<BITS>().0);
    if (BYTES_ONLY && (5..8).contains(&BITS)) || Q::KEEPS {
        for ((values, states), codes) in pose.iter_mut().zip(states).zip(whole) {
            apart::<BITS, P, Q>(values, states, codes, quantise);
        }
    } else {
        for ((values, states), codes) in pose.iter_mut().zip(states).zip(whole) {
            octet::<BITS, P, Q>(values, states, codes, quantise);
        }
    }
    if last.is_empty() {
        return Some(rest);
    }
    let after = rest.get(last.len().wrapping_mul(BITS).wrapping_add(7) >> 3..)?;
    // Bytes behind the last code are any: only at a block's end there may be none.
    match rest.first_chunk::<BITS>() {
        Some(octet) => last_octet::<BITS, P, Q>(last, last_states, octet, quantise),
        None => last_octet::<BITS, P, Q>(last, last_states, &filled(rest), quantise),
    }
    Some(after)
}

/// Octets in a function of their own, where pointers are all that the registers have to hold.
#[inline(never)]
fn apart<const BITS: usize, P: Predict + Default, Q: Quantise>(
    values: &mut [I16F16; OCTET],
    states: &mut [State; OCTET],
    codes: &[u8; BITS],
    quantise: &Q,
) {
    octet::<BITS, P, Q>(values, states, codes, quantise);
}

/// Eight channels.
#[inline(always)]
fn octet<const BITS: usize, P: Predict + Default, Q: Quantise>(
    values: &mut [I16F16; OCTET],
    states: &mut [State; OCTET],
    codes: &[u8; BITS],
    quantise: &Q,
) {
    // Arrays: this loop is unrolled, and each code is at a place that the compiler knows.
    for (lane, (value, state)) in (0..OCTET).zip(values.iter_mut().zip(states)) {
        next(value, state, &P::default(), quantise, field(codes, lane), BITS as u8);
    }
}

/// The channels after the last whole octet, fewer than eight.
#[inline(never)]
fn last_octet<const BITS: usize, P: Predict + Default, Q: Quantise>(
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
        for (lane, (value, state)) in (0..4).zip(now.iter_mut().zip(states_now)) {
            next(value, state, &P::default(), quantise, field(codes, lane), BITS as u8);
        }
        one_by_one::<4, BITS, P, Q>(later, states_later, codes, quantise);
    } else {
        one_by_one::<0, BITS, P, Q>(values, states, codes, quantise);
    }
}

/// Channels from lane `FIRST` to at most the one before the last.
#[inline(always)]
fn one_by_one<const FIRST: usize, const BITS: usize, P: Predict + Default, Q: Quantise>(
    values: &mut [I16F16],
    states: &mut [State],
    codes: &[u8; BITS],
    quantise: &Q,
) {
    let Some(states) = states.get_mut(..values.len()) else { return };
    for at in 0..OCTET.wrapping_sub(FIRST).wrapping_sub(1) {
        let (Some(value), Some(state)) = (values.get_mut(at), states.get_mut(at)) else { break };
        next(value, state, &P::default(), quantise, field(codes, FIRST.wrapping_add(at)), BITS as u8);
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mclip::{Channel, ChannelKind};
    use crate::quantise::step::size;
    use crate::testing::Random;
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
            widths.iter().map(|bits| State::of(&Codec::Dpcm { order: 1 }, &channel(bits))).collect();
        mark(&mut states);
        states
    }

    /// One code after the other, and the bytes that they take.
    fn one_after_the_other(widths: &[u8], codes: &[u8]) -> (Vec<i32>, usize) {
        let mut reader = BitReader::new(codes);
        let mut found = Vec::new();
        for octet in widths.chunks(OCTET) {
            found.extend(octet.iter().map(|&bits| reader.take_signed(bits.into())));
            reader.align();
        }
        (found, reader.position() >> 3)
    }

    /// Every number of channels of every width, and octets of several: with more bytes behind them, and at the end of a block.
    #[test]
    fn codes_are_those_of_a_reader_of_bits() {
        let mut random = Random(12);
        let mut all: Vec<Vec<u8>> = Vec::new();
        for width in 3..=9u8 {
            all.extend((1..=CHUNK).map(|count| std::vec![width; count]));
        }
        all.push([[5; OCTET], [5; OCTET], [7; OCTET], [3; OCTET], [7; OCTET]].concat());
        all.push([&[6; OCTET][..], &[4, 5, 6], &[]].concat());
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
                let codec = Codec::Dpcm { order: 1 };
                let run = choose(&codec, &states).unwrap();
                let mut lanes = Lanes { pose: &mut pose, states: &mut states };
                let rest = run(&mut lanes, &codec, codes).map(<[u8]>::len);
                assert_eq!(rest, Some(codes.len() - bytes), "{widths:?}");
                let steps: Vec<i32> = pose.iter().map(|value| value.to_bits() / size(104)).collect();
                assert_eq!(steps, expected, "{widths:?}");
                // A byte less is none too many.
                let mut lanes = Lanes { pose: &mut pose, states: &mut states };
                assert!(run(&mut lanes, &codec, &codes[..bytes - 1]).is_none());
            }
        }
    }
}

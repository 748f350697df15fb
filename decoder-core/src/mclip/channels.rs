//! The loops over a frame's channels, each compiled for one codec and one source of codes.
//!
//! They are functions of their own, never inlined: together they would share registers, and each would keep its
//! pointers on the stack. What codes come from is given and returned by value for the same reason.

use super::codec::{Adaptation, Adpcm, Codec};
use super::state::{State, pair, unpair};
use crate::bits::{BitReader, MAX_TAKE};
use crate::entropy::fixed_width::{OCTET, field};
use crate::entropy::{FixedWidth, SymbolSource};
use crate::predict::{Constant, Correlation, First, Predict, Second, Slots};
use crate::quantise::{Quantise, Uniform};
use fixed::types::I16F16;

/// Where the codes of a frame come from: the bits of a block, or an encoder that looks for the best ones.
///
/// So an encoder runs the decoder's own loop, with its predictors and quantisers.
pub trait Choose {
    /// What a loop holds while it runs: a local of it, so that it stays in registers.
    type Running;

    /// Before a frame's first channel.
    fn begin(&self) -> Self::Running;

    /// After its last one.
    fn end(&mut self, running: Self::Running);

    /// The value of channel `channel` at an entry point, in steps of `2^shift`, in `bits` bits (1 to 32) with its sign.
    fn entry(&mut self, running: &mut Self::Running, channel: usize, shift: u32, bits: u32) -> i32;

    /// The code of channel `channel`, whose prediction is `predicted`; `None` where it has none, as with 0 bits.
    fn code<Q: Quantise>(
        &mut self,
        running: &mut Self::Running,
        channel: usize,
        predicted: i32,
        quantiser: &Q,
        state: &mut State,
    ) -> Option<i32>;
}

/// Codes from the bits of a block.
pub(super) struct Decode<'b, S> {
    pub codes: &'b [u8],
    /// The next bit; past the end after an overrun.
    pub position: usize,
    pub source: S,
}

impl<S> Decode<'_, S> {
    /// The next bit, or `Err` where there are not so many.
    pub const fn finish(&self) -> Result<usize, ()> {
        if self.position > self.codes.len().saturating_mul(8) { Err(()) } else { Ok(self.position) }
    }
}

impl<'b, S: SymbolSource> Choose for Decode<'b, S> {
    type Running = BitReader<'b>;

    #[inline(always)]
    fn begin(&self) -> BitReader<'b> {
        BitReader::at(self.codes, self.position)
    }

    #[inline(always)]
    fn end(&mut self, running: BitReader<'b>) {
        self.position = running.position();
    }

    #[inline(always)]
    fn entry(&mut self, running: &mut BitReader<'b>, _: usize, _: u32, bits: u32) -> i32 {
        if bits <= MAX_TAKE {
            return running.take_signed(bits);
        }
        let high = running.take_signed(bits.wrapping_sub(MAX_TAKE));
        high.wrapping_shl(MAX_TAKE) | running.take(MAX_TAKE).cast_signed()
    }

    #[inline(always)]
    fn code<Q: Quantise>(
        &mut self,
        running: &mut BitReader<'b>,
        channel: usize,
        _: i32,
        _: &Q,
        state: &mut State,
    ) -> Option<i32> {
        self.source.code(running, channel, state.bits(), &mut state.context)
    }
}

/// The channels of a frame.
pub(super) struct Channels<'c> {
    pub pose: &'c mut [I16F16],
    pub states: &'c mut [State],
    pub correlations: &'c mut [Correlation],
    /// The windows of predictors that have a sliding one, channel after channel.
    pub rings: &'c mut [u16],
    /// Frames since the entry point.
    pub frame: u32,
}

impl Channels<'_> {
    /// Goes on to the next frame, whose codes `choose` gives.
    #[inline(always)]
    pub fn step<C: Choose>(self, codec: &Codec<'_>, choose: &mut C) {
        let Self { pose, states, correlations, rings, frame } = self;
        match codec {
            Codec::Pcm => serial(pose, states, &Constant, &Uniform, choose),
            Codec::MuLaw(law) => serial(pose, states, &First, law, choose),
            Codec::Dpcm { order: 0 | 1 } => serial(pose, states, &First, &Uniform, choose),
            Codec::Adpcm(Adpcm { quantiser, predictor: None }) if quantiser.adapts() => {
                serial(pose, states, &Second, quantiser, choose);
            }
            Codec::Dpcm { .. } | Codec::Adpcm(Adpcm { predictor: None, .. }) => {
                serial(pose, states, &Second, &Uniform, choose);
            }
            Codec::Adpcm(Adpcm { quantiser, predictor: Some(adaptation) }) => {
                let adaptation = *adaptation;
                let words = adaptation.ring_words();
                if words > 0 {
                    let slots = Slots::at(frame, adaptation.window);
                    let rings = correlations.iter_mut().zip(rings.chunks_exact_mut(words));
                    let follow = rings.map(|(correlation, ring)| Sliding { correlation, ring, slots });
                    // A step that does not adapt is kept as a size, not as an index.
                    if quantiser.adapts() {
                        adaptive(pose, states, follow, quantiser, choose);
                    } else {
                        adaptive(pose, states, follow, &Uniform, choose);
                    }
                } else {
                    let window = adaptation.window.into();
                    let follow =
                        correlations.iter_mut().map(|correlation| Exponential { correlation, window });
                    if quantiser.adapts() {
                        adaptive(pose, states, follow, quantiser, choose);
                    } else {
                        adaptive(pose, states, follow, &Uniform, choose);
                    }
                }
                solve(states, correlations, adaptation, frame);
            }
            Codec::Qmd(table) => serial(pose, states, &First, table, choose),
        }
    }

    /// Goes on to the next frame, whose codes of fixed width begin at a whole byte; gives the bytes that are left, or
    /// `None` where there are too few.
    #[inline(always)]
    pub fn step_fixed_width<'b>(self, codec: &Codec<'_>, codes: &'b [u8]) -> Option<&'b [u8]> {
        match codec {
            Codec::Pcm => octets(self.pose, self.states, &Constant, &Uniform, codes),
            Codec::Dpcm { order: 0 | 1 } => octets(self.pose, self.states, &First, &Uniform, codes),
            Codec::Adpcm(Adpcm { quantiser, predictor: None }) if quantiser.adapts() => {
                octets(self.pose, self.states, &Second, quantiser, codes)
            }
            Codec::Dpcm { .. } | Codec::Adpcm(Adpcm { predictor: None, .. }) => {
                octets(self.pose, self.states, &Second, &Uniform, codes)
            }
            _ => {
                let mut decode = Decode { codes, position: 0, source: FixedWidth };
                self.step(codec, &mut decode);
                codes.get(decode.position.wrapping_add(7) >> 3..)
            }
        }
    }
}

/// A channel's next value, after a code.
#[inline(always)]
fn next<P: Predict, Q: Quantise>(
    value: &mut I16F16,
    state: &mut State,
    predicted: i32,
    quantise: &Q,
    code: i32,
    bits: u8,
) {
    if P::KEEPS {
        state.second = value.to_bits();
    }
    *value = I16F16::from_bits(predicted.wrapping_add(quantise.difference(code, &mut state.step, bits)));
}

/// Channel after channel.
#[inline(never)]
fn serial<P: Predict, Q: Quantise, C: Choose>(
    pose: &mut [I16F16],
    states: &mut [State],
    predict: &P,
    quantise: &Q,
    choose: &mut C,
) {
    let mut running = choose.begin();
    let mut channel = 0usize;
    for (value, state) in pose.iter_mut().zip(states) {
        let predicted = predict.predict(value.to_bits(), state.second, state.coefficient);
        if let Some(code) = choose.code(&mut running, channel, predicted, quantise, state) {
            next::<P, Q>(value, state, predicted, quantise, code, state.bits());
        }
        channel = channel.wrapping_add(1);
    }
    choose.end(running);
}

/// What follows a channel's movements.
trait Follow {
    fn correlation(&self) -> &Correlation;

    /// Takes in a movement.
    fn add(&mut self, movement: i32);
}

/// By an exponential window.
struct Exponential<'c> {
    correlation: &'c mut Correlation,
    window: u32,
}

impl Follow for Exponential<'_> {
    #[inline(always)]
    fn correlation(&self) -> &Correlation {
        self.correlation
    }

    #[inline(always)]
    fn add(&mut self, movement: i32) {
        self.correlation.add(movement, self.window);
    }
}

/// By a sliding window.
struct Sliding<'c> {
    correlation: &'c mut Correlation,
    ring: &'c mut [u16],
    slots: Slots,
}

impl Follow for Sliding<'_> {
    #[inline(always)]
    fn correlation(&self) -> &Correlation {
        self.correlation
    }

    #[inline(always)]
    fn add(&mut self, movement: i32) {
        self.correlation.slide(movement, self.ring, self.slots);
    }
}

/// Channel after channel, where coefficients follow the channel.
#[inline(never)]
fn adaptive<F: Follow, Q: Quantise, C: Choose>(
    pose: &mut [I16F16],
    states: &mut [State],
    followers: impl Iterator<Item = F>,
    quantise: &Q,
    choose: &mut C,
) {
    let mut running = choose.begin();
    let mut channel = 0usize;
    for ((value, state), mut follower) in pose.iter_mut().zip(states).zip(followers) {
        let last = value.to_bits();
        let predicted = follower.correlation().predict(unpair(state.second), last);
        if let Some(code) = choose.code(&mut running, channel, predicted, quantise, state) {
            let bits = state.bits();
            let next = predicted.wrapping_add(quantise.difference(code, &mut state.step, bits));
            follower.add(next.wrapping_sub(last));
            *value = I16F16::from_bits(next);
        }
        channel = channel.wrapping_add(1);
    }
    choose.end(running);
}

/// Solves for the coefficients of channel c after frame n since the entry point where n + c is a multiple of the period,
/// so that the divisions of a frame's channels are spread over the period.
#[inline(never)]
fn solve(states: &mut [State], correlations: &[Correlation], adaptation: Adaptation, frame: u32) {
    let period = 1usize.wrapping_shl(adaptation.period.into());
    let first = (frame.wrapping_neg() as usize) & period.wrapping_sub(1);
    let mut channels = states.get_mut(first..).unwrap_or_default();
    let mut correlations = correlations.get(first..).unwrap_or_default();
    while let (Some(state), Some(correlation)) = (channels.first_mut(), correlations.first()) {
        state.second = pair(correlation.solve());
        channels = channels.get_mut(period..).unwrap_or_default();
        correlations = correlations.get(period..).unwrap_or_default();
    }
}

/// Widths that [`equal`] is compiled for.
const WIDTHS: core::ops::RangeInclusive<u8> = 4..=8;

/// Marks octets of channels whose codes all have as many bits, for [`octets`]: in the first channel these bits, or 0
/// where they differ, and in the second how many octets in sequence are like it, as far as a byte can say. The last octet
/// may have fewer channels.
pub(super) fn mark_octets(states: &mut [State]) {
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

/// Codes of fixed width, eight channels at a time where these have codes of equal width.
#[inline(never)]
fn octets<'b, P: Predict, Q: Quantise>(
    mut pose: &mut [I16F16],
    mut states: &mut [State],
    predict: &P,
    quantise: &Q,
    mut codes: &'b [u8],
) -> Option<&'b [u8]> {
    while let Some(first) = states.first() {
        let (width, alike) = (first.context, states.get(1).map_or(1, |second| second.context));
        let done = usize::from(alike).wrapping_mul(OCTET).min(states.len());
        let (now, later) = pose.split_at_mut_checked(done)?;
        let (states_now, states_later) = states.split_at_mut_checked(done)?;
        codes = match width {
            4 => equal::<4, P, Q>(now, states_now, predict, quantise, codes)?,
            5 => equal::<5, P, Q>(now, states_now, predict, quantise, codes)?,
            6 => equal::<6, P, Q>(now, states_now, predict, quantise, codes)?,
            7 => equal::<7, P, Q>(now, states_now, predict, quantise, codes)?,
            8 => equal::<8, P, Q>(now, states_now, predict, quantise, codes)?,
            _ => {
                let mut decode = Decode { codes, position: 0, source: FixedWidth };
                serial(now, states_now, predict, quantise, &mut decode);
                codes.get(decode.position.wrapping_add(7) >> 3..)?
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
    let step = |value: &mut I16F16, state: &mut State, octet: &[u8; BITS], lane: usize| {
        let predicted = predict.predict(value.to_bits(), state.second, state.coefficient);
        next::<P, Q>(value, state, predicted, quantise, field(octet, lane), BITS as u8);
    };
    let (whole, _) = whole.as_chunks::<BITS>();
    for ((octet, states), codes) in octets.iter_mut().zip(octets_states).zip(whole) {
        // Arrays: this loop is unrolled, and each code is at a place that the compiler knows.
        for (lane, (value, state)) in (0..OCTET).zip(octet.iter_mut().zip(states)) {
            step(value, state, codes, lane);
        }
    }
    let (taken, left) = rest.split_at_checked(last.len().wrapping_mul(BITS).wrapping_add(7) >> 3)?;
    let mut lanes = last.iter_mut().zip(last_states);
    // What is behind the codes does not matter.
    let scratch;
    let octet = if let Some(octet) = rest.first_chunk::<BITS>() {
        octet
    } else {
        scratch = filled(taken);
        &scratch
    };
    for lane in 0..OCTET {
        let Some((value, state)) = lanes.next() else { break };
        step(value, state, octet, lane);
    }
    Some(left)
}

/// Bytes, and zeros up to a whole octet.
#[cold]
fn filled<const BITS: usize>(bytes: &[u8]) -> [u8; BITS] {
    let mut octet = [0; BITS];
    octet.iter_mut().zip(bytes).for_each(|(slot, &byte)| *slot = byte);
    octet
}

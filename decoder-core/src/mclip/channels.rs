//! The loops over a frame's channels, each compiled for one codec and one source of codes.
//!
//! They are functions of their own, never inlined: together they would share registers, and each would keep its
//! pointers on the stack. What codes come from is given and returned by value for the same reason.

use super::codec::{Adaptation, Adpcm, Codec};
use super::state::{State, pair, unpair};
use crate::bits::BitReader;
use crate::entropy::fixed_width::{OCTET, field};
use crate::entropy::{FixedWidth, SymbolSource};
use crate::predict::{Constant, Correlation, First, Predict, Second};
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

    /// The value of channel `channel` at an entry point, in steps of `2^shift` from its lowest, in `bits` bits.
    fn entry(&mut self, running: &mut Self::Running, channel: usize, low: i32, shift: u8, bits: u32) -> u32;

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
    fn entry(&mut self, running: &mut BitReader<'b>, _: usize, _: i32, _: u8, bits: u32) -> u32 {
        let low = bits.min(16);
        let high = running.take(bits.saturating_sub(low));
        high.wrapping_shl(low) | running.take(low)
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
        self.source.code(running, channel, state.bits, &mut state.context)
    }
}

/// The channels of a frame.
pub(super) struct Channels<'c> {
    pub pose: &'c mut [I16F16],
    pub states: &'c mut [State],
    pub correlations: &'c mut [Correlation],
    /// Frames since the entry point.
    pub frame: u32,
}

impl Channels<'_> {
    /// Goes on to the next frame, whose codes `choose` gives.
    #[inline(always)]
    pub fn step<C: Choose>(self, codec: &Codec<'_>, choose: &mut C) {
        let Self { pose, states, correlations, frame } = self;
        match codec {
            Codec::Pcm => serial(pose, states, &Constant, &Uniform, choose),
            Codec::MuLaw(law) => serial(pose, states, &First, law, choose),
            Codec::Dpcm { order: 0 | 1 } => serial(pose, states, &First, &Uniform, choose),
            Codec::Dpcm { .. } => serial(pose, states, &Second, &Uniform, choose),
            Codec::Adpcm(Adpcm { quantiser, predictor: None }) => {
                serial(pose, states, &Second, quantiser, choose);
            }
            Codec::Adpcm(Adpcm { quantiser, predictor: Some(adaptation) }) => {
                adaptive(pose, states, correlations, *adaptation, frame, quantiser, choose);
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
            Codec::Adpcm(Adpcm { quantiser, predictor: None }) => {
                octets(self.pose, self.states, &Second, quantiser, codes)
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
            next::<P, Q>(value, state, predicted, quantise, code, state.bits);
        }
        channel = channel.wrapping_add(1);
    }
    choose.end(running);
}

/// Channel after channel, where coefficients follow the channel.
///
/// Channel c solves for its coefficients after frame n since the entry point where n + c is a multiple of the
/// period, so that the divisions of a frame's channels are spread over the period.
#[inline(never)]
fn adaptive<Q: Quantise, C: Choose>(
    pose: &mut [I16F16],
    states: &mut [State],
    correlations: &mut [Correlation],
    adaptation: Adaptation,
    frame: u32,
    quantise: &Q,
    choose: &mut C,
) {
    let mut running = choose.begin();
    let mask = 1u32.wrapping_shl(adaptation.period.into()).wrapping_sub(1);
    let mut channel = 0usize;
    for ((value, state), correlation) in pose.iter_mut().zip(states).zip(correlations) {
        let last = value.to_bits();
        let predicted = correlation.predict(unpair(state.second), last);
        if let Some(code) = choose.code(&mut running, channel, predicted, quantise, state) {
            let next = predicted.wrapping_add(quantise.difference(code, &mut state.step, state.bits));
            correlation.add(next.wrapping_sub(last), adaptation.window.into());
            if frame.wrapping_add(channel as u32) & mask == 0 {
                state.second = pair(correlation.solve());
            }
            *value = I16F16::from_bits(next);
        }
        channel = channel.wrapping_add(1);
    }
    choose.end(running);
}

/// Marks the octets of channels whose codes all have as many bits, for [`octets`]: in the first channel these bits, or 0
/// where they differ, and in the second how many octets in sequence are like it, as far as a byte can say.
pub(super) fn mark_octets(states: &mut [State]) {
    let (octets, _) = states.as_chunks_mut::<OCTET>();
    let (mut width_after, mut alike) = (0u8, 0u8);
    for octet in octets.iter_mut().rev() {
        let [first, second, others @ ..] = octet;
        let same = second.bits == first.bits && others.iter().all(|other| other.bits == first.bits);
        let width = if same && first.bits <= 8 { first.bits } else { 0 };
        alike = if width == width_after { alike.saturating_add(1) } else { 1 };
        width_after = width;
        first.context = width;
        second.context = alike;
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
    while !states.is_empty() {
        let (width, count) = match states.first_chunk::<OCTET>() {
            Some([first, second, ..]) => (first.context, second.context),
            None => (0, 1),
        };
        let done = usize::from(count).wrapping_mul(OCTET).min(states.len());
        let (now, later) = pose.split_at_mut_checked(done)?;
        let (states_now, states_later) = states.split_at_mut_checked(done)?;
        let run = Run { pose: now, states: states_now, count, codes };
        codes = match width {
            1 => run.equal::<1, P, Q>(predict, quantise)?,
            2 => run.equal::<2, P, Q>(predict, quantise)?,
            3 => run.equal::<3, P, Q>(predict, quantise)?,
            4 => run.equal::<4, P, Q>(predict, quantise)?,
            5 => run.equal::<5, P, Q>(predict, quantise)?,
            6 => run.equal::<6, P, Q>(predict, quantise)?,
            7 => run.equal::<7, P, Q>(predict, quantise)?,
            8 => run.equal::<8, P, Q>(predict, quantise)?,
            _ => {
                let mut decode = Decode { codes, position: 0, source: FixedWidth };
                serial(run.pose, run.states, predict, quantise, &mut decode);
                codes.get(decode.position.wrapping_add(7) >> 3..)?
            }
        };
        (pose, states) = (later, states_later);
    }
    Some(codes)
}

/// Octets that are alike.
struct Run<'c, 'b> {
    pose: &'c mut [I16F16],
    states: &'c mut [State],
    /// Number of octets: a byte, so that the compiler sees that no product with a width wraps, and need not divide by it.
    count: u8,
    codes: &'b [u8],
}

impl<'b> Run<'_, 'b> {
    /// Octets whose codes all have `BITS` bits; gives the bytes that are left.
    #[inline(never)]
    fn equal<const BITS: usize, P: Predict, Q: Quantise>(
        self,
        predict: &P,
        quantise: &Q,
    ) -> Option<&'b [u8]> {
        let (pose, _) = self.pose.as_chunks_mut::<OCTET>();
        let (states, _) = self.states.as_chunks_mut::<OCTET>();
        let (codes, left) = self.codes.split_at_checked(usize::from(self.count).wrapping_mul(BITS))?;
        let (codes, _) = codes.as_chunks::<BITS>();
        for ((pose, states), octet) in pose.iter_mut().zip(states).zip(codes) {
            // Arrays: this loop is unrolled, and each code is at a place that the compiler knows.
            for (lane, (value, state)) in pose.iter_mut().zip(states).enumerate() {
                let predicted = predict.predict(value.to_bits(), state.second, state.coefficient);
                next::<P, Q>(value, state, predicted, quantise, field(octet, lane), BITS as u8);
            }
        }
        Some(left)
    }
}

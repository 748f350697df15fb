//! The loops over a frame's channels, each compiled for one predictor and one quantiser.
//!
//! Codes are taken out of their bits before, a few channels at a time ([`CHUNK`]): so there is one loop for each source of
//! codes and one for each codec, not one for each pair of them, and a loop's numbers fit the registers. They are functions of
//! their own, never inlined: together they would share registers, and each would keep its pointers on the stack.

use crate::bits::reader::BitReader;
use crate::entropy::symbols::SymbolSource;
use crate::predict::fixed::Predict;
use crate::quantise::quantiser::Quantise;
use crate::quantise::uniform::Uniform;
use crate::state::State;
use core::iter::Copied;
use core::ops::Range;
use core::slice;
use fixed::types::I16F16;

/// Channels whose codes are held at a time; whole byte groups.
pub const CHUNK: usize = 64;

/// An encoder, which looks for the best codes: with the decoder's own loop, and its predictors and quantisers.
pub trait Choose {
    /// The value of channel `channel` at an entry point, in steps of `2^shift`, in `bits` bits (1 to 32) with its sign.
    fn entry(&mut self, channel: usize, shift: u32, bits: u32) -> i32;

    /// The code of channel `channel`, whose prediction is `predicted`; 0 where it has 0 bits.
    fn code<Q: Quantise>(&mut self, channel: usize, predicted: i32, quantiser: &Q, state: &State) -> i32;
}

/// Where the codes of a frame come from: what was taken out of bits, or an encoder.
pub trait Codes {
    /// What a channel's code is found by.
    type Item;
    /// Of all channels.
    type Items: Iterator<Item = Self::Item>;

    /// For each channel in order.
    fn items(&self) -> Self::Items;

    /// A channel's code.
    fn code<Q: Quantise>(&mut self, item: Self::Item, predicted: i32, quantiser: &Q, state: &State) -> i32;

    /// The loop of codecs with uniform steps.
    fn uniform<P: Predict>(&mut self, pose: &mut [I16F16], states: &mut [State], predict: &P);
}

/// Codes that were taken out of their bits.
pub(super) struct ReadCodes<'g>(pub &'g [i32]);

impl<'g> Codes for ReadCodes<'g> {
    type Item = i32;
    type Items = Copied<slice::Iter<'g, i32>>;

    #[inline(always)]
    fn items(&self) -> Self::Items {
        self.0.iter().copied()
    }

    #[inline(always)]
    fn code<Q: Quantise>(&mut self, code: i32, _: i32, _: &Q, _: &State) -> i32 {
        code
    }

    #[inline(always)]
    fn uniform<P: Predict>(&mut self, pose: &mut [I16F16], states: &mut [State], predict: &P) {
        serial_of_codes(pose, states, predict, &Uniform, self.0);
    }
}

/// An encoder's codes, by the number of the channel.
pub(super) struct ChosenCodes<'c, C>(pub &'c mut C);

impl<C: Choose> Codes for ChosenCodes<'_, C> {
    type Item = usize;
    type Items = Range<usize>;

    fn items(&self) -> Range<usize> {
        0..usize::MAX
    }

    fn code<Q: Quantise>(&mut self, channel: usize, predicted: i32, quantiser: &Q, state: &State) -> i32 {
        self.0.code(channel, predicted, quantiser, state)
    }

    fn uniform<P: Predict>(&mut self, pose: &mut [I16F16], states: &mut [State], predict: &P) {
        serial(pose, states, predict, &Uniform, self);
    }
}

/// Which frame it is, for what depends on it.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Frames since the entry point.
    pub frame: u32,
    /// The frame's row in a ring of rows, where a codec keeps something of the last frames.
    pub row: usize,
    /// Rows of that ring; 0 where there is none.
    pub rows: usize,
    /// Channels of a frame.
    pub channels: usize,
}

impl Clock {
    /// Goes on to the next frame.
    pub(super) fn advance(&mut self) {
        self.frame = self.frame.wrapping_add(1);
        let next = self.row.wrapping_add(1);
        self.row = if next < self.rows { next } else { 0 };
    }
}

/// Some of the channels of a frame, and all that their next values depend on.
pub struct Part<'c> {
    /// Their last values.
    pub pose: &'c mut [I16F16],
    /// Their states.
    pub states: &'c mut [State],
    /// The codec's 32-bit words, those of all channels.
    pub words: &'c mut [u32],
    /// The codec's 16-bit words, those of all channels.
    pub halves: &'c mut [u16],
    /// Which frame it is.
    pub clock: &'c Clock,
    /// The first one's number.
    pub channel: usize,
}

impl Part<'_> {
    /// Takes the first `count` channels away.
    pub(super) fn chunk(&mut self, count: usize) -> Part<'_> {
        let channel = self.channel;
        self.channel = channel.wrapping_add(count);
        Part {
            pose: first(&mut self.pose, count),
            states: first(&mut self.states, count),
            words: self.words,
            halves: self.halves,
            clock: self.clock,
            channel,
        }
    }
}

/// Takes at most `count` elements off a slice.
fn first<'c, T>(slice: &mut &'c mut [T], count: usize) -> &'c mut [T] {
    let count = count.min(slice.len());
    slice.split_off_mut(..count).unwrap_or_default()
}

/// Takes codes out of their bits from `position` on, one for each of the states; gives where they end. The reader is a local of
/// the loop, so that it stays in registers.
#[inline(never)]
pub(super) fn fill<S: SymbolSource>(
    source: &mut S,
    codes: &[u8],
    position: usize,
    states: &mut [State],
    out: &mut [i32; CHUNK],
) -> usize {
    let mut reader = BitReader::at(codes, position);
    for (state, code) in states.iter_mut().zip(out) {
        *code = source.code(&mut reader, state.bits(), &mut state.context);
    }
    reader.position()
}

/// Channel after channel.
#[inline(never)]
pub fn serial<P: Predict, Q: Quantise, C: Codes>(
    pose: &mut [I16F16],
    states: &mut [State],
    predict: &P,
    quantise: &Q,
    codes: &mut C,
) {
    for ((value, state), item) in pose.iter_mut().zip(states).zip(codes.items()) {
        let last = value.to_bits();
        let predicted = predict.predict(last, state.second, state.coefficient);
        let code = codes.code(item, predicted, quantise, state);
        if P::KEEPS {
            state.second = last;
        }
        let bits = state.bits();
        *value = I16F16::from_bits(predicted.wrapping_add(quantise.difference(code, &mut state.step, bits)));
    }
}

/// Channel after channel, whose codes are these.
#[inline(always)]
pub(super) fn serial_of_codes<P: Predict, Q: Quantise>(
    pose: &mut [I16F16],
    states: &mut [State],
    predict: &P,
    quantise: &Q,
    codes: &[i32],
) {
    serial(pose, states, predict, quantise, &mut ReadCodes(codes));
}

/// Channel after channel, with uniform steps and codes out of their bits from `position` on; gives where they end.
///
/// What [`fill`] and [`serial`] do, in one loop: for the codecs that are most used.
#[inline(never)]
pub fn fused<P: Predict, S: SymbolSource>(
    pose: &mut [I16F16],
    states: &mut [State],
    predict: &P,
    source: &mut S,
    codes: &[u8],
    position: usize,
) -> usize {
    let mut reader = BitReader::at(codes, position);
    for (value, state) in pose.iter_mut().zip(states) {
        let code = source.code(&mut reader, state.bits(), &mut state.context);
        step_channel(value, state, predict, &Uniform, code, 0);
    }
    reader.position()
}

/// A channel's next value, after a code.
#[inline(always)]
pub(super) fn step_channel<P: Predict, Q: Quantise>(
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

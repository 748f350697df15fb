//! The loops over a frame's channels, each compiled for one predictor and one quantiser.
//!
//! Codes are taken out of their bits before, a few channels at a time ([`CHUNK`]): so there is one loop for each source of
//! codes and one for each codec, not one for each pair of them, and a loop's numbers fit the registers. They are functions of
//! their own, never inlined: together they would share registers, and each would keep its pointers on the stack.

use super::codec::{Adaptation, Adpcm, Codec};
use super::octets::{self, next};
use super::state::{State, pair, unpair};
use crate::bits::BitReader;
use crate::entropy::SymbolSource;
use crate::predict::window::Rows;
use crate::predict::{self, Constant, Correlation, First, Predict, Ring, Second};
use crate::quantise::{Quantise, Uniform};
use core::cell::Cell;
use core::iter::Copied;
use core::ops::Range;
use core::slice;
use fixed::types::I16F16;

/// Channels whose codes are held at a time; whole octets.
pub(super) const CHUNK: usize = 64;

/// An encoder, which looks for the best codes: with the decoder's own loop, and its predictors and quantisers.
pub trait Choose {
    /// The value of channel `channel` at an entry point, in steps of `2^shift`, in `bits` bits (1 to 32) with its sign.
    fn entry(&mut self, channel: usize, shift: u32, bits: u32) -> i32;

    /// The code of channel `channel`, whose prediction is `predicted`; 0 where it has 0 bits.
    fn code<Q: Quantise>(&mut self, channel: usize, predicted: i32, quantiser: &Q, state: &State) -> i32;
}

/// Where the codes of a frame come from: what was taken out of bits, or an encoder.
pub(super) trait Codes {
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
struct Given<'g>(&'g [i32]);

impl<'g> Codes for Given<'g> {
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
        given(pose, states, predict, &Uniform, self.0);
    }
}

/// An encoder's codes, by the number of the channel.
struct Chosen<'c, C>(&'c mut C);

impl<C: Choose> Codes for Chosen<'_, C> {
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

/// The channels of a frame, or some of them.
pub(super) struct Channels<'c> {
    pub pose: &'c mut [I16F16],
    pub states: &'c mut [State],
    pub correlations: &'c mut [Correlation],
    /// The windows of predictors that have a sliding one, frame after frame.
    pub windows: &'c mut [u16],
    /// Which frame it is.
    pub at: &'c mut At,
}

/// Which frame it is, for what depends on it.
#[derive(Clone, Copy, Debug)]
pub(super) struct At {
    /// Frames since the entry point.
    pub frame: u32,
    /// The frame's row in the ring of sliding windows.
    pub row: usize,
    /// Frames of these windows; 0 where there are none.
    pub length: usize,
    /// Channels of a frame.
    pub channels: usize,
}

impl At {
    /// Goes on to the next frame.
    fn advance(&mut self) {
        self.frame = self.frame.wrapping_add(1);
        let next = self.row.wrapping_add(1);
        self.row = if next < self.length { next } else { 0 };
    }

    /// The ring of sliding windows.
    fn ring(&self) -> Ring {
        let &Self { frame, row, length, channels } = self;
        Ring { channels, length, row, count: (frame as usize).min(length) }
    }
}

impl Channels<'_> {
    /// Goes on to the next frame, whose codes `choose` gives.
    pub fn step<C: Choose>(mut self, codec: &Codec<'_>, choose: &mut C) {
        self.all().run(codec, &mut Chosen(choose));
        self.solve(codec);
    }

    /// Goes on to the next frame, whose codes begin at bit `position`; gives where they end, which may be past the last one.
    pub fn step_coded<S: SymbolSource>(
        mut self,
        codec: &Codec<'_>,
        codes: &[u8],
        mut position: usize,
        mut source: S,
    ) -> usize {
        match codec {
            Codec::Dpcm { order: 0 | 1 } if cfg!(feature = "dpcm") => {
                return fused(self.pose, self.states, &First, &mut source, codes, position);
            }
            Codec::Dpcm { .. } if cfg!(feature = "dpcm") => {
                return fused(self.pose, self.states, &Second, &mut source, codes, position);
            }
            _ => {}
        }
        let mut buffer = [0; CHUNK];
        let mut rest = self.all();
        while !rest.pose.is_empty() {
            let now = rest.chunk(CHUNK);
            position = fill(&mut source, codes, position, now.states, &mut buffer);
            now.run(codec, &mut Given(&buffer));
        }
        self.solve(codec);
        position
    }

    /// Goes on to the next frame, whose codes of fixed width begin at a whole byte; gives the bytes that are left, or
    /// `None` where there are too few.
    #[inline(never)]
    pub fn step_unpacked<'b>(mut self, codec: &Codec<'_>, mut codes: &'b [u8]) -> Option<&'b [u8]> {
        let mut buffer = [0; CHUNK];
        let mut rest = self.all();
        while !rest.pose.is_empty() {
            let now = rest.chunk(CHUNK);
            codes = octets::unpack(now.states, &mut buffer, codes)?;
            now.run(codec, &mut Given(&buffer));
        }
        self.solve(codec);
        Some(codes)
    }

    /// All of them, once it is the next frame.
    fn all(&mut self) -> Part<'_> {
        let Self { pose, states, correlations, windows, at } = self;
        at.advance();
        Part { pose, states, correlations, windows, at, channel: 0 }
    }

    /// Solves for coefficients, where they adapt, after a frame.
    fn solve(self, codec: &Codec<'_>) {
        if let Codec::Adpcm(Adpcm { predictor: Some(adaptation), .. }) = codec
            && cfg!(feature = "adaptive-predictor")
        {
            let frame = self.at.frame;
            if self.at.length > 0 {
                let ring = self.at.ring();
                solve(self.states, |channel| ring.sums(self.windows, channel), *adaptation, frame);
            } else {
                let sums = |channel| self.correlations.get(channel).map_or([0; 3], Correlation::sums);
                solve(self.states, sums, *adaptation, frame);
            }
        }
    }
}

/// Some of the channels of a frame.
struct Part<'c> {
    pose: &'c mut [I16F16],
    states: &'c mut [State],
    correlations: &'c mut [Correlation],
    windows: &'c mut [u16],
    at: &'c At,
    /// The first one's number.
    channel: usize,
}

impl Part<'_> {
    /// Takes the first `count` channels away.
    fn chunk(&mut self, count: usize) -> Part<'_> {
        let channel = self.channel;
        self.channel = channel.wrapping_add(count);
        Part {
            pose: first(&mut self.pose, count),
            states: first(&mut self.states, count),
            correlations: first(&mut self.correlations, count),
            windows: self.windows,
            at: self.at,
            channel,
        }
    }

    /// Goes on to the next values.
    #[inline(always)]
    fn run<C: Codes>(self, codec: &Codec<'_>, codes: &mut C) {
        let Self { pose, states, correlations, windows, at, channel } = self;
        match codec {
            Codec::Pcm if cfg!(feature = "pcm") => codes.uniform(pose, states, &Constant),
            Codec::MuLaw(law) if cfg!(feature = "mulaw") => serial(pose, states, &First, law, codes),
            Codec::Dpcm { order: 0 | 1 } if cfg!(feature = "dpcm") => codes.uniform(pose, states, &First),
            Codec::Adpcm(Adpcm { quantiser, predictor: None })
                if cfg!(feature = "adaptive-step") && quantiser.adapts() =>
            {
                serial(pose, states, &Second, quantiser, codes);
            }
            Codec::Dpcm { .. } | Codec::Adpcm(Adpcm { predictor: None, .. }) if cfg!(feature = "dpcm") => {
                codes.uniform(pose, states, &Second);
            }
            Codec::Adpcm(Adpcm { quantiser, predictor: Some(adaptation) })
                if cfg!(feature = "adaptive-predictor") =>
            {
                if at.length > 0 {
                    let Rows { now, newest, before } = at.ring().rows(windows, channel);
                    let follow = now.iter().zip(newest).zip(before).map(|((now, newest), before)| Sliding {
                        now,
                        newest,
                        before,
                    });
                    // A step that does not adapt is kept as a size, not as an index.
                    if cfg!(feature = "adaptive-step") && quantiser.adapts() {
                        adaptive(pose, states, follow, quantiser, codes);
                    } else {
                        adaptive(pose, states, follow, &Uniform, codes);
                    }
                } else {
                    let window = adaptation.window.into();
                    let follow =
                        correlations.iter_mut().map(move |correlation| Exponential { correlation, window });
                    if cfg!(feature = "adaptive-step") && quantiser.adapts() {
                        adaptive(pose, states, follow, quantiser, codes);
                    } else {
                        adaptive(pose, states, follow, &Uniform, codes);
                    }
                }
            }
            Codec::Qmd(table) if cfg!(feature = "lookup") => serial(pose, states, &First, table, codes),
            // Refused by `Codec::check_linked`.
            _ => {}
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
fn fill<S: SymbolSource>(
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
fn serial<P: Predict, Q: Quantise, C: Codes>(
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

/// Channels whose codes are these.
#[inline(always)]
pub(super) fn given<P: Predict, Q: Quantise>(
    pose: &mut [I16F16],
    states: &mut [State],
    predict: &P,
    quantise: &Q,
    codes: &[i32],
) {
    serial(pose, states, predict, quantise, &mut Given(codes));
}

/// Channel after channel, with uniform steps and codes out of their bits from `position` on; gives where they end.
///
/// What [`fill`] and [`serial`] do, in one loop: for the codecs that are most used.
#[inline(never)]
fn fused<P: Predict, S: SymbolSource>(
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
        next(value, state, predict, &Uniform, code, 0);
    }
    reader.position()
}

/// What follows a channel's movements.
trait Follow {
    /// The last two, the newest first.
    fn movements(&self) -> [i16; 2];

    /// Takes in a movement.
    fn add(&mut self, movement: i16);
}

/// By an exponential window.
struct Exponential<'c> {
    correlation: &'c mut Correlation,
    window: u32,
}

impl Follow for Exponential<'_> {
    #[inline(always)]
    fn movements(&self) -> [i16; 2] {
        self.correlation.movements()
    }

    #[inline(always)]
    fn add(&mut self, movement: i16) {
        self.correlation.add(movement, self.window);
    }
}

/// By a sliding window, whose sums wait until they are needed.
struct Sliding<'c> {
    now: &'c Cell<u16>,
    newest: &'c Cell<u16>,
    before: &'c Cell<u16>,
}

impl Follow for Sliding<'_> {
    #[inline(always)]
    fn movements(&self) -> [i16; 2] {
        [self.newest, self.before].map(|word| word.get().cast_signed())
    }

    #[inline(always)]
    fn add(&mut self, movement: i16) {
        self.now.set(movement.cast_unsigned());
    }
}

/// Channel after channel, where coefficients follow the channel.
#[inline(never)]
fn adaptive<F: Follow, Q: Quantise, C: Codes>(
    pose: &mut [I16F16],
    states: &mut [State],
    followers: impl Iterator<Item = F>,
    quantise: &Q,
    codes: &mut C,
) {
    for (((value, state), mut follower), item) in
        pose.iter_mut().zip(states).zip(followers).zip(codes.items())
    {
        let last = value.to_bits();
        let predicted = predict::adaptive::predict(unpair(state.second), follower.movements(), last);
        let code = codes.code(item, predicted, quantise, state);
        let bits = state.bits();
        let next = predicted.wrapping_add(quantise.difference(code, &mut state.step, bits));
        follower.add(predict::movement(last, next));
        *value = I16F16::from_bits(next);
    }
}

/// Solves for the coefficients of channel c after frame n since the entry point where n + c is a multiple of the period,
/// so that the work of a frame's channels is spread over the period. `sums` gives a channel's.
#[inline(never)]
fn solve(states: &mut [State], sums: impl Fn(usize) -> [i32; 3], adaptation: Adaptation, frame: u32) {
    let period = 1usize.wrapping_shl(adaptation.period.into());
    let mut channel = (frame.wrapping_neg() as usize) & period.wrapping_sub(1);
    while let Some(state) = states.get_mut(channel) {
        state.second = pair(predict::solve(sums(channel)));
        channel = channel.wrapping_add(period);
    }
}

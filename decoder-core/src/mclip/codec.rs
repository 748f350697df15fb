//! The codecs: which stages each is composed of, and the loop over a frame's channels that they share.
//!
//! | codec | prediction | quantiser |
//! |---|---|---|
//! | pcm | the channel's lowest value | uniform between limits (7-4) |
//! | mulaw | first order | mu-law (7-5) |
//! | dpcm | the last value, first or second order | uniform |
//! | adpcm | second order, fixed or adaptive | uniform or adaptive (7-7) |
//! | qmd | the last value | look-up table |
//!
//! Every combination with an entropy stage is compiled into a loop of its own.

use super::header::{Channel, check};
use crate::entropy::Context;
use crate::error::{Error, Field};
use crate::predict::window::{LONGEST, SHORTEST};
use crate::predict::{Correlation, First, Last, Predict, Second, Slots};
use crate::quantise::adaptive::CLASSES;
use crate::quantise::step::MAX_STEP;
use crate::quantise::{Adaptive, Cell, Grid, Lookup, MAX_BITS, MuLaw, Quantise, Uniform};
use fixed::types::I16F16;

/// A codec, as a header names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CodecId {
    /// Values in steps between two limits.
    Pcm,
    /// Differences to a prediction, in mu-law steps.
    MuLaw,
    /// Differences to a prediction, in steps.
    Dpcm,
    /// The same with a quantiser, a predictor or both that adapt.
    Adpcm,
    /// Differences from a look-up table.
    Qmd,
}

/// An entropy stage, as a header names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EntropyId {
    /// Codes of fixed width.
    FixedWidth,
    /// Static Huffman codes.
    Huffman,
    /// Adaptive Huffman codes.
    AdaptiveHuffman,
}

impl CodecId {
    /// All codecs, in the order of their numbers.
    pub const ALL: [Self; 5] = [Self::Pcm, Self::MuLaw, Self::Dpcm, Self::Adpcm, Self::Qmd];

    /// The codec with this number.
    pub fn from_id(id: u8) -> Option<Self> {
        Self::ALL.get(usize::from(id)).copied()
    }

    /// Its number.
    pub const fn id(self) -> u8 {
        self as u8
    }

    /// Its name, in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pcm => "pcm",
            Self::MuLaw => "mulaw",
            Self::Dpcm => "dpcm",
            Self::Adpcm => "adpcm",
            Self::Qmd => "qmd",
        }
    }
}

impl EntropyId {
    /// All entropy stages, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::FixedWidth, Self::Huffman, Self::AdaptiveHuffman];

    /// The stage with this number.
    pub fn from_id(id: u8) -> Option<Self> {
        Self::ALL.get(usize::from(id)).copied()
    }

    /// Its number.
    pub const fn id(self) -> u8 {
        self as u8
    }

    /// Its name, in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FixedWidth => "fixed-width",
            Self::Huffman => "huffman",
            Self::AdaptiveHuffman => "adaptive-huffman",
        }
    }
}

/// How the adaptive predictor adapts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adaptation {
    /// s, 1 to 14: the exponential window has 2^s frames. Or 15 to 120: the sliding window has so many.
    pub window: u8,
    /// p: a channel's coefficients are solved for every 2^p frames, 0 to 14.
    pub period: u8,
}

impl Adaptation {
    /// Words of a channel's ring: the sliding window's length, none for an exponential one.
    pub const fn ring_words(self) -> usize {
        if self.window >= SHORTEST { self.window as usize } else { 0 }
    }
}

/// What adapts in adpcm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adpcm {
    /// The quantiser; its multipliers are 0 where it does not.
    pub quantiser: Adaptive,
    /// The predictor, if it does.
    pub predictor: Option<Adaptation>,
}

impl Adpcm {
    /// Bytes of the parameters.
    pub const BYTES: usize = 12;

    /// The parameters as a header has them.
    pub const fn bytes(&self) -> [u8; Self::BYTES] {
        let [a, b, c, d, e, f, g, h] = self.quantiser.multipliers;
        let (window, period) = match self.predictor {
            Some(Adaptation { window, period }) => (window, period),
            None => (0, 0),
        };
        let multipliers = [a.cast_unsigned(), b.cast_unsigned(), c.cast_unsigned(), d.cast_unsigned()];
        let [a, b, c, d] = multipliers;
        let [e, f, g, h] = [e.cast_unsigned(), f.cast_unsigned(), g.cast_unsigned(), h.cast_unsigned()];
        [a, b, c, d, e, f, g, h, self.quantiser.low, self.quantiser.high, window, period]
    }

    fn read(bytes: &[u8; Self::BYTES], at: usize) -> Result<Self, Error> {
        let (multipliers, rest) = bytes.split_first_chunk::<CLASSES>().unwrap_or((&[0; CLASSES], &[]));
        let &[low, high, window, period] = rest else {
            return Err(Error::Encoding { field: Field::Parameters, at });
        };
        check(Field::Parameters, at, high.into(), low.into(), MAX_STEP.into())?;
        check(Field::Parameters, at, window.into(), 0, LONGEST.into())?;
        check(Field::Parameters, at, period.into(), 0, if window == 0 { 0 } else { 14 })?;
        let quantiser = Adaptive { multipliers: multipliers.map(u8::cast_signed), low, high };
        let predictor = (window > 0).then_some(Adaptation { window, period });
        Ok(Self { quantiser, predictor })
    }
}

/// A codec with its parameters.
#[derive(Clone, Copy, Debug)]
pub enum Codec<'a> {
    /// Values in steps between two limits.
    Pcm,
    /// Differences to a prediction of first order, in mu-law steps.
    MuLaw(MuLaw<'a>),
    /// Differences to a prediction, in steps.
    Dpcm {
        /// Order of the predictor: 0 for the last value, 1 or 2.
        order: u8,
    },
    /// The same with stages that adapt.
    Adpcm(Adpcm),
    /// Differences from a look-up table.
    Qmd(Lookup<'a>),
}

impl<'a> Codec<'a> {
    /// Reads a codec's parameters, which are in the structure at byte `at`.
    ///
    /// # Errors
    /// [`Error::Malformed`] or [`Error::Encoding`] where they are none of the codec's.
    pub fn read(id: CodecId, parameters: &'a [u8], at: usize) -> Result<Self, Error> {
        let error = Error::Encoding { field: Field::Parameters, at };
        match (id, parameters) {
            (CodecId::Pcm, []) => Ok(Self::Pcm),
            (CodecId::MuLaw, levels) => MuLaw::new(levels).map(Self::MuLaw).ok_or(error),
            (CodecId::Dpcm, &[order]) => {
                check(Field::Parameters, at, order.into(), 0, 2)?;
                Ok(Self::Dpcm { order })
            }
            (CodecId::Adpcm, parameters) => match <&[u8; Adpcm::BYTES]>::try_from(parameters).ok() {
                Some(parameters) => Adpcm::read(parameters, at).map(Self::Adpcm),
                None => Err(error),
            },
            (CodecId::Qmd, levels) => Lookup::new(levels).map(Self::Qmd).ok_or(error),
            _ => Err(error),
        }
    }

    /// Which codec it is.
    pub const fn id(&self) -> CodecId {
        match self {
            Self::Pcm => CodecId::Pcm,
            Self::MuLaw(_) => CodecId::MuLaw,
            Self::Dpcm { .. } => CodecId::Dpcm,
            Self::Adpcm(_) => CodecId::Adpcm,
            Self::Qmd(_) => CodecId::Qmd,
        }
    }

    /// Most bits of a channel's code.
    pub const fn most_bits(&self) -> u8 {
        match self {
            Self::MuLaw(law) => law.bits(),
            _ => MAX_BITS,
        }
    }

    /// Whether a channel needs a [`Correlation`].
    pub const fn adapts_predictor(&self) -> bool {
        matches!(self, Self::Adpcm(Adpcm { predictor: Some(_), .. }))
    }

    /// Words of a channel's ring, for a predictor with a sliding window.
    pub const fn ring_words(&self) -> usize {
        match self {
            Self::Adpcm(Adpcm { predictor: Some(adaptation), .. }) => adaptation.ring_words(),
            _ => 0,
        }
    }

    /// Whether the first frame after an entry point has values of its own, instead of codes.
    pub const fn has_entry_values(&self) -> bool {
        !matches!(self, Self::Pcm)
    }
}

/// A channel between frames. Its last value is in the pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct State {
    /// The value before the last one; pcm: the lowest value.
    before: i32,
    coefficients: [i16; 2],
    cell: Cell,
    context: Context,
}

impl State {
    /// What memory holds before a decoder uses it.
    pub const EMPTY: Self = Self {
        before: 0,
        coefficients: [0; 2],
        cell: Cell { step: 0, bits: 0 },
        context: Context { group: 0, activity: 0 },
    };

    /// A channel at an entry point, with the value that it has there.
    pub(super) const fn entry(channel: &Channel<'_>, value: i32) -> Self {
        Self {
            before: value,
            coefficients: channel.coefficients,
            cell: Cell { step: channel.step, bits: channel.bits },
            context: Context { group: channel.group, activity: 0 },
        }
    }

    /// Bits of the channel's code.
    pub const fn bits(&self) -> u8 {
        self.cell.bits
    }

    /// The quantiser's part.
    pub const fn cell(&self) -> &Cell {
        &self.cell
    }

    /// The entropy stage's part.
    pub const fn context(&mut self) -> &mut Context {
        &mut self.context
    }
}

/// Where the symbols of a frame come from: the bits of a block, or an encoder that looks for the best one.
///
/// So an encoder runs the decoder's own loop, with its predictors and quantisers.
pub trait Choose {
    /// The value of channel `channel` at an entry point, in steps of `2^shift` from its lowest, in `bits` bits.
    fn entry(&mut self, channel: usize, low: i32, shift: u8, bits: u32) -> u32;

    /// The symbol of channel `channel`, whose prediction is `predicted`.
    fn symbol<Q: Quantise>(
        &mut self,
        channel: usize,
        predicted: i32,
        quantiser: &Q,
        state: &mut State,
    ) -> u32;
}

/// The channels of a frame in a loop that is compiled for one codec and one source of symbols.
pub(super) fn step<C: Choose>(
    codec: &Codec<'_>,
    pose: &mut [I16F16],
    states: &mut [State],
    correlations: &mut [Correlation],
    rings: &mut [u16],
    frame: u32,
    choose: &mut C,
) {
    match codec {
        Codec::Pcm => pcm(pose, states, choose),
        Codec::MuLaw(law) => fixed(pose, states, &First, law, choose),
        Codec::Dpcm { order: 0 } => fixed(pose, states, &Last, &Uniform, choose),
        Codec::Dpcm { order: 1 } => fixed(pose, states, &First, &Uniform, choose),
        Codec::Dpcm { .. } => fixed(pose, states, &Second, &Uniform, choose),
        Codec::Adpcm(Adpcm { quantiser, predictor: None }) => fixed(pose, states, &Second, quantiser, choose),
        Codec::Adpcm(Adpcm { quantiser, predictor: Some(adaptation) }) => {
            let words = adaptation.ring_words();
            if words == 0 {
                let window = adaptation.window.into();
                let followers = correlations.iter_mut().map(|correlation| Exponential { correlation, window });
                adaptive(pose, states, followers, adaptation.period, frame, quantiser, choose);
            } else {
                let slots = Slots::at(frame, adaptation.window);
                let rings = correlations.iter_mut().zip(rings.chunks_exact_mut(words));
                let followers = rings.map(|(correlation, ring)| Sliding { correlation, ring, slots });
                adaptive(pose, states, followers, adaptation.period, frame, quantiser, choose);
            }
        }
        Codec::Qmd(table) => fixed(pose, states, &Last, table, choose),
    }
}

/// Items with their numbers. `enumerate` has an overflow check that stays in the image.
#[inline(always)]
fn counted<I: Iterator>(items: I) -> impl Iterator<Item = (usize, I::Item)> {
    items.scan(0usize, |next, item| {
        let number = *next;
        *next = next.wrapping_add(1);
        Some((number, item))
    })
}

/// Values between limits.
fn pcm<C: Choose>(pose: &mut [I16F16], states: &mut [State], choose: &mut C) {
    for (channel, (value, state)) in counted(pose.iter_mut().zip(states)) {
        if state.cell.bits == 0 {
            continue;
        }
        let [mantissa, _] = state.coefficients;
        let low = state.before;
        let grid = Grid { low, mantissa, exponent: state.cell.step };
        let symbol = choose.symbol(channel, low, &grid, state);
        *value = I16F16::from_bits(low.wrapping_add(grid.difference(symbol, &mut state.cell)));
    }
}

/// Differences to a prediction by fixed coefficients.
#[inline(always)]
fn fixed<P: Predict, Q: Quantise, C: Choose>(
    pose: &mut [I16F16],
    states: &mut [State],
    predict: &P,
    quantise: &Q,
    choose: &mut C,
) {
    for (channel, (value, state)) in counted(pose.iter_mut().zip(states)) {
        if state.cell.bits == 0 {
            continue;
        }
        let last = value.to_bits();
        let predicted = predict.predict(state.coefficients, last, state.before);
        let symbol = choose.symbol(channel, predicted, quantise, state);
        state.before = last;
        *value = I16F16::from_bits(predicted.wrapping_add(quantise.difference(symbol, &mut state.cell)));
    }
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

/// Differences to a prediction whose coefficients follow the channel.
///
/// Channel c solves for its coefficients after frame n since the entry point where n + c is a multiple of the
/// period, so that the divisions of a frame's channels are spread over the period.
#[inline(always)]
fn adaptive<F: Follow, Q: Quantise, C: Choose>(
    pose: &mut [I16F16],
    states: &mut [State],
    followers: impl Iterator<Item = F>,
    period: u8,
    frame: u32,
    quantise: &Q,
    choose: &mut C,
) {
    let mask = 1u32.wrapping_shl(period.into()).wrapping_sub(1);
    let channels = pose.iter_mut().zip(states).zip(followers);
    for (channel, ((value, state), mut follower)) in counted(channels) {
        if state.cell.bits == 0 {
            continue;
        }
        let last = value.to_bits();
        let predicted = follower.correlation().predict(state.coefficients, last);
        let symbol = choose.symbol(channel, predicted, quantise, state);
        let next = predicted.wrapping_add(quantise.difference(symbol, &mut state.cell));
        follower.add(next.wrapping_sub(last));
        if frame.wrapping_add(channel as u32) & mask == 0 {
            state.coefficients = follower.correlation().solve();
        }
        *value = I16F16::from_bits(next);
    }
}

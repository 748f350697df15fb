//! adpcm: differences to a prediction, with a quantiser (7-7), a predictor (7-15 to 7-18) or both that adapt.
//!
//! Each of the two may be left out of a decoder: features `adaptive-step` and `adaptive-predictor`.

use super::contract::Codec;
use super::scalar::byte_groups::{GroupLoop, loop_for};
use super::scalar::contract::ScalarCodec;
use super::scalar::initial::step_size;
use super::scalar::loops::{Clock, Codes, Part, serial};
use crate::channel::{Channel, Rules};
use crate::error::{Error, Field, check};
use crate::memory::Needs;
use crate::predict::adaptive::{self, CORRELATION_WORDS, Correlation, MAX_WINDOW, pair, unpair};
use crate::predict::fixed::Second;
use crate::predict::window::{LONGEST, Ring, Rows, SHORTEST};
use crate::quantise::adaptive::{Adaptive, CLASSES};
use crate::quantise::quantiser::{MAX_BITS, Quantise, Step};
use crate::quantise::step::MAX_STEP;
use crate::quantise::uniform::Uniform;
use crate::state::State;
use core::cell::Cell;
use fixed::types::I16F16;

/// How the adaptive predictor adapts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adaptation {
    /// s, 1 to [`MAX_WINDOW`]: the exponential window has 2^s frames. Or [`SHORTEST`] to [`LONGEST`]: the sliding window
    /// has so many.
    pub window: u8,
    /// p: a channel's coefficients are solved for every 2^p frames, 0 to 14, so that a sliding window, of at most 8 · 2^p frames,
    /// costs no more than 8 movements a frame.
    pub period: u8,
}

impl Adaptation {
    /// Words of a channel's ring: the sliding window's length, none for an exponential one.
    pub const fn ring_words(self) -> usize {
        if self.window >= SHORTEST { self.window as usize } else { 0 }
    }
}

/// The quantiser: a step that stays, or one that follows the codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Steps {
    /// The step of a channel's record.
    Fixed,
    /// A step that follows the codes, the same rule for all channels.
    #[cfg(feature = "adaptive-step")]
    Adaptive(Adaptive),
}

/// The predictor: coefficients that stay, or ones that follow the values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Prediction {
    /// Second order, with the coefficient of a channel's record.
    Fixed,
    /// Second order, with coefficients that follow the channel's values.
    #[cfg(feature = "adaptive-predictor")]
    Adaptive(Adaptation),
}

/// The codec: what adapts in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adpcm {
    /// The quantiser.
    pub steps: Steps,
    /// The predictor.
    pub prediction: Prediction,
}

/// Bytes of the parameters.
const BYTES: usize = CLASSES.wrapping_add(4);

impl Steps {
    fn of(adaptive: Adaptive) -> Result<Self, Error> {
        if !adaptive.adapts() {
            return Ok(Self::Fixed);
        }
        #[cfg(feature = "adaptive-step")]
        return Ok(Self::Adaptive(adaptive));
        #[cfg(not(feature = "adaptive-step"))]
        Err(not_linked(0))
    }
}

impl Prediction {
    fn of(adaptation: Adaptation) -> Result<Self, Error> {
        if adaptation.window == 0 {
            return Ok(Self::Fixed);
        }
        #[cfg(feature = "adaptive-predictor")]
        return Ok(Self::Adaptive(adaptation));
        #[cfg(not(feature = "adaptive-predictor"))]
        Err(not_linked(1))
    }
}

/// What is said where a part was left out: which of those in the list of codecs.
#[cfg(not(all(feature = "adaptive-step", feature = "adaptive-predictor")))]
fn not_linked(part: u8) -> Error {
    use crate::ids::{CodecId, Feature};
    Error::NotLinked { feature: Feature::Part { codec: CodecId::Adpcm, part } }
}

impl Codec<'_> for Adpcm {
    fn parse(parameters: &[u8], at: usize) -> Result<Self, Error> {
        let none = Error::Encoding { field: Field::Parameters, at };
        let parameters: &[u8; BYTES] = parameters.try_into().map_err(|_| none)?;
        let (multipliers, rest) = parameters.split_first_chunk::<CLASSES>().ok_or(none)?;
        let &[low, high, window, period] = rest else { return Err(none) };
        check(Field::Parameters, at, high.into(), low.into(), MAX_STEP.into())?;
        let most = if window < SHORTEST { MAX_WINDOW } else { LONGEST };
        check(Field::Parameters, at, window.into(), 0, most.into())?;
        // Each time coefficients are solved for, a sliding window is gone through: at most 8 movements a channel and frame.
        let eighths = window.wrapping_sub(1) >> 3;
        let least = if window < SHORTEST { 0 } else { u8::BITS.wrapping_sub(eighths.leading_zeros()) };
        check(Field::Parameters, at, period.into(), least, if window == 0 { 0 } else { 14 })?;
        let steps = Steps::of(Adaptive::new(multipliers.map(u8::cast_signed), low, high))?;
        let prediction = Prediction::of(Adaptation { window, period })?;
        Ok(Self { steps, prediction })
    }

    fn emit(&self, out: &mut impl Extend<u8>) {
        let (multipliers, low, high) = match self.steps {
            Steps::Fixed => ([0; CLASSES], 0, MAX_STEP),
            #[cfg(feature = "adaptive-step")]
            Steps::Adaptive(Adaptive { multipliers, low, high, .. }) => (multipliers, low, high),
        };
        let (window, period) = match self.prediction {
            Prediction::Fixed => (0, 0),
            #[cfg(feature = "adaptive-predictor")]
            Prediction::Adaptive(Adaptation { window, period }) => (window, period),
        };
        out.extend(multipliers.map(i8::cast_unsigned));
        out.extend([low, high, window, period]);
    }

    fn rules(&self) -> Rules {
        Rules { bits: MAX_BITS, step: MAX_STEP, grid: false }
    }

    /// A [`Correlation`] for each channel where the window is exponential, else a ring of movements.
    fn needs(&self, channels: usize) -> Needs {
        match self.prediction {
            Prediction::Fixed => Needs::default(),
            #[cfg(feature = "adaptive-predictor")]
            Prediction::Adaptive(adaptation) => {
                let rows = adaptation.ring_words();
                let words = if rows > 0 { 0 } else { channels.saturating_mul(CORRELATION_WORDS) };
                Needs { channels: 0, words, halves: rows.saturating_mul(channels) }
            }
        }
    }
}

impl ScalarCodec<'_> for Adpcm {
    fn initial(&self, channel: &Channel<'_>) -> (Step, i32) {
        let step = match self.steps {
            Steps::Fixed => step_size(channel),
            #[cfg(feature = "adaptive-step")]
            Steps::Adaptive(quantiser) => quantiser.step(channel.step),
        };
        (step, 0)
    }

    fn keeps_values(&self) -> bool {
        matches!(self.prediction, Prediction::Fixed)
    }

    fn adaptive(&self) -> Option<Adaptive> {
        match self.steps {
            Steps::Fixed => None,
            #[cfg(feature = "adaptive-step")]
            Steps::Adaptive(quantiser) => Some(quantiser),
        }
    }

    fn group_loop(&self, states: &[State]) -> Option<GroupLoop> {
        match (self.prediction, self.steps) {
            #[cfg(feature = "adaptive-step")]
            (Prediction::Fixed, Steps::Adaptive(_)) => Some(loop_for::<Second, Adaptive>(states)),
            // What has no loop of its own here goes through a buffer.
            _ => None,
        }
    }

    fn rows(&self) -> usize {
        match self.prediction {
            Prediction::Fixed => 0,
            #[cfg(feature = "adaptive-predictor")]
            Prediction::Adaptive(adaptation) => adaptation.ring_words(),
        }
    }

    #[inline(always)]
    fn restart(&self, part: Part<'_>) {
        match self.steps {
            Steps::Fixed => {}
            #[cfg(feature = "adaptive-step")]
            Steps::Adaptive(_) => part.states.iter_mut().for_each(State::reset_step),
        }
        match self.prediction {
            Prediction::Fixed => {}
            #[cfg(feature = "adaptive-predictor")]
            Prediction::Adaptive(_) => {
                part.words.fill(0);
                Ring::clear(part.halves, part.clock.channels);
                part.states.iter_mut().for_each(|state| state.second = 0);
            }
        }
    }

    #[inline(always)]
    fn advance<C: Codes>(&self, part: Part<'_>, codes: &mut C) {
        let Part { pose, states, words, halves, clock, channel } = part;
        match (self.prediction, &self.steps) {
            (Prediction::Fixed, Steps::Fixed) => codes.uniform(pose, states, &Second),
            #[cfg(feature = "adaptive-step")]
            (Prediction::Fixed, Steps::Adaptive(quantiser)) => {
                serial(pose, states, &Second, quantiser, codes);
            }
            #[cfg(feature = "adaptive-predictor")]
            (Prediction::Adaptive(_), steps) if clock.rows > 0 => {
                let Rows { now, newest, before } = ring(clock).rows(halves, channel);
                let follow = now.iter().zip(newest).zip(before).map(|((now, newest), before)| Sliding {
                    now,
                    newest,
                    before,
                });
                adaptive_steps(pose, states, follow, steps, codes);
            }
            #[cfg(feature = "adaptive-predictor")]
            (Prediction::Adaptive(adaptation), steps) => {
                let window = adaptation.window.into();
                let (correlations, _) = words.as_chunks_mut();
                let correlations = correlations.get_mut(channel..).unwrap_or_default();
                let follow = correlations
                    .iter_mut()
                    .map(move |words| Exponential { correlation: Correlation(words), window });
                adaptive_steps(pose, states, follow, steps, codes);
            }
        }
    }

    /// Solves for coefficients, where they adapt.
    #[inline(always)]
    fn finish(&self, states: &mut [State], words: &[u32], halves: &[u16], clock: &Clock) {
        match self.prediction {
            Prediction::Fixed => {}
            #[cfg(feature = "adaptive-predictor")]
            Prediction::Adaptive(adaptation) => {
                if clock.rows > 0 {
                    let ring = ring(clock);
                    solve(states, |channel| ring.sums(halves, channel), adaptation, clock.frame);
                } else {
                    let (correlations, _) = words.as_chunks();
                    let sums = |channel: usize| correlations.get(channel).map_or([0; 3], Correlation::sums);
                    solve(states, sums, adaptation, clock.frame);
                }
            }
        }
    }
}

/// The ring of sliding windows.
fn ring(clock: &Clock) -> Ring {
    let &Clock { frame, row, rows, channels } = clock;
    Ring { channels, length: rows, row, count: (frame as usize).min(rows) }
}

/// Goes through channels whose coefficients adapt, with the quantiser that they have.
#[inline(always)]
fn adaptive_steps<F: Follow, C: Codes>(
    pose: &mut [I16F16],
    states: &mut [State],
    followers: impl Iterator<Item = F>,
    steps: &Steps,
    codes: &mut C,
) {
    match steps {
        // A step that does not adapt is kept as a size, not as an index.
        Steps::Fixed => serial_adaptive(pose, states, followers, &Uniform, codes),
        #[cfg(feature = "adaptive-step")]
        Steps::Adaptive(quantiser) => serial_adaptive(pose, states, followers, quantiser, codes),
    }
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
    correlation: Correlation<'c>,
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
fn serial_adaptive<F: Follow, Q: Quantise, C: Codes>(
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
        let expected = adaptive::predict(unpair(state.second), follower.movements());
        let code = codes.code(item, last.wrapping_add(expected), quantise, state);
        let bits = state.bits();
        // One difference for the value and its movement, in one register: the last value is needed at the end alone.
        let difference = expected.wrapping_add(quantise.difference(code, &mut state.step, bits));
        *value = I16F16::from_bits(last.wrapping_add(difference));
        follower.add(adaptive::movement(difference));
    }
}

/// Solves for the coefficients of channel c after frame n since the entry point where n + c is a multiple of the period,
/// so that the work of a frame's channels is spread over the period. `sums` gives a channel's.
#[inline(never)]
fn solve(states: &mut [State], sums: impl Fn(usize) -> [i32; 3], adaptation: Adaptation, frame: u32) {
    let period = 1usize.wrapping_shl(adaptation.period.into());
    let mut channel = (frame.wrapping_neg() as usize) & period.wrapping_sub(1);
    while let Some(state) = states.get_mut(channel) {
        state.second = pair(adaptive::solve(sums(channel)));
        channel = channel.wrapping_add(period);
    }
}

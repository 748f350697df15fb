//! Chooses what a codec's channels look like for a motion and a quality.

use super::run::{Coded, Plan};
use super::train::Steps;
use super::{Predictor, Settings};
use crate::qmd::Source;
use decoder_core::codec::Codec;
use decoder_core::codec::adpcm::{Adaptation, Adpcm, Prediction, Steps as StepRule};
use decoder_core::entropy::fixed_width::GROUP;
use decoder_core::mclip::{Channel, ChannelKind, CodecId, EntropyId, MAX_ENTRY_BITS, Opening, entry_shift};
use decoder_core::predict::fixed::{LEAK_ONE, MOMENTUM_ONE};
use decoder_core::quantise::adaptive::CLASSES;
use decoder_core::quantise::step::MAX_STEP;
use decoder_core::quantise::{Adaptive, Grid, MAX_BITS};
use rayon::prelude::*;

/// Values at entry points are told apart to a quarter of a step: what is off there, the next frames have to mend.
pub(super) const PRECISION: u8 = 2;

/// Exponent that the value of a pcm channel at rest is stored with: to a 1024th of a unit.
const REST_EXPONENT: u8 = 6;

/// What a channel is coded like: everything that its record needs beyond name, unit and range.
#[derive(Clone, Copy, Debug)]
pub(super) struct Choice {
    pub bits: u8,
    pub step: u8,
    pub coefficient: i16,
}

/// Parameters of a codec, as bytes of its header.
pub(super) fn parameters(settings: &Settings, levels: &[u8]) -> Vec<u8> {
    match settings.codec {
        CodecId::Pcm => Vec::new(),
        CodecId::MuLaw | CodecId::Qmd => levels.to_vec(),
        CodecId::Dpcm => vec![match settings.predictor {
            Predictor::Last => 0,
            Predictor::First => 1,
            _ => 2,
        }],
        CodecId::Adpcm => {
            let quantiser = settings.steps.filter(|_| settings.adapt_step).map(Steps::quantiser);
            let steps = quantiser.filter(Adaptive::adapts).map_or(StepRule::Fixed, StepRule::Adaptive);
            let prediction = match settings.predictor {
                Predictor::Adaptive { window, period } => Prediction::Adaptive(Adaptation { window, period }),
                _ => Prediction::Fixed,
            };
            let mut bytes = Vec::new();
            Adpcm { steps, prediction }.emit(&mut bytes);
            bytes
        }
    }
}

/// The multipliers of codes' first four bits, from those of magnitudes 0 to 7: codes of four bits, of which −8 counts as 7.
pub(super) fn classes(of_magnitudes: [i8; 8]) -> [i8; CLASSES] {
    std::array::from_fn(|class| of_magnitudes[if class < 8 { class } else { (16 - class).min(7) }])
}

/// Decision levels of the mu-law (7-5, by the inverse law) for codes of `bits` bits.
pub(super) fn mu_law(mu: f64, bits: u8) -> Vec<u8> {
    let count = 1usize << (bits - 1);
    let level = |i: usize| ((1.0 + mu).powf(i as f64 / count as f64) - 1.0) / mu * 65536.0;
    (0..count).flat_map(|i| (level(i).round() as u16).to_le_bytes()).collect()
}

/// The index of the step nearest to a size in words.
pub(super) fn step_index(words: f64) -> u8 {
    (8.0 * (words.max(8.0) / 8.0).log2()).round().clamp(0.0, f64::from(MAX_STEP)) as u8
}

/// Gives channels at rest codes too, where all others of their octet have codes of one width: a decoder takes the codes of
/// equal octets several times as fast.
pub(super) fn level(choices: &mut [Choice]) {
    for octet in choices.chunks_mut(GROUP) {
        let width = octet.iter().map(|choice| choice.bits).max().unwrap_or(0);
        if octet.iter().all(|choice| choice.bits == 0 || choice.bits == width) {
            octet.iter_mut().for_each(|choice| choice.bits = width);
        }
    }
}

/// How a header begins that says nothing of the rate, and has neither tables nor channels yet.
pub(super) fn opening<'p>(
    settings: &Settings,
    parameters: &'p [u8],
    frames: usize,
    channels: usize,
) -> Opening<'p> {
    Opening {
        rate_numerator: 1,
        rate_denominator: 1,
        frames: frames as u32,
        channels: channels as u16,
        block_bytes: settings.block_bytes,
        ram: 0,
        delay: 0,
        codec: settings.codec.id(),
        entropy: EntropyId::FixedWidth.id(),
        parameters,
        tables: &[],
        cycles: &[],
        predictors: &[],
        records: &[],
        names: &[],
    }
}

/// One channel of a motion.
pub(super) struct Column {
    /// Its place among the channels.
    pub index: usize,
    pub targets: Vec<i32>,
    pub low: i32,
    pub high: i32,
}

impl Column {
    pub fn all(source: &Source) -> Vec<Self> {
        let column = |channel: usize| -> Vec<i32> {
            source.targets.iter().skip(channel).step_by(source.channels).copied().collect()
        };
        (0..source.channels)
            .map(|channel| {
                let targets = column(channel);
                let low = targets.iter().copied().min().unwrap_or(0);
                let high = targets.iter().copied().max().unwrap_or(0);
                Self { index: channel, targets, low, high }
            })
            .collect()
    }

    /// What this channel is like, without its joint.
    pub fn record(&self, codec: CodecId, kind: ChannelKind, choice: Choice) -> Channel<'static> {
        let Choice { bits, step, coefficient } = choice;
        let mut channel = Channel {
            joint: "",
            kind,
            low: 0,
            entry_bits: 0,
            entry_shift: 0,
            bits,
            step,
            group: 0,
            coefficient,
        };
        let is_pcm = codec == CodecId::Pcm;
        if is_pcm {
            (channel.step, channel.coefficient) = match Grid::covering(self.low, self.high, bits) {
                Some(grid) => (grid.exponent, grid.mantissa),
                None => (REST_EXPONENT, 1),
            };
        }
        channel.entry_shift = entry_shift(channel.step, PRECISION, is_pcm);
        let shift = u32::from(channel.entry_shift);
        if bits == 0 {
            // A channel at rest stays in the middle of its range.
            let middle = i64::midpoint(self.low.into(), self.high.into());
            channel.low =
                ((((middle << 1 >> shift) + 1) >> 1) << shift).clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        } else if is_pcm {
            channel.low = self.low >> shift << shift;
        } else {
            channel.entry_bits = span(self.low, self.high, shift);
        }
        channel
    }

    /// What the decoder makes of this channel alone.
    ///
    /// A predictor that adapts does so on frames that depend on the channel's place, so channels at rest stand before
    /// this one: otherwise a code may be wider in the clip than it was here, and would be cut off.
    pub fn run(&self, settings: &Settings, parameters: &[u8], choice: Choice) -> Coded {
        let before = match settings.predictor {
            Predictor::Adaptive { period, .. } => self.index % (1 << period),
            _ => 0,
        };
        let rest = Self { index: 0, targets: Vec::new(), low: 0, high: 0 };
        let still = Choice { bits: 0, step: 0, coefficient: 0 };
        let mut plan = self.plan(settings, parameters, choice);
        plan.opening.channels += before as u16;
        plan.channels.splice(..0, (0..before).map(|_| rest.record(settings.codec, ChannelKind::Rx, still)));
        let mut targets = vec![0; self.targets.len() * (before + 1)];
        for (row, &target) in targets.chunks_exact_mut(before + 1).zip(&self.targets) {
            row[before] = target;
        }
        let mut coded = plan.run(&targets);
        coded.decoded = coded.decoded.into_iter().skip(before).step_by(before + 1).collect();
        coded
    }

    /// A plan for this channel alone.
    pub fn plan<'p>(&self, settings: &Settings, parameters: &'p [u8], choice: Choice) -> Plan<'p> {
        Plan {
            opening: opening(settings, parameters, self.targets.len(), 1),
            channels: vec![self.record(settings.codec, ChannelKind::Rx, choice)],
            precision: PRECISION,
            entry_frames: settings.entry_frames,
            dead: settings.dead,
        }
    }

    /// Largest distance from the middle of the range.
    fn half_range(&self) -> f64 {
        (f64::from(self.high) - f64::from(self.low)) / 2.0
    }

    /// Sum of squared errors, in squared words.
    pub fn squared_error(&self, coded: &Coded) -> f64 {
        self.targets.iter().zip(&coded.decoded).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum()
    }
}

/// The bits, with a sign, of values at entry points that cover `low` to `high` in units of `2^shift`.
fn span(low: i32, high: i32, shift: u32) -> u8 {
    let rounded = |value: i32| (i64::from(value) + (1i64 << shift >> 1)) >> shift;
    let bits = |value: i64| 65 - (value ^ (value >> 63)).leading_zeros();
    bits(rounded(low)).max(bits(rounded(high))).min(MAX_ENTRY_BITS.into()) as u8
}

/// Coefficients of the fixed predictors that are tried for a channel.
fn candidates(predictor: Predictor, column: &Column) -> Vec<i16> {
    match predictor {
        Predictor::Last | Predictor::Adaptive { .. } => vec![0],
        Predictor::First => {
            // R(1)/R(0) (7-14).
            let x: Vec<f64> = column.targets.iter().map(|&word| f64::from(word)).collect();
            let r0: f64 = x.iter().map(|x| x * x).sum();
            let r1: f64 = x.windows(2).map(|pair| pair[0] * pair[1]).sum();
            let leak = if r0 > 0.0 { (1.0 - r1 / r0) * f64::from(LEAK_ONE) } else { 0.0 };
            vec![0, leak.round().clamp(0.0, 32767.0) as i16]
        }
        // The last value and a part of the last movement.
        Predictor::Second => [0.0, 0.2, 0.4, 0.55, 0.7, 0.8, 0.9, 1.0]
            .iter()
            .map(|&part: &f64| (part * f64::from(MOMENTUM_ONE)).round() as i16)
            .collect(),
    }
}

/// Bits of the codes by their own frequencies.
pub(super) fn entropy(codes: &[i32]) -> f64 {
    let mut sorted = codes.to_vec();
    sorted.sort_unstable();
    let total = codes.len() as f64;
    sorted.chunk_by(|a, b| a == b).map(|run| run.len() as f64 * (total / run.len() as f64).log2()).sum()
}

/// Bits that hold all of the codes, at least 1.
fn bits_for(codes: &[i32]) -> u8 {
    let largest = codes.iter().map(|&code| code ^ (code >> 31)).max().unwrap_or(0);
    (33 - largest.leading_zeros()) as u8
}

/// The best choice for every channel whose step is given, in words: the predictor with the fewest bits.
pub(super) fn by_steps(
    columns: &[Column],
    settings: &Settings,
    parameters: &[u8],
    steps: &[f64],
) -> Vec<Choice> {
    let choose = |(column, &step): (&Column, &f64)| {
        // A step about as wide as the range says no more than no code does.
        if column.half_range() <= step / 2.0 {
            return Choice { bits: 0, step: step_index(step), coefficient: 0 };
        }
        if settings.codec == CodecId::Pcm {
            let range = 2.0 * column.half_range();
            let bits = (range / step).log2().ceil().clamp(1.0, f64::from(MAX_BITS)) as u8;
            return Choice { bits, step: 0, coefficient: 0 };
        }
        let tried = candidates(settings.predictor, column).into_iter().map(|coefficient| {
            let choice = Choice { bits: MAX_BITS, step: step_index(step), coefficient };
            let coded = column.run(settings, parameters, choice);
            (entropy(&coded.codes), Choice { bits: bits_for(&coded.codes), ..choice })
        });
        match tried.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((_, choice)) => choice,
            None => unreachable!("every predictor has candidates"),
        }
    };
    columns.par_iter().zip(steps).map(choose).collect()
}

/// The best choice for every channel whose bits are given: the step and predictor with the least error.
pub(super) fn by_bits(columns: &[Column], settings: &Settings, parameters: &[u8], bits: u8) -> Vec<Choice> {
    let choose = |column: &Column| {
        let rest = Choice { bits: 0, step: 0, coefficient: 0 };
        if column.low == column.high {
            return rest;
        }
        if settings.codec == CodecId::Pcm {
            return Choice { bits, ..rest };
        }
        let highest = step_index(2.0 * column.half_range());
        let lowest = highest.saturating_sub(8 * 14);
        let mut best = (f64::INFINITY, rest);
        let candidates = candidates(settings.predictor, column);
        let mut attempt = |step: u8| {
            for &coefficient in &candidates {
                let choice = Choice { bits, step, coefficient };
                let coded = column.run(settings, parameters, choice);
                let error = column.squared_error(&coded);
                if error < best.0 {
                    best = (error, choice);
                }
            }
            best.1.step
        };
        let mut middle = lowest;
        for step in (lowest..=highest).step_by(8) {
            middle = attempt(step);
        }
        for step in middle.saturating_sub(6)..=middle.saturating_add(6).min(MAX_STEP) {
            attempt(step);
        }
        best.1
    };
    columns.par_iter().map(choose).collect()
}

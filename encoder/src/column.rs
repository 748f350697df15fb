//! One channel of a motion, and what a header says of how it is coded.

use crate::source::Source;
use decoder_core::mclip::{Channel, ChannelKind, MAX_ENTRY_BITS, entry_shift};
use decoder_core::quantise::Grid;
use decoder_core::quantise::step::MAX_STEP;

/// Values at entry points are told apart to a quarter of a step: what is off there, the next frames have to mend.
pub const PRECISION: u8 = 2;

/// Exponent that the value of a channel at rest is stored with where channels have grids: to a 1024th of a unit.
const REST_EXPONENT: u8 = 6;

/// What a channel is coded like: everything that its record needs beyond name, unit and range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// Bits of a code, 0 to 16; a channel with 0 bits keeps its value.
    pub bits: u8,
    /// Index of its step, or of its first step where steps adapt.
    pub step: u8,
    /// Coefficient of its predictor.
    pub coefficient: i16,
}

impl Choice {
    /// A channel that keeps its value.
    pub const REST: Self = Self { bits: 0, step: 0, coefficient: 0 };
}

/// The values of one channel, a word a frame.
#[derive(Clone, Debug)]
pub struct Column {
    /// Its place among the channels.
    pub index: usize,
    /// What a decoder should give.
    pub targets: Vec<i32>,
    /// The lowest of them.
    pub low: i32,
    /// The highest of them.
    pub high: i32,
}

impl Column {
    /// A channel without frames, which has a record but no codes.
    pub const REST: Self = Self { index: 0, targets: Vec::new(), low: 0, high: 0 };

    /// All channels of a motion.
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

    /// Largest distance from the middle of the range, in words.
    pub fn half_range(&self) -> f64 {
        (f64::from(self.high) - f64::from(self.low)) / 2.0
    }

    /// Sum of squared errors of what was decoded, in squared words.
    pub fn squared_error(&self, decoded: &[i32]) -> f64 {
        self.targets.iter().zip(decoded).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum()
    }

    /// The record of a channel whose codes are differences in steps, without its name.
    pub fn record_in_steps(&self, choice: Choice) -> Channel<'static> {
        let shift = entry_shift(choice.step, PRECISION, false);
        let channel = record(choice, shift);
        if choice.bits == 0 {
            Channel { low: self.middle(shift), ..channel }
        } else {
            Channel { entry_bits: span(self.low, self.high, shift.into()), ..channel }
        }
    }

    /// The record of a channel whose codes are places on a grid of `2^bits` values, without its name.
    pub fn record_on_grid(&self, bits: u8) -> Channel<'static> {
        let (step, coefficient) = match Grid::covering(self.low, self.high, bits) {
            Some(grid) => (grid.exponent, grid.mantissa),
            None => (REST_EXPONENT, 1),
        };
        let shift = entry_shift(step, PRECISION, true);
        let low = if bits == 0 { self.middle(shift) } else { self.low >> shift << shift };
        Channel { low, ..record(Choice { bits, step, coefficient }, shift) }
    }

    /// The middle of the range in units of `2^shift`: where a channel at rest stays.
    fn middle(&self, shift: u8) -> i32 {
        let middle = i64::midpoint(self.low.into(), self.high.into());
        ((((middle << 1 >> shift) + 1) >> 1) << shift).clamp(i32::MIN.into(), i32::MAX.into()) as i32
    }
}

const fn record(choice: Choice, entry_shift: u8) -> Channel<'static> {
    let Choice { bits, step, coefficient } = choice;
    let kind = ChannelKind::Rx;
    Channel { joint: "", kind, low: 0, entry_bits: 0, entry_shift, bits, step, group: 0, coefficient }
}

/// The bits, with a sign, of values at entry points that cover `low` to `high` in units of `2^shift`.
fn span(low: i32, high: i32, shift: u32) -> u8 {
    let rounded = |value: i32| (i64::from(value) + (1i64 << shift >> 1)) >> shift;
    let bits = |value: i64| 65 - (value ^ (value >> 63)).leading_zeros();
    bits(rounded(low)).max(bits(rounded(high))).min(MAX_ENTRY_BITS.into()) as u8
}

/// The index of the step nearest to a size in words.
pub fn step_index(words: f64) -> u8 {
    (8.0 * (words.max(8.0) / 8.0).log2()).round().clamp(0.0, f64::from(MAX_STEP)) as u8
}

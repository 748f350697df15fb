//! qmd: differences to the last value from one table, in steps of each channel, as the QMD paper has them for all.
//!
//! Steps are in inverse proportion to how far a channel moves the joints, so that one table serves all channels. The
//! table is fitted as in [`crate::qmd`]: the loop is simulated, each level moves to the mean of the differences that
//! chose it, and the best table met is kept.

use super::encode::{CodecOption, Encode, OptionError};
use super::scalar::allocate::{self, no_coefficient};
use super::scalar::contract::{Allocation, ScalarEncode};
use super::scalar::encode::encode;
use super::scalar::simulate::{self, Coded};
use crate::column::{Choice, Column, step_index};
use crate::error::EncodeError;
use crate::lloyd_max::Density;
use crate::quality::Quality;
use crate::task::Task;
use decoder_core::arithmetic::unsigned;
use decoder_core::mclip::CodecId;
use decoder_core::quantise::step::size;

/// Most bits of a code: the table of levels is in the header.
const MOST_BITS: u8 = 8;

/// Rounds of Lloyd's iteration from each start.
const ROUNDS: usize = 8;

/// A step in units of the table.
const UNIT: f64 = 4096.0;

/// What the largest difference is in steps: below 8, which is the end of the table's words.
const LARGEST: f64 = 7.9;

/// The settings of qmd.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Qmd {
    /// The density whose quantiser by Max the table has, in each channel's best scale; fitted to the motion unless given.
    pub density: Option<Density>,
}

impl Encode for Qmd {
    fn id(&self) -> CodecId {
        CodecId::Qmd
    }

    fn most_bits(&self) -> u8 {
        MOST_BITS
    }

    /// The levels are spread over all differences.
    fn has_free_steps(&self) -> bool {
        false
    }

    fn encode(&self, task: &Task<'_>, quality: Quality<'_>) -> Result<Vec<u8>, EncodeError> {
        encode(self, task, quality)
    }

    fn options(&self) -> &'static [CodecOption] {
        &[LEVELS]
    }

    fn set(&mut self, option: &str, value: &str) -> Result<(), OptionError> {
        if option != LEVELS.name {
            return Err(OptionError::Unknown { codec: self.id().name(), option: option.to_owned() });
        }
        self.density = match value {
            "fitted" => None,
            "gaussian" => Some(Density::Gaussian),
            "laplacian" => Some(Density::Laplacian),
            _ => {
                let expected = "fitted, gaussian or laplacian".to_owned();
                return Err(OptionError::Value {
                    option: LEVELS.name,
                    found: format!("{value:?}"),
                    expected,
                });
            }
        };
        Ok(())
    }

    fn curves() -> Vec<(&'static str, Self)> {
        vec![("packed", Self::default())]
    }
}

impl ScalarEncode for Qmd {
    fn allocate_bits(&self, task: &Task<'_>, bits: u8) -> Result<Allocation, EncodeError> {
        match self.density {
            Some(density) => by_density(self, task, density, bits),
            None => fitted(self, task, bits),
        }
    }

    fn allocate_steps(&self, _: &Task<'_>, _: &[f64]) -> Result<Allocation, EncodeError> {
        Err(EncodeError::NoFreeSteps { codec: self.id().name() })
    }
}

const LEVELS: CodecOption = CodecOption {
    name: "levels",
    value_name: "LEVELS",
    default: "fitted",
    help: "Levels of the table",
    values: &[
        ("fitted", "Fitted to the motion, for all channels together"),
        ("gaussian", "Max's quantiser of the Gaussian density, in each channel's best scale"),
        ("laplacian", "Max's quantiser of the Laplacian density, in each channel's best scale"),
    ],
};

/// The table of a density, with the best step for every channel.
fn by_density(codec: &Qmd, task: &Task<'_>, density: Density, bits: u8) -> Result<Allocation, EncodeError> {
    // An even number of levels has none for 0, which a channel at rest needs.
    let attempt = |count: usize| -> Result<(f64, Allocation), EncodeError> {
        let table = bytes_of(&density.levels(count));
        let allocation = allocate::by_bits(codec, task, table, bits, no_coefficient)?;
        let coded = simulate::clip(codec, task, &allocation)?;
        Ok((task.motion.weighted_error(&coded.decoded), allocation))
    };
    let (odd, even) = (attempt((1 << bits) - 1)?, attempt(1 << bits)?);
    Ok(if odd.0 <= even.0 { odd.1 } else { even.1 })
}

/// The table that fits the motion best, with steps that move the joints alike.
fn fitted(codec: &Qmd, task: &Task<'_>, bits: u8) -> Result<Allocation, EncodeError> {
    let columns = &task.motion.columns;
    let choices = choices(columns, &task.motion.steps(1.0), bits);
    let mut allocation = Allocation { parameters: Vec::new(), choices, dead_zone: 0 };
    let active = active(columns, &allocation.choices);
    let parameters = fit(&active, bits, |table| {
        allocation.parameters = table.to_vec();
        simulate::clip(codec, task, &allocation)
    })?;
    Ok(Allocation { parameters, ..allocation })
}

/// The choice for every channel, where `steps` are in proportion to what the channels' steps should be.
fn choices(columns: &[Column], steps: &[f64], bits: u8) -> Vec<Choice> {
    let largest = columns.iter().zip(steps).map(|(column, step)| largest_difference(column) / step);
    // Steps are rounded to the nearest in equal ratios, down by at most 2^(1/16).
    let scale = largest.fold(0.0, f64::max) * 2f64.powf(1.0 / 16.0) / LARGEST;
    let choice = |(column, step): (&Column, &f64)| Choice {
        bits: if column.low == column.high { 0 } else { bits },
        step: step_index(step * scale),
        coefficient: 0,
    };
    columns.iter().zip(steps).map(choice).collect()
}

fn largest_difference(column: &Column) -> f64 {
    let pairs = column.targets.windows(2);
    pairs.map(|pair| (f64::from(pair[1]) - f64::from(pair[0])).abs()).fold(0.0, f64::max)
}

/// The channels that have codes, with their steps in words.
fn active<'c>(columns: &'c [Column], choices: &[Choice]) -> Vec<(&'c Column, f64)> {
    let pairs = columns.iter().zip(choices).filter(|(_, choice)| choice.bits > 0);
    pairs.map(|(column, choice)| (column, f64::from(size(choice.step)))).collect()
}

/// The table of `2^bits` levels that fits a motion best; `simulate` codes the motion with a table.
fn fit(
    active: &[(&Column, f64)],
    bits: u8,
    mut simulate: impl FnMut(&[u8]) -> Result<Coded, decoder_core::Error>,
) -> Result<Vec<u8>, EncodeError> {
    let count = 1usize << bits;
    let starts = [equal_frequency(active, count), companded(count, 10.0), companded(count, 255.0)];
    let mut best = (f64::INFINITY, Vec::new());
    for mut levels in starts {
        for _ in 0..ROUNDS {
            by_magnitude(&mut levels);
            let table = bytes(&levels);
            let coded = simulate(&table)?;
            let mut sums = vec![(0.0, 0.0); count];
            let mut error = 0.0;
            let steps = active.iter().map(|(_, step)| step).cycle();
            for ((&code, &wanted), step) in coded.codes.iter().zip(&coded.wanted).zip(steps) {
                let symbol = unsigned(code);
                let wanted = f64::from(wanted) / step * UNIT;
                let (sum, count) = &mut sums[symbol as usize];
                *sum += wanted;
                *count += 1.0;
                error += (wanted - levels[symbol as usize]).powi(2);
            }
            if error < best.0 {
                best = (error, table);
            }
            for (level, (sum, count)) in levels.iter_mut().zip(sums) {
                if count > 0.0 {
                    *level = sum / count;
                }
            }
        }
    }
    Ok(best.1)
}

/// Levels of both signs that are narrow about zero, by the inverse mu-law (7-5).
fn companded(count: usize, mu: f64) -> Vec<f64> {
    let level = |i: usize| {
        let part = (i.div_ceil(2)) as f64 / (count as f64 / 2.0);
        let size = ((1.0 + mu).powf(part) - 1.0) / mu * LARGEST * UNIT;
        if i.is_multiple_of(2) { size } else { -size }
    };
    (0..count).map(level).collect()
}

/// Levels of equal frequency among the differences between frames.
fn equal_frequency(active: &[(&Column, f64)], count: usize) -> Vec<f64> {
    let differences = active.iter().flat_map(|(column, step)| {
        let pairs = column.targets.windows(2);
        pairs.map(move |pair| (f64::from(pair[1]) - f64::from(pair[0])) / step * UNIT)
    });
    let mut sorted: Vec<f64> = differences.collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let share =
        |index: usize| sorted.get((2 * index + 1) * sorted.len() / (2 * count)).copied().unwrap_or(0.0);
    (0..count).map(share).collect()
}

/// Puts small levels first, as entropy stages expect.
fn by_magnitude(levels: &mut [f64]) {
    levels.sort_unstable_by(|a, b| a.abs().total_cmp(&b.abs()));
}

/// The table of levels that are given in any unit: what the unit is, steps say.
fn bytes_of(levels: &[f64]) -> Vec<u8> {
    let most = levels.iter().fold(0.0_f64, |most, level| most.max(level.abs()));
    let mut scaled: Vec<f64> = levels.iter().map(|level| level / most * LARGEST * UNIT).collect();
    by_magnitude(&mut scaled);
    bytes(&scaled)
}

fn bytes(levels: &[f64]) -> Vec<u8> {
    levels.iter().flat_map(|level| (level.round().clamp(-32768.0, 32767.0) as i16).to_le_bytes()).collect()
}

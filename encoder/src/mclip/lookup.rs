//! The qmd codec's table: differences between frames in steps of each channel, as the paper has them for all.
//!
//! Steps are in inverse proportion to how far a channel moves the joints, so that one table serves all channels. The
//! table is fitted as in [`crate::qmd`]: the loop is run, each level moves to the mean of the differences that
//! chose it, and the best table met is kept.

use super::plan::{Choice, Column, step_index};
use super::run::Coded;
use decoder_core::arithmetic::unsigned;
use decoder_core::quantise::step::size;

/// Rounds of Lloyd's iteration from each start.
const ROUNDS: usize = 8;

/// A step in units of the table.
const UNIT: f64 = 4096.0;

/// What the largest difference is in steps: below 8, which is the end of the table's words.
const LARGEST: f64 = 7.9;

/// The choice for every channel, where `steps` are in proportion to what the channels' steps should be.
pub(super) fn choices(columns: &[Column], steps: &[f64], bits: u8) -> Vec<Choice> {
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

/// The table of `2^bits` levels that fits a motion best; `run` codes the motion with a table.
pub(super) fn fit(columns: &[Column], choices: &[Choice], bits: u8, run: impl Fn(&[u8]) -> Coded) -> Vec<u8> {
    let active: Vec<(&Column, f64)> = columns
        .iter()
        .zip(choices)
        .filter(|(_, choice)| choice.bits > 0)
        .map(|(column, choice)| (column, f64::from(size(choice.step))))
        .collect();
    let count = 1usize << bits;
    let starts = [equal_frequency(&active, count), companded(count, 10.0), companded(count, 255.0)];
    let mut best = (f64::INFINITY, Vec::new());
    for mut levels in starts {
        for _ in 0..ROUNDS {
            by_magnitude(&mut levels);
            let table = bytes(&levels);
            let coded = run(&table);
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
    best.1
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
pub(super) fn bytes_of(levels: &[f64]) -> Vec<u8> {
    let most = levels.iter().fold(0.0_f64, |most, level| most.max(level.abs()));
    let mut scaled: Vec<f64> = levels.iter().map(|level| level / most * LARGEST * UNIT).collect();
    by_magnitude(&mut scaled);
    bytes(&scaled)
}

fn bytes(levels: &[f64]) -> Vec<u8> {
    levels.iter().flat_map(|level| (level.round().clamp(-32768.0, 32767.0) as i16).to_le_bytes()).collect()
}

//! The default encoder: differences against the decoder's pose, and tables fitted to the joints' movement.
//!
//! The paper quantises the differences between recorded frames, so each frame adds its rounding error to those
//! before it. Here a difference is taken between the recorded frame and the pose that the decoder has by then
//! (closed-loop prediction), so what a frame misses the next one makes up for. The error of a frame is then no
//! more than the distance from its difference to the nearest entry of the table.
//!
//! A table should thus minimise the sum of w·e² over a segment, e being that distance and w the squared movement
//! of the joints that one unit of the channel causes. That is Lloyd's problem (waveform coding, section 7.3), only
//! that the differences depend on the table through the loop. So the loop is run, each entry moves to the
//! weighted mean of the differences that chose it, and this is repeated; the best table met is kept.

use super::parameters::Parameters;
use super::writer::{Coded, Segment};
use crate::source::Source;
use decoder_core::word::fixed_from_f32_bits;
use std::ops::Range;

/// Rounds of Lloyd's iteration.
const ROUNDS: usize = 12;

pub(super) fn encode(source: &Source, parameters: Parameters) -> Coded {
    let fixed_channels = usize::from(parameters.fixed_channels);
    let mut initial: Vec<f32> = source.targets[..source.channels].iter().map(|&bits| float(bits)).collect();
    let mut pose: Vec<i32> = initial.iter().map(|&value| fixed(value)).collect();
    let mut segments = Vec::new();
    for rows in source.segments(parameters.segment_frames) {
        let run = Loop { source, fixed_channels, rows: rows.clone() };
        let table = run.fit(&pose, 1 << parameters.index_bits);
        if rows.start == 0 {
            // The first row is a difference like the others, of zero if it can be. The initial pose makes up for
            // what the entry nearest to zero lacks.
            let nearest = table.words[table.nearest(0)];
            for (value, &target) in
                initial[fixed_channels..].iter_mut().zip(&source.targets[fixed_channels..])
            {
                *value = float(target.wrapping_sub(nearest));
            }
            pose = initial.iter().map(|&value| fixed(value)).collect();
        }
        segments.push(run.code(&mut pose, table));
    }
    Coded { pose: initial, segments }
}

/// The entries of a table in ascending order, as the decoder has them and as the file does.
#[derive(Clone)]
struct Table {
    words: Vec<i32>,
    floats: Vec<f32>,
    /// `ends[i]` is the largest difference that is nearer to entry `i` than to `i + 1`.
    ends: Vec<i32>,
}

impl Table {
    fn new(mut entries: Vec<f32>) -> Self {
        entries.sort_unstable_by(f32::total_cmp);
        let words: Vec<i32> = entries.iter().map(|&entry| fixed(entry)).collect();
        let ends =
            words.windows(2).map(|pair| ((i64::from(pair[0]) + i64::from(pair[1])) >> 1) as i32).collect();
        Self { words, floats: entries, ends }
    }

    fn nearest(&self, difference: i32) -> usize {
        self.ends.partition_point(|&end| end < difference)
    }
}

/// One segment in the loop.
struct Loop<'a> {
    source: &'a Source,
    fixed_channels: usize,
    rows: Range<usize>,
}

impl Loop<'_> {
    /// A table of `len` entries for the segment, which starts from `pose`.
    fn fit(&self, pose: &[i32], len: usize) -> Table {
        let mut table = self.first_table(pose, len);
        let mut best = (f64::INFINITY, table.clone());
        for _ in 0..ROUNDS {
            let mut sums = vec![(0.0, 0.0); len];
            let mut distortion = 0.0;
            self.run(pose, &table, |channel, difference, entry| {
                let weight = self.source.weights[channel];
                let error = f64::from(difference - table.words[entry]);
                distortion += weight * error * error;
                sums[entry].0 += weight * f64::from(difference);
                sums[entry].1 += weight;
            });
            if distortion < best.0 {
                best = (distortion, table.clone());
            }
            let entries = sums
                .iter()
                .zip(&table.floats)
                .map(
                    |(&(sum, weight), &entry)| {
                        if weight > 0.0 { (sum / weight / 65536.0) as f32 } else { entry }
                    },
                )
                .collect();
            table = Table::new(entries);
        }
        best.1
    }

    /// Entries as dense as the cube root of the differences' weighted density, which is the density of the best
    /// quantiser with many levels (Panter and Dite), from the open-loop differences.
    fn first_table(&self, pose: &[i32], len: usize) -> Table {
        let mut differences: Vec<(i32, f64)> = Vec::with_capacity(self.rows.len() * self.source.channels);
        for row in self.rows.clone() {
            let before = match row {
                0 => pose,
                _ => &self.source.targets[(row - 1) * self.source.channels..][..self.source.channels],
            };
            let now = &self.source.targets[row * self.source.channels..][..self.source.channels];
            for channel in self.fixed_channels..self.source.channels {
                let difference = now[channel].wrapping_sub(before[channel]);
                differences.push((difference, self.source.weights[channel]));
            }
        }
        if differences.is_empty() {
            return Table::new(vec![0.0; len]);
        }
        differences.sort_unstable_by_key(|&(difference, _)| difference);
        // Cells of equal count, their width w and weight W: the integral of the density's cube root over a cell
        // is (W/w)^(1/3) · w.
        let cells: Vec<(f64, f64, f64)> = (0..len)
            .filter_map(|cell| {
                let part = &differences[cell * differences.len() / len..(cell + 1) * differences.len() / len];
                let (low, high) = (part.first()?.0, part.last()?.0);
                let weight: f64 = part.iter().map(|&(_, weight)| weight).sum();
                let width = f64::from(high) - f64::from(low) + 1.0;
                Some((f64::from(low), width, (weight * width * width).cbrt()))
            })
            .collect();
        let total: f64 = cells.iter().map(|cell| cell.2).sum();
        let mut entries = Vec::with_capacity(len);
        let (mut cell, mut before) = (0, 0.0);
        for index in 0..len {
            let aim = total * (index as f64 + 0.5) / len as f64;
            while cell + 1 < cells.len() && before + cells[cell].2 < aim {
                before += cells[cell].2;
                cell += 1;
            }
            let (low, width, share) = cells[cell];
            let along = if share > 0.0 { (aim - before) / share } else { 0.5 };
            entries.push(((low + width * along.clamp(0.0, 1.0)) / 65536.0) as f32);
        }
        Table::new(entries)
    }

    /// Runs the loop over the segment and tells `choose` the channel, difference and entry of each choice.
    fn run(&self, pose: &[i32], table: &Table, mut choose: impl FnMut(usize, i32, usize)) {
        let channels = self.fixed_channels..self.source.channels;
        let mut pose = pose.to_vec();
        for row in self.rows.clone() {
            let targets = &self.source.targets[row * self.source.channels..][..self.source.channels];
            for channel in channels.clone() {
                let difference = targets[channel].wrapping_sub(pose[channel]);
                let entry = table.nearest(difference);
                pose[channel] = pose[channel].wrapping_add(table.words[entry]);
                choose(channel, difference, entry);
            }
        }
    }

    /// Codes the segment, and leaves the decoder's last pose in `pose`.
    fn code(&self, pose: &mut [i32], table: Table) -> Segment {
        let mut indices = Vec::with_capacity(self.rows.len() * (self.source.channels - self.fixed_channels));
        let before = pose.to_vec();
        self.run(&before, &table, |channel, _, entry| {
            pose[channel] = pose[channel].wrapping_add(table.words[entry]);
            indices.push(entry as u16);
        });
        let mut floats = Vec::with_capacity(self.rows.len() * self.fixed_channels);
        for row in self.rows.clone() {
            let targets = &self.source.targets[row * self.source.channels..];
            for (value, &target) in pose[..self.fixed_channels].iter_mut().zip(targets) {
                let difference = float(target.wrapping_sub(*value));
                *value = value.wrapping_add(fixed(difference));
                floats.push(difference);
            }
        }
        Segment { table: table.floats, floats, indices }
    }
}

fn float(bits: i32) -> f32 {
    (f64::from(bits) / 65536.0) as f32
}

/// As the decoder reads it.
fn fixed(value: f32) -> i32 {
    fixed_from_f32_bits(value.to_bits())
}

//! The paper's encoder (sections 2, 3.1 and 3.2).

use super::parameters::Parameters;
use super::writer::{Coded, Segment};
use crate::source::Source;

/// The resolution quantisation term `M` of section 3.1: differences are told apart to 1/10000.
const RESOLUTION: f64 = 10_000.0;

pub(super) fn encode(source: &Source, parameters: Parameters, exponent: Option<f64>) -> Coded {
    let pose = source.samples[..source.channels].iter().map(|&value| value as f32).collect();
    let fixed_channels = usize::from(parameters.fixed_channels);
    let segments = source
        .segments(parameters.segment_frames)
        .map(|rows| {
            let mut floats = Vec::with_capacity(rows.len() * fixed_channels);
            let mut quantised = Vec::with_capacity(rows.len() * (source.channels - fixed_channels));
            for row in rows {
                let now = &source.samples[row * source.channels..][..source.channels];
                // The first row is the difference of the first frame to itself.
                let before = &source.samples[row.saturating_sub(1) * source.channels..][..source.channels];
                let differences = now.iter().zip(before).map(|(now, before)| now - before);
                for (channel, difference) in differences.enumerate() {
                    if channel < fixed_channels {
                        floats.push(difference as f32);
                    } else {
                        quantised.push((difference * RESOLUTION).round() as i64);
                    }
                }
            }
            let levels = &source.levels[fixed_channels..];
            let (table, indices) = bucket(&quantised, levels, parameters.index_bits, exponent);
            Segment { table, floats, indices }
        })
        .collect();
    Coded { pose, segments }
}

/// Buckets of equal frequency, and one value for each (sections 3.1 and 3.2).
///
/// `quantised` is row-major with a column for every element of `levels`. Equal numbers share a bucket, since an
/// index depends on nothing but the number: a number that takes more than one bucket's share leaves the next
/// ones empty.
fn bucket(quantised: &[i64], levels: &[u8], index_bits: u8, exponent: Option<f64>) -> (Vec<f32>, Vec<u16>) {
    let buckets = 1usize << index_bits;
    let mut sorted = quantised.to_vec();
    sorted.sort_unstable();
    // The bucket of a number is where the middle of its share of the sorted array lies.
    let mut numbers: Vec<(i64, u16)> = Vec::new();
    let mut start = 0;
    for equal in sorted.chunk_by(|left, right| left == right) {
        let middle = (2 * start + equal.len()) * buckets / (2 * sorted.len());
        numbers.push((equal[0], middle as u16));
        start += equal.len();
    }
    let indices: Vec<u16> = quantised
        .iter()
        .map(|number| match numbers.binary_search_by_key(number, |&(number, _)| number) {
            Ok(found) => numbers[found].1,
            Err(_) => unreachable!("every number was collected above"),
        })
        .collect();

    let mut entries = vec![Entry::default(); buckets];
    for (position, (&number, &index)) in quantised.iter().zip(&indices).enumerate() {
        entries[usize::from(index)].add(number, levels[position % levels.len()], exponent);
    }
    // No index leads to an empty bucket; it takes the value before it.
    let mut last = 0.0;
    let table = entries
        .iter()
        .map(|entry| {
            if entry.weight > 0.0 {
                last = entry.sum / entry.weight / RESOLUTION;
            }
            last as f32
        })
        .collect();
    (table, indices)
}

/// The weighted average of equation 1.
#[derive(Clone, Default)]
struct Entry {
    level: u8,
    sum: f64,
    weight: f64,
}

impl Entry {
    fn add(&mut self, number: i64, level: u8, exponent: Option<f64>) {
        let weight = match exponent {
            Some(k) => f64::from(level).powf(-k),
            None => {
                // Selective averaging: a lower level throws away what the higher ones had collected.
                if self.weight > 0.0 && level > self.level {
                    return;
                }
                if level < self.level {
                    *self = Self::default();
                }
                1.0
            }
        };
        self.level = level;
        self.sum += weight * number as f64;
        self.weight += weight;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_have_an_equal_share() {
        let numbers: Vec<i64> = (0..25_600).map(|i| (i * 7919) % 25_600).collect();
        let (table, indices) = bucket(&numbers, &[1], 8, None);
        let mut counts = [0; 256];
        indices.iter().for_each(|&index| counts[usize::from(index)] += 1);
        assert_eq!(counts, [100; 256]);
        assert!((f64::from(table[3]) - (300.0 + 399.0) / 2.0 / RESOLUTION).abs() < 1e-9);
    }

    #[test]
    fn equal_numbers_share_a_bucket() {
        let mut numbers = vec![0; 1000];
        numbers.extend(1..=10);
        let (table, indices) = bucket(&numbers, &[1], 8, None);
        assert!(indices[..1000].iter().all(|&index| index == indices[0]));
        assert_eq!(table[usize::from(indices[0])], 0.0);
        assert!((f64::from(table[usize::from(indices[1009])]) - 0.001).abs() < 1e-3);
    }

    #[test]
    fn the_lowest_level_of_a_bucket_counts_alone() {
        let mut entry = Entry::default();
        for (number, level) in [(10, 3), (20, 2), (30, 2), (99, 4)] {
            entry.add(number, level, None);
        }
        assert_eq!((entry.sum, entry.weight), (50.0, 2.0), "falls back to the next smallest level");
        entry.add(7, 1, None);
        assert_eq!((entry.sum, entry.weight), (7.0, 1.0));
    }

    #[test]
    fn equation_1_with_a_finite_exponent_tends_to_selective_averaging() {
        let average = |exponent| {
            let mut entry = Entry::default();
            for (number, level) in [(10, 1), (20, 2), (40, 4)] {
                entry.add(number, level, exponent);
            }
            entry.sum / entry.weight
        };
        assert!((average(Some(0.0)) - 70.0 / 3.0).abs() < 1e-12);
        assert!((average(Some(1.0)) - (10.0 + 10.0 + 10.0) / 1.75).abs() < 1e-12);
        assert!((average(Some(60.0)) - average(None)).abs() < 1e-12);
    }
}

//! The autocorrelation method over a sliding window of decoded samples (7-15 to 7-18).
//!
//! Like [`adaptive`](super::adaptive), but the short-term autocorrelation is that of the last N movements alone, as the
//! document has it: R(k) is the sum of d(i) · d(i − k) over all i for which both are in the window. The sums are only taken
//! when coefficients are solved for: a frame does no more than keep its movement.
//!
//! The windows lie in words that the caller lends: a row for each of the last N frames, with a word for each channel, and nothing
//! else. So all channels of a frame are in sequence, and which rows these are is known before the first.
//! Movements have 12 bits and a sign, so sums of 120 products fit a word.

use core::cell::Cell;

/// Shortest window: half a second at 30 frames a second.
pub const SHORTEST: u8 = 15;

/// Longest window: four seconds at 30 frames a second.
pub const LONGEST: u8 = 120;

/// Which row of the ring is a frame's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ring {
    /// Channels: words of a row.
    pub channels: usize,
    /// Rows: frames of the window.
    pub length: usize,
    /// The frame's row: the number of the frame since the entry point, from 0, modulo the length.
    pub row: usize,
    /// How many movements there are with the frame's, at most the length.
    pub count: usize,
}

/// The rows that a frame is predicted from, and its own.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'r> {
    /// Its own: those that leave the window.
    pub now: &'r [Cell<u16>],
    /// d(n − 1).
    pub newest: &'r [Cell<u16>],
    /// d(n − 2).
    pub before: &'r [Cell<u16>],
}

impl Ring {
    const fn previous(&self, row: usize) -> usize {
        if row == 0 { self.length.wrapping_sub(1) } else { row.wrapping_sub(1) }
    }

    /// The rows of the channels from `first` on. Empty where `words` is too short for them.
    pub fn rows<'r>(&self, words: &'r mut [u16], first: usize) -> Rows<'r> {
        let words = Cell::from_mut(words).as_slice_of_cells();
        let row = |number: usize| {
            let from = number.wrapping_mul(self.channels);
            words.get(from.wrapping_add(first)..from.wrapping_add(self.channels)).unwrap_or_default()
        };
        let newest = self.previous(self.row);
        Rows { now: row(self.row), newest: row(newest), before: row(self.previous(newest)) }
    }

    /// R(0), R(1) and R(2) of a channel's window, after the frame's movement was taken in. Three 16-bit multiplies a
    /// movement.
    pub fn sums(&self, words: &[u16], channel: usize) -> [i32; 3] {
        let words = words.get(..self.count.wrapping_mul(self.channels)).unwrap_or_default();
        // The oldest row follows the newest, in a ring that is full.
        let end = self.row.wrapping_add(1).wrapping_mul(self.channels);
        let (newer, older) = words.split_at_checked(end).unwrap_or((words, &[]));
        let older = add(Sums::default(), older, channel, self.channels);
        let Sums { r0, r1, r2, .. } = add(older, newer, channel, self.channels);
        [r0, r1, r2]
    }

    /// Makes windows have no movements yet.
    pub fn clear(words: &mut [u16], channels: usize) {
        // What comes before the first row in a ring: nothing else is read before it is written.
        let from = words.len().saturating_sub(channels.saturating_mul(2));
        words.get_mut(from..).unwrap_or_default().fill(0);
    }
}

/// The sums of a window, as far as it was gone through, and the last movements there. Not arrays: in pairs, they would be kept
/// in halves of a word.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    r0: i32,
    r1: i32,
    r2: i32,
    newest: i32,
    before: i32,
}

/// Adds each word that is `stride` after the one before.
#[inline(always)]
fn add(sums: Sums, words: &[u16], first: usize, stride: usize) -> Sums {
    let Sums { mut r0, mut r1, mut r2, mut newest, mut before } = sums;
    let mut at = first;
    while let Some(&word) = words.get(at) {
        let movement = i32::from(word.cast_signed());
        // Sums of at most 120 products, none above 2^24.
        r2 = r2.wrapping_add(movement.wrapping_mul(before));
        r1 = r1.wrapping_add(movement.wrapping_mul(newest));
        r0 = r0.wrapping_add(movement.wrapping_mul(movement));
        (before, newest) = (newest, movement);
        at = at.wrapping_add(stride);
    }
    Sums { r0, r1, r2, newest, before }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::predict::adaptive::{movement, solve};
    use crate::testing::{Random, times};
    use std::vec;
    use std::vec::Vec;

    /// The sums as the document has them, over the last `length` movements.
    fn whole(movements: &[i32], length: usize) -> [i32; 3] {
        let from = movements.len().saturating_sub(length);
        let window: Vec<i64> = movements[from..].iter().map(|&m| i64::from(m)).collect();
        [0, 1, 2].map(|lag| {
            let pairs = window.iter().skip(lag).zip(&window);
            i32::try_from(pairs.map(|(a, b)| a * b).sum::<i64>()).unwrap()
        })
    }

    /// The ring of two channels at frame `number`, from 1.
    fn ring(number: usize, length: usize) -> Ring {
        Ring { channels: 2, length, row: (number - 1) % length, count: number.min(length) }
    }

    #[test]
    fn sums_are_those_of_the_window_for_any_movement() {
        let mut random = Random::new(11);
        // Interpreted, the long windows alone take a quarter of an hour.
        let lengths: &[usize] = if cfg!(miri) { &[15] } else { &[15, 16, 17, 60, 119, 120] };
        for &length in lengths {
            // Nothing is as it was left.
            let mut words = vec![0xdead; 2 * length];
            Ring::clear(&mut words, 2);
            let mut movements = [const { Vec::new() }; 2];
            for number in 1..times(2000, 320) {
                let ring = ring(number, length);
                for (channel, movements) in movements.iter_mut().enumerate() {
                    let difference = match (number / times(250, 40) + channel) % 4 {
                        0 => i32::MIN,
                        1 => random.next() as i32,
                        2 => random.next() as i32 >> random.below(20),
                        _ => {
                            if number % 2 == 0 {
                                i32::MIN
                            } else {
                                i32::MAX
                            }
                        }
                    };
                    let Rows { now, newest, before } = ring.rows(&mut words, channel);
                    let past = [1, 2].map(|past| movements.iter().rev().nth(past - 1).copied().unwrap_or(0));
                    let found = [newest, before].map(|row| i32::from(row[0].get().cast_signed()));
                    assert_eq!(found, past, "{length} at {number}");
                    now[0].set(movement(difference).cast_unsigned());
                    movements.push(i32::from(movement(difference)));
                    let sums = ring.sums(&words, channel);
                    assert_eq!(sums, whole(movements, length), "{length} at {number}");
                    let [first, second] = solve(sums).map(|c| f64::from(c) / 16384.0);
                    assert!(second.abs() < 1.0 && first.abs() < 1.0 - second, "{first} {second}");
                }
            }
        }
    }

    #[test]
    fn what_left_the_window_is_forgotten() {
        let mut words = [0; 30];
        for number in 1..200 {
            let ring = ring(number, 15);
            let difference = if number % 3 == 0 { 40_000 } else { -7_000 };
            let now = ring.rows(&mut words, 0).now;
            now[0].set(movement(if number < 150 { difference } else { 3_000 }).cast_unsigned());
            now[1].set(movement(3_000).cast_unsigned());
            assert_eq!(ring.sums(&words, 0) == ring.sums(&words, 1), number >= 164, "{number}");
        }
    }

    #[test]
    fn too_few_words_are_no_panic() {
        for words in [&mut [][..], &mut [1, 2], &mut [1; 20]] {
            for (row, length, count) in
                [(0, 0, 0), (3, 15, 4), (14, 15, 15), (20, 3, 70), (usize::MAX, 15, 1)]
            {
                let ring = Ring { channels: 2, length, row, count };
                ring.rows(words, 1);
                ring.sums(words, 1);
                ring.sums(words, usize::MAX);
                Ring::clear(words, 2);
            }
        }
    }
}

//! The autocorrelation method over a sliding window of decoded samples (7-15 to 7-18).
//!
//! Like [`adaptive`](super::adaptive), but the short-term autocorrelation is that of the last N movements alone, as the
//! document has it: R(k) is the sum of d(i) · d(i − k) over all i for which both are in the window. The sums are kept as the
//! window slides: what comes in is added, what goes out subtracted, so a sample costs the same whatever N is.
//!
//! The window lies in a ring of words that the caller lends: N words a channel, on top of the 16 bytes of a [`Correlation`].
//! Movements have 12 bits and a sign, so sums of 120 products fit a word.

use super::adaptive::{Correlation, MOST, SHIFT};

/// Shortest window: half a second at 30 frames a second.
pub const SHORTEST: u8 = 15;

/// Longest window: four seconds at 30 frames a second.
pub const LONGEST: u8 = 120;

/// Where in their rings all channels are: the same place, since all get a movement a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slots {
    /// The place that the next movement takes, and those after it: the three oldest movements, once the ring is full.
    places: [usize; 3],
    full: bool,
}

impl Slots {
    /// Where frame `number` since the entry point is, from 1, in a window of `length` frames. One division.
    pub fn at(number: u32, length: u8) -> Self {
        let length = u32::from(length);
        let place = |past: u32| {
            let number = number.wrapping_sub(1).wrapping_add(past);
            number.checked_rem(length).unwrap_or(0) as usize
        };
        let [first, second, third] = [place(0), place(1), place(2)];
        Self { places: [first, second, third], full: number > length }
    }
}

impl Correlation {
    /// Takes in the movement from one decoded value to the next, and out the one that leaves the window. Six 16-bit
    /// multiplies.
    ///
    /// `ring` has as many words as the window is long. What it holds before the first frame does not matter.
    #[inline(always)]
    pub fn slide(&mut self, movement: i32, ring: &mut [u16], slots: Slots) {
        let new = (movement >> SHIFT).clamp(!MOST, MOST);
        let [newest, before] = self.movements;
        let [oldest, second, third] = slots.places;
        let word = |ring: &[u16], place: usize| ring.get(place).copied().unwrap_or(0).cast_signed();
        let now = products(new as i16, [newest, before]);
        let leaving = if slots.full {
            products(word(ring, oldest), [word(ring, second), word(ring, third)])
        } else {
            [0; 3]
        };
        // Sums of at most 120 products, none above 2^24.
        for (sum, (now, leaving)) in self.sums.iter_mut().zip(now.into_iter().zip(leaving)) {
            *sum = sum.wrapping_add(now).wrapping_sub(leaving);
        }
        if let Some(place) = ring.get_mut(oldest) {
            *place = (new as i16).cast_unsigned();
        }
        self.movements = [new as i16, newest];
    }
}

/// The products of a movement with itself and two others.
#[inline(always)]
fn products(movement: i16, others: [i16; 2]) -> [i32; 3] {
    let [first, second] = others;
    [movement, first, second].map(|other| i32::from(movement).wrapping_mul(i32::from(other)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;
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

    #[test]
    fn sums_are_those_of_the_window_for_any_movement() {
        let mut random = Random(11);
        // Interpreted, the long windows alone take a quarter of an hour.
        let lengths: &[u8] = if cfg!(miri) { &[15] } else { &[15, 16, 17, 60, 119, 120] };
        for &length in lengths {
            let mut channel = Correlation::default();
            // Nothing is as it was left.
            let mut ring = vec![0xdead; usize::from(length)];
            let mut movements = Vec::new();
            for number in 1..2000u32 {
                let movement = match number / 250 % 4 {
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
                channel.slide(movement, &mut ring, Slots::at(number, length));
                movements.push((movement >> SHIFT).clamp(!MOST, MOST));
                assert_eq!(channel.sums, whole(&movements, length.into()), "{length} at {number}");
                let [first, second] = channel.solve().map(|c| f64::from(c) / 16384.0);
                assert!(second.abs() < 1.0 && first.abs() < 1.0 - second, "{first} {second}");
            }
        }
    }

    #[test]
    fn what_left_the_window_is_forgotten() {
        let mut lively = Correlation::default();
        let mut calm = Correlation::default();
        let (mut ring, mut other) = ([0; 15], [0; 15]);
        for number in 1..200 {
            let slots = Slots::at(number, 15);
            let movement = if number % 3 == 0 { 40_000 } else { -7_000 };
            lively.slide(if number < 150 { movement } else { 3_000 }, &mut ring, slots);
            calm.slide(3_000, &mut other, slots);
            assert_eq!(lively.sums == calm.sums, number >= 164, "{number}");
        }
    }

    #[test]
    fn a_short_ring_is_no_panic() {
        let mut channel = Correlation::default();
        for number in 0..100 {
            channel.slide(70_000, &mut [], Slots::at(number, 15));
            channel.slide(70_000, &mut [1, 2], Slots::at(number, 0));
        }
    }
}

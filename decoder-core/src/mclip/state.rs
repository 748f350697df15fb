//! What a decoder keeps of a channel.

use super::codec::{Adpcm, Codec};
use super::header::Channel;
use crate::quantise::{Grid, step};

/// A channel between frames, in 12 bytes. Its last value is in the pose.
///
/// What a word is depends on the codec: whatever the loop over the channels needs is computed at the entry point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct State {
    /// What the quantiser keeps: a step in words, or its index where it adapts.
    pub(super) step: i32,
    /// What the predictor keeps: the value before the last one (second order), the leak (first order), the value that
    /// is predicted (pcm), or the coefficients (adaptive).
    pub(super) second: i32,
    /// The second order's coefficient.
    pub(super) coefficient: i16,
    /// Bits of a code; a channel of 0 bits keeps its value.
    pub(super) bits: u8,
    /// Huffman: the table of the next code. Fixed width: in the first channel of eight, the bits of all of them, or 0
    /// where they differ.
    pub(super) context: u8,
}

impl State {
    /// What memory holds before a decoder uses it.
    pub const EMPTY: Self = Self { step: 0, second: 0, coefficient: 0, bits: 0, context: 0 };

    /// A channel at an entry point, with the value that it has there.
    pub(super) fn entry(codec: &Codec<'_>, channel: &Channel<'_>, value: i32, context: u8) -> Self {
        let &Channel { step: index, bits, coefficients, low, .. } = channel;
        let [first, _] = coefficients;
        let size = step::size(index);
        let (step, second, coefficient) = match codec {
            Codec::Pcm => {
                let grid = Grid { low, mantissa: first, exponent: index };
                (grid.step(), grid.middle(bits), 0)
            }
            Codec::MuLaw(_) | Codec::Dpcm { order: 1 } => (size, first.into(), 0),
            Codec::Dpcm { order: 0 } | Codec::Qmd(_) => (size, 0, 0),
            Codec::Dpcm { .. } => (size, value, first),
            Codec::Adpcm(Adpcm { predictor: None, .. }) => (index.into(), value, first),
            Codec::Adpcm(Adpcm { quantiser, .. }) => {
                (if quantiser.adapts() { index.into() } else { size }, pair(coefficients), 0)
            }
        };
        Self { step, second, coefficient, bits, context }
    }

    /// Bits of the channel's code.
    pub const fn bits(&self) -> u8 {
        self.bits
    }

    /// What the quantiser keeps.
    pub const fn step(&self) -> i32 {
        self.step
    }
}

/// Two coefficients in a word.
#[inline(always)]
pub(super) const fn pair([first, second]: [i16; 2]) -> i32 {
    (first as i32 & 0xffff) | (second as i32).wrapping_shl(16)
}

/// The two coefficients of a word.
#[inline(always)]
pub(super) const fn unpair(word: i32) -> [i16; 2] {
    [word as i16, (word >> 16) as i16]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_twelve_bytes() {
        assert_eq!(size_of::<State>(), 12);
    }

    #[test]
    fn pairs_are_taken_apart_again() {
        for pairs in [[0, 0], [-1, 1], [i16::MIN, i16::MAX], [i16::MAX, i16::MIN], [5, -5]] {
            assert_eq!(unpair(pair(pairs)), pairs);
        }
    }
}

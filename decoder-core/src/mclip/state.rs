//! What a decoder keeps of a channel.

use super::codec::{Adpcm, Codec};
use super::record::Channel;
use crate::quantise::{Grid, Step, step};

/// A channel between frames, in 12 bytes. Its last value is in the pose.
///
/// What a word is depends on the codec: whatever the loop over the channels needs is computed once, from the channel's
/// record. What an entry point needs is in it too, so that no entry point reads the record again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct State {
    /// What the quantiser keeps: a step in words; or, where it adapts, the step's index in the lowest byte, and above it
    /// that of the first step.
    pub(super) step: Step,
    /// What the predictor keeps: the value before the last one (second order), the leak with its sign changed (first order), the value that
    /// is predicted (pcm), or the coefficients (adaptive).
    pub(super) second: i32,
    /// In the lowest five bits those of a code, in the six above those of a value at an entry point, then the places
    /// that this is shifted by.
    widths: u16,
    /// The second order's coefficient.
    pub(super) coefficient: i8,
    /// Huffman: the table of the next code. Fixed width: in the first channel of eight, the bits of all of them, or 0
    /// where they differ.
    pub(super) context: u8,
}

impl State {
    /// What memory holds before a decoder uses it.
    pub const EMPTY: Self = Self { step: Step::of(0), second: 0, widths: 0, coefficient: 0, context: 0 };

    /// What a channel's record says.
    pub(super) fn of(codec: &Codec<'_>, channel: &Channel<'_>) -> Self {
        let &Channel { step: index, bits, coefficient, low, entry_bits, entry_shift, .. } = channel;
        // A channel of 0 bits has codes of 0 all the time: no step, and no predictor, leave it where it is.
        let size = if bits == 0 { 0 } else { step::size(index) };
        let (step, second) = match codec {
            Codec::Pcm => {
                let grid = Grid { low, mantissa: coefficient, exponent: index };
                (grid.step(), grid.middle(bits))
            }
            Codec::MuLaw(_) | Codec::Dpcm { order: 1 } => {
                (size, i32::from(coefficient.max(-i16::MAX)).wrapping_neg())
            }
            Codec::Adpcm(Adpcm { quantiser, .. }) if quantiser.adapts() => (quantiser.step(index).word(), 0),
            _ => (size, 0),
        };
        let widths = u16::from(bits)
            | u16::from(entry_bits).wrapping_shl(BITS_WIDTH)
            | u16::from(entry_shift).wrapping_shl(BITS_WIDTH.wrapping_add(ENTRY_BITS_WIDTH));
        let coefficient = coefficient.clamp(i8::MIN.into(), i8::MAX.into()) as i8;
        Self { step: Step::of(step), second, widths, coefficient, context: 0 }
    }

    /// Bits of the channel's code; a channel of 0 bits keeps its value.
    #[inline(always)]
    pub const fn bits(&self) -> u8 {
        (self.widths & mask(BITS_WIDTH)) as u8
    }

    /// Bits of the channel's value at an entry point, and the places that it is shifted by.
    #[inline(always)]
    pub(super) const fn entry(&self) -> (u32, u32) {
        let rest = self.widths >> BITS_WIDTH;
        ((rest & mask(ENTRY_BITS_WIDTH)) as u32, (rest >> ENTRY_BITS_WIDTH) as u32)
    }

    /// What the quantiser keeps.
    pub const fn step(&self) -> i32 {
        self.step.word()
    }

    /// Back to the first step.
    pub(super) const fn reset_step(&mut self) {
        self.step.reset();
    }
}

/// Bits of the fields in [`State::widths`].
const BITS_WIDTH: u32 = 5;
const ENTRY_BITS_WIDTH: u32 = 6;

const fn mask(width: u32) -> u16 {
    1u16.wrapping_shl(width).wrapping_sub(1)
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
    fn widths_of_all_sizes_fit() {
        let channel = |bits, entry_bits, entry_shift| Channel {
            joint: "",
            kind: super::super::ChannelKind::Rx,
            low: 0,
            entry_bits,
            entry_shift,
            bits,
            step: 0,
            group: 0,
            coefficient: 0,
        };
        for (bits, entry_bits, shift) in [(0, 0, 0), (16, 32, 27), (1, 31, 26), (15, 1, 1)] {
            let state = State::of(&Codec::Dpcm { order: 2 }, &channel(bits, entry_bits, shift));
            assert_eq!((state.bits(), state.entry()), (bits, (entry_bits.into(), shift.into())));
        }
    }

    #[test]
    fn pairs_are_taken_apart_again() {
        for pairs in [[0, 0], [-1, 1], [i16::MIN, i16::MAX], [i16::MAX, i16::MIN], [5, -5]] {
            assert_eq!(unpair(pair(pairs)), pairs);
        }
    }
}

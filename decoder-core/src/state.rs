//! What a decoder of a scalar codec keeps of a channel.

use crate::channel::Channel;
use crate::quantise::quantiser::Step;

/// A channel between frames, in 12 bytes. Its last value is in the pose.
///
/// What a word is depends on the codec: whatever the loop over the channels needs is computed once, from the channel's
/// record. What an entry point needs is in it too, so that no entry point reads the record again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct State {
    /// What the quantiser keeps: a step in words; or, where it adapts, the step's index in the lowest byte, and above it
    /// that of the first step.
    pub(crate) step: Step,
    /// What the predictor keeps: the value before the last one (second order), the leak with its sign changed (first order), the value that
    /// is predicted (pcm), or the coefficients (adaptive).
    pub(crate) second: i32,
    /// In the lowest five bits those of a code, in the six above those of a value at an entry point, then the places
    /// that this is shifted by.
    widths: u16,
    /// The second order's coefficient.
    pub(crate) coefficient: i8,
    /// Huffman: the table of the next code. Fixed width: in the first channel of eight, the bits of all of them, or 0
    /// where they differ.
    pub(crate) context: u8,
}

impl State {
    /// What memory holds before a decoder uses it.
    pub const EMPTY: Self = Self { step: Step::of(0), second: 0, widths: 0, coefficient: 0, context: 0 };

    /// A channel whose record is this, and of which the codec keeps these two at first.
    pub fn new(channel: &Channel<'_>, step: Step, second: i32) -> Self {
        let &Channel { bits, coefficient, entry_bits, entry_shift, .. } = channel;
        let widths = u16::from(bits)
            | u16::from(entry_bits).wrapping_shl(BITS_WIDTH)
            | u16::from(entry_shift).wrapping_shl(BITS_WIDTH.wrapping_add(ENTRY_BITS_WIDTH));
        let coefficient = coefficient.clamp(i8::MIN.into(), i8::MAX.into()) as i8;
        Self { step, second, widths, coefficient, context: 0 }
    }

    /// Bits of the channel's code; a channel of 0 bits keeps its value.
    #[inline(always)]
    pub const fn bits(&self) -> u8 {
        (self.widths & mask(BITS_WIDTH)) as u8
    }

    /// Bits of the channel's value at an entry point, and the places that it is shifted by.
    #[inline(always)]
    pub(crate) const fn entry(&self) -> (u32, u32) {
        let rest = self.widths >> BITS_WIDTH;
        ((rest & mask(ENTRY_BITS_WIDTH)) as u32, (rest >> ENTRY_BITS_WIDTH) as u32)
    }

    /// What the quantiser keeps.
    pub const fn step(&self) -> i32 {
        self.step.word()
    }

    /// Back to the first step.
    pub(crate) const fn reset_step(&mut self) {
        self.step.reset();
    }
}

/// Bits of the fields in [`State::widths`].
const BITS_WIDTH: u32 = 5;
const ENTRY_BITS_WIDTH: u32 = 6;

const fn mask(width: u32) -> u16 {
    1u16.wrapping_shl(width).wrapping_sub(1)
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
            kind: crate::channel::ChannelKind::Rx,
            low: 0,
            entry_bits,
            entry_shift,
            bits,
            step: 0,
            group: 0,
            coefficient: 0,
        };
        for (bits, entry_bits, shift) in [(0, 0, 0), (16, 32, 27), (1, 31, 26), (15, 1, 1)] {
            let state = State::new(&channel(bits, entry_bits, shift), Step::of(0), 0);
            assert_eq!((state.bits(), state.entry()), (bits, (entry_bits.into(), shift.into())));
        }
    }
}

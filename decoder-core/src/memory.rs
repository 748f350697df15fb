//! Memory for a decoder, which its caller lends: in arenas of whatever a codec makes of them.

use crate::I16F16;
use crate::error::{Error, Field};
use crate::state::State;

/// The memory that a decoder needs, in elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// Elements of the pose, and states.
    pub channels: usize,
    /// Words of 32 bits.
    pub words: usize,
    /// Halves of words, of 16 bits.
    pub halves: usize,
}

impl Needs {
    /// In bytes: 16 a channel, 4 a word, 2 a half.
    pub const fn bytes(&self) -> usize {
        self.channels
            .saturating_mul(size_of::<I16F16>().saturating_add(size_of::<State>()))
            .saturating_add(self.words.saturating_mul(size_of::<u32>()))
            .saturating_add(self.halves.saturating_mul(size_of::<u16>()))
    }

    /// The larger one of each.
    pub fn max(self, other: Self) -> Self {
        Self {
            channels: self.channels.max(other.channels),
            words: self.words.max(other.words),
            halves: self.halves.max(other.halves),
        }
    }
}

/// Memory that the caller lends: at least [`Needs`] of each. What is in it does not matter.
#[derive(Debug)]
pub struct Memory<'s> {
    /// The values of a frame.
    pub pose: &'s mut [I16F16],
    /// A state for every channel.
    pub states: &'s mut [State],
    /// Words of 32 bits, for what a codec keeps besides.
    pub words: &'s mut [u32],
    /// Halves of words, for what a codec and an entropy stage keep besides.
    pub halves: &'s mut [u16],
}

impl<'s> Memory<'s> {
    /// Exactly what is needed, off the front of each.
    ///
    /// # Errors
    /// [`Error::OutputTooSmall`] with the arena that is.
    pub fn take(self, needs: Needs) -> Result<Self, Error> {
        Ok(Self {
            pose: front(self.pose, needs.channels, Field::Pose)?,
            states: front(self.states, needs.channels, Field::States)?,
            words: front(self.words, needs.words, Field::Words)?,
            halves: front(self.halves, needs.halves, Field::Halves)?,
        })
    }
}

/// The first `needed` elements of what a caller lends.
///
/// # Errors
/// [`Error::OutputTooSmall`] where there are fewer.
pub(crate) fn front<T>(slice: &mut [T], needed: usize, field: Field) -> Result<&mut [T], Error> {
    let lent = slice.len();
    slice.get_mut(..needed).ok_or(Error::OutputTooSmall { field, needed, lent })
}

/// Memory of a decoder in one piece: for clips of up to `C` channels that need up to `W` words and `H` halves
/// ([`Needs`]). 16 C + 4 W + 2 H bytes.
///
/// ```
/// use decoder_core::mclip::Workspace;
/// type Decoder = Workspace<62, 0, 2048>;
/// assert_eq!(size_of::<Decoder>(), Decoder::CAPACITY.bytes());
/// assert_eq!(Decoder::EMPTY.lend().halves.len(), 2048);
/// ```
#[derive(Debug)]
pub struct Workspace<const C: usize, const W: usize, const H: usize> {
    pose: [I16F16; C],
    states: [State; C],
    words: [u32; W],
    halves: [u16; H],
}

impl<const C: usize, const W: usize, const H: usize> Workspace<C, W, H> {
    /// Memory that no decoder has used.
    pub const EMPTY: Self =
        Self { pose: [I16F16::ZERO; C], states: [State::EMPTY; C], words: [0; W], halves: [0; H] };

    /// What a decoder that is lent this may need.
    pub const CAPACITY: Needs = Needs { channels: C, words: W, halves: H };

    /// [`EMPTY`](Self::EMPTY).
    pub const fn new() -> Self {
        Self::EMPTY
    }

    /// Lends all of it to a decoder.
    pub const fn lend(&mut self) -> Memory<'_> {
        let Self { pose, states, words, halves } = self;
        Memory { pose, states, words, halves }
    }
}

impl<const C: usize, const W: usize, const H: usize> Default for Workspace<C, W, H> {
    fn default() -> Self {
        Self::EMPTY
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_of_it_is_lent() {
        type Decoder = Workspace<3, 2, 5>;
        for mut memory in [Decoder::new(), Decoder::default()] {
            let Memory { pose, states, words, halves } = memory.lend();
            assert_eq!((pose.len(), states.len(), words.len(), halves.len()), (3, 3, 2, 5));
        }
        assert_eq!(size_of::<Workspace<4, 4, 8>>(), Workspace::<4, 4, 8>::CAPACITY.bytes());
    }

    #[test]
    fn no_more_is_taken_than_is_needed() {
        let mut memory = Workspace::<4, 6, 9>::EMPTY;
        let needs = Needs { channels: 2, words: 0, halves: 9 };
        let taken = memory.lend().take(needs).unwrap();
        let found = (taken.pose.len(), taken.states.len(), taken.words.len(), taken.halves.len());
        assert_eq!(found, (2, 2, 0, 9));
        let more = Needs { words: 7, ..needs };
        let error = Error::OutputTooSmall { field: Field::Words, needed: 7, lent: 6 };
        assert_eq!(memory.lend().take(more).unwrap_err(), error);
    }

    #[test]
    fn the_larger_of_two_needs_is_enough_for_both() {
        let (a, b) = (Needs { channels: 1, words: 8, halves: 3 }, Needs { channels: 2, words: 7, halves: 3 });
        assert_eq!(a.max(b), Needs { channels: 2, words: 8, halves: 3 });
    }
}

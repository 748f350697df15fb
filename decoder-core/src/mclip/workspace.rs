//! Memory for a decoder, in one piece.

use super::{Memory, Needs, State};
use crate::I16F16;
use crate::predict::Correlation;

/// Memory of a decoder: for clips of up to `C` channels, `K` adaptive predictors (0 or C), and `W` 16-bit words of entropy
/// stage and windows ([`Needs`]). 16 C + 16 K + 2 W bytes.
///
/// ```
/// use decoder_core::mclip::Workspace;
/// type Decoder = Workspace<62, 0, 2048>;
/// assert_eq!(size_of::<Decoder>(), Decoder::CAPACITY.bytes());
/// assert_eq!(Decoder::EMPTY.lend().words.len(), 2048);
/// ```
#[derive(Debug)]
pub struct Workspace<const C: usize, const K: usize, const W: usize> {
    pose: [I16F16; C],
    states: [State; C],
    correlations: [Correlation; K],
    words: [u16; W],
}

impl<const C: usize, const K: usize, const W: usize> Workspace<C, K, W> {
    /// Memory that no decoder has used.
    pub const EMPTY: Self = Self {
        pose: [I16F16::ZERO; C],
        states: [State::EMPTY; C],
        correlations: [Correlation::EMPTY; K],
        words: [0; W],
    };

    /// What a decoder that is lent this may need.
    pub const CAPACITY: Needs = Needs { channels: C, correlations: K, words: W };

    /// [`EMPTY`](Self::EMPTY).
    pub const fn new() -> Self {
        Self::EMPTY
    }

    /// Lends all of it to a decoder.
    pub const fn lend(&mut self) -> Memory<'_> {
        let Self { pose, states, correlations, words } = self;
        Memory { pose, states, correlations, words }
    }
}

impl<const C: usize, const K: usize, const W: usize> Default for Workspace<C, K, W> {
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
            let Memory { pose, states, correlations, words } = memory.lend();
            assert_eq!((pose.len(), states.len(), correlations.len(), words.len()), (3, 3, 2, 5));
        }
        assert_eq!(size_of::<Workspace<4, 4, 8>>(), Workspace::<4, 4, 8>::CAPACITY.bytes());
    }
}

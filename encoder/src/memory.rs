//! Memory for the decoder, from the heap.

use decoder_core::I16F16;
use decoder_core::mclip::{Memory, Needs, State};

/// As much memory as a clip's decoder needs.
#[derive(Clone, Debug)]
pub struct OwnedMemory {
    pose: Vec<I16F16>,
    states: Vec<State>,
    words: Vec<u32>,
    halves: Vec<u16>,
}

impl OwnedMemory {
    /// Memory for these needs.
    pub fn new(needs: Needs) -> Self {
        Self {
            pose: vec![I16F16::ZERO; needs.channels],
            states: vec![State::EMPTY; needs.channels],
            words: vec![0; needs.words],
            halves: vec![0; needs.halves],
        }
    }

    /// The memory as a decoder takes it.
    pub fn lend(&mut self) -> Memory<'_> {
        Memory {
            pose: &mut self.pose,
            states: &mut self.states,
            words: &mut self.words,
            halves: &mut self.halves,
        }
    }
}

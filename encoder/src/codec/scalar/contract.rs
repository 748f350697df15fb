//! What an encoder of a scalar codec is.

use crate::codec::encode::Encode;
use crate::column::{Choice, Column};
use crate::error::EncodeError;
use crate::task::Task;
use decoder_core::mclip::Channel;

/// The settings of a codec with a code a channel and frame.
///
/// They decide what a clip's header says of codec and channels. The codes follow from that: they are those that bring the
/// decoder nearest to the motion, and [`simulate`](super::simulate) finds them for every codec.
pub trait ScalarEncode: Encode {
    /// Whether channels have grids of values, as [`Rules::grid`](decoder_core::Rules::grid) has it; else they have steps.
    fn has_grids(&self) -> bool {
        false
    }

    /// Channels in a row that the decoder treats in turns, so that their places matter: 1 where they do not.
    fn turns(&self) -> usize {
        1
    }

    /// The record of a channel that is coded like this, without its name.
    fn record(&self, column: &Column, choice: Choice) -> Channel<'static> {
        column.record_in_steps(choice)
    }

    /// The best way to code every channel with codes of `bits` bits, from 1 to [`most_bits`](Encode::most_bits).
    ///
    /// # Errors
    /// [`EncodeError::Refused`] where a setting is outside what the format has.
    fn allocate_bits(&self, task: &Task<'_>, bits: u8) -> Result<Allocation, EncodeError>;

    /// The best way to code every channel with steps of so many words, one for each channel.
    ///
    /// # Errors
    /// [`EncodeError::NoFreeSteps`] unless [`has_free_steps`](Encode::has_free_steps), and [`EncodeError::Refused`] where a
    /// setting is outside what the format has.
    fn allocate_steps(&self, task: &Task<'_>, steps: &[f64]) -> Result<Allocation, EncodeError>;
}

/// How all channels of a clip are coded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Allocation {
    /// The codec's parameters, as its header has them.
    pub parameters: Vec<u8>,
    /// What every channel is coded like.
    pub choices: Vec<Choice>,
    /// How much smaller than half a step a difference counts, in 64ths of a step: rounding towards zero makes codes
    /// smaller, and costs little where a step is coarse.
    pub dead_zone: i32,
}

//! What a scalar codec is: one that has a code a channel and frame.

use super::byte_groups::GroupLoop;
use super::loops::{Clock, Codes, Part};
use crate::channel::Channel;
use crate::codec::contract::Codec;
use crate::entropy::symbols::SymbolSource;
use crate::quantise::adaptive::Adaptive;
use crate::quantise::quantiser::Step;
use crate::state::State;
use fixed::types::I16F16;

/// A codec that predicts a channel's next value and adds the difference that a code stands for.
///
/// Where its channels have no grid, the first frame after an entry point has values of its own instead of codes.
pub trait ScalarCodec<'a>: Codec<'a> {
    /// What is kept of a channel for its quantiser and its predictor at first.
    fn initial(&self, channel: &Channel<'_>) -> (Step, i32);

    /// Whether the predictor needs the value before the last one.
    fn keeps_values(&self) -> bool {
        false
    }

    /// The quantiser of all channels that a [`GroupLoop`] is handed, if any.
    fn adaptive(&self) -> Option<Adaptive> {
        None
    }

    /// The loop over channels whose codes are of fixed width, where there is one for byte groups.
    fn group_loop(&self, _states: &[State]) -> Option<GroupLoop> {
        None
    }

    /// Rows of a ring that the codec keeps of its last frames.
    fn rows(&self) -> usize {
        0
    }

    /// Begins anew at an entry point; `part` is all channels. The values of the channels are set after that.
    fn restart(&self, _part: Part<'_>) {}

    /// Goes on to the next values of some channels.
    fn advance<C: Codes>(&self, part: Part<'_>, codes: &mut C);

    /// The same for all channels with codes out of their bits from `position` on, where there is one loop for both; gives where
    /// they end.
    fn advance_symbols<S: SymbolSource>(
        &self,
        _pose: &mut [I16F16],
        _states: &mut [State],
        _source: &mut S,
        _codes: &[u8],
        _position: usize,
    ) -> Option<usize> {
        None
    }

    /// What is to be done after a frame's last channel.
    fn finish(&self, _states: &mut [State], _words: &[u32], _halves: &[u16], _clock: &Clock) {}
}

//! What codecs keep of a channel at first: a step, and what their predictor needs.

use crate::channel::Channel;
use crate::quantise::quantiser::Step;
use crate::quantise::step::size;

/// The channel's step as a word. A channel of 0 bits has codes of 0 all the time: no step, and no predictor, leave it where
/// it is.
pub fn step_size(channel: &Channel<'_>) -> Step {
    Step::of(if channel.bits == 0 { 0 } else { size(channel.step) })
}

/// The step, and the leak of the predictor of first order with its sign changed.
pub fn first_order(channel: &Channel<'_>) -> (Step, i32) {
    (step_size(channel), i32::from(channel.coefficient.max(-i16::MAX)).wrapping_neg())
}

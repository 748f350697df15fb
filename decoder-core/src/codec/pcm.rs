//! pcm: values in steps between two limits (7-4), each channel its own.

use super::contract::Codec;
use super::scalar::byte_groups::{GroupLoop, loop_for};
use super::scalar::contract::ScalarCodec;
use super::scalar::loops::{Codes, Part};
use crate::channel::{Channel, Rules};
use crate::error::{Error, Field};
use crate::memory::Needs;
use crate::predict::fixed::Constant;
use crate::quantise::quantiser::{MAX_BITS, Step};
use crate::quantise::uniform::{Grid, MAX_EXPONENT, Uniform};
use crate::state::State;

/// The codec. It has no parameters: what a channel's limits are is in its record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pcm;

impl Codec<'_> for Pcm {
    fn parse(parameters: &[u8], at: usize) -> Result<Self, Error> {
        if parameters.is_empty() {
            return Ok(Self);
        }
        Err(Error::Encoding { field: Field::Parameters, at })
    }

    fn emit(&self, _: &mut impl Extend<u8>) {}

    fn rules(&self) -> Rules {
        Rules { bits: MAX_BITS, step: MAX_EXPONENT, grid: true }
    }

    fn needs(&self, _: usize) -> Needs {
        Needs::default()
    }
}

impl ScalarCodec<'_> for Pcm {
    /// Δ, and the middle of the range, which is what is predicted.
    fn initial(&self, channel: &Channel<'_>) -> (Step, i32) {
        let grid = Grid { low: channel.low, mantissa: channel.coefficient, exponent: channel.step };
        (Step::of(grid.step()), grid.middle(channel.bits))
    }

    fn group_loop(&self, states: &[State]) -> Option<GroupLoop> {
        Some(loop_for::<Constant, Uniform>(states))
    }

    #[inline(always)]
    fn advance<C: Codes>(&self, part: Part<'_>, codes: &mut C) {
        codes.uniform(part.pose, part.states, &Constant);
    }
}

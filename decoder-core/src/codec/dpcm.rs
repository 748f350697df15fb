//! dpcm: differences to a prediction by the last value, of first or of second order (7-12), in uniform steps.

use super::contract::Codec;
use super::scalar::byte_groups::{GroupLoop, loop_for};
use super::scalar::contract::ScalarCodec;
use super::scalar::initial::{first_order, step_size};
use super::scalar::loops::{Codes, Part, fused};
use crate::channel::{Channel, Rules};
use crate::entropy::symbols::SymbolSource;
use crate::error::{Error, Field, check};
use crate::memory::Needs;
use crate::predict::fixed::{First, FirstByHalves, Second};
use crate::quantise::quantiser::{MAX_BITS, Step};
use crate::quantise::step::MAX_STEP;
use crate::quantise::uniform::Uniform;
use crate::state::State;
use fixed::types::I16F16;

/// The codec.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dpcm {
    /// Order of the predictor: 0 for the last value, 1 or 2.
    pub order: u8,
}

impl Codec<'_> for Dpcm {
    fn parse(parameters: &[u8], at: usize) -> Result<Self, Error> {
        let &[order] = parameters else { return Err(Error::Encoding { field: Field::Parameters, at }) };
        check(Field::Parameters, at, order.into(), 0, 2)?;
        Ok(Self { order })
    }

    fn emit(&self, out: &mut impl Extend<u8>) {
        out.extend([self.order]);
    }

    fn rules(&self) -> Rules {
        Rules { bits: MAX_BITS, step: MAX_STEP, grid: false }
    }

    fn needs(&self, _: usize) -> Needs {
        Needs::default()
    }
}

impl ScalarCodec<'_> for Dpcm {
    fn initial(&self, channel: &Channel<'_>) -> (Step, i32) {
        if self.order == 1 { first_order(channel) } else { (step_size(channel), 0) }
    }

    fn keeps_values(&self) -> bool {
        self.order >= 2
    }

    fn group_loop(&self, states: &[State]) -> Option<GroupLoop> {
        Some(match self.order {
            0 | 1 => loop_for::<FirstByHalves, Uniform>(states),
            _ => loop_for::<Second, Uniform>(states),
        })
    }

    #[inline(always)]
    fn advance<C: Codes>(&self, part: Part<'_>, codes: &mut C) {
        match self.order {
            0 | 1 => codes.uniform(part.pose, part.states, &First),
            _ => codes.uniform(part.pose, part.states, &Second),
        }
    }

    #[inline(always)]
    fn advance_symbols<S: SymbolSource>(
        &self,
        pose: &mut [I16F16],
        states: &mut [State],
        source: &mut S,
        codes: &[u8],
        position: usize,
    ) -> Option<usize> {
        Some(match self.order {
            0 | 1 => fused(pose, states, &First, source, codes, position),
            _ => fused(pose, states, &Second, source, codes, position),
        })
    }
}

//! mulaw: differences to a prediction of first order, in steps that widen with the magnitude (7-5).

use super::contract::Codec;
use super::scalar::contract::ScalarCodec;
use super::scalar::initial::first_order;
use super::scalar::loops::{Codes, Part, serial};
use crate::channel::{Channel, Rules};
use crate::error::{Error, Field};
use crate::memory::Needs;
use crate::predict::fixed::First;
use crate::quantise::mu_law;
use crate::quantise::quantiser::Step;
use crate::quantise::step::MAX_STEP;

/// The codec, with the levels of its quantiser.
#[derive(Clone, Copy, Debug)]
pub struct MuLaw<'a> {
    /// The quantiser of all channels.
    pub quantiser: mu_law::MuLaw<'a>,
}

impl<'a> Codec<'a> for MuLaw<'a> {
    fn parse(parameters: &'a [u8], at: usize) -> Result<Self, Error> {
        let none = Error::Encoding { field: Field::Parameters, at };
        Ok(Self { quantiser: mu_law::MuLaw::new(parameters).ok_or(none)? })
    }

    fn emit(&self, out: &mut impl Extend<u8>) {
        out.extend(self.quantiser.bytes().iter().copied());
    }

    fn rules(&self) -> Rules {
        Rules { bits: self.quantiser.bits(), step: MAX_STEP, grid: false }
    }

    fn needs(&self, _: usize) -> Needs {
        Needs::default()
    }
}

impl<'a> ScalarCodec<'a> for MuLaw<'a> {
    fn initial(&self, channel: &Channel<'_>) -> (Step, i32) {
        first_order(channel)
    }

    #[inline(always)]
    fn advance<C: Codes>(&self, part: Part<'_>, codes: &mut C) {
        serial(part.pose, part.states, &First, &self.quantiser, codes);
    }
}

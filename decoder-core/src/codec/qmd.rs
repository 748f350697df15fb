//! qmd: differences to the last value from one look-up table, in units of each channel's step.
//!
//! Source: the tables of QMD (VRST 2005), in a .mclip. Files of QMD itself are read by [`crate::qmd`].

use super::contract::Codec;
use super::scalar::contract::ScalarCodec;
use super::scalar::initial::step_size;
use super::scalar::loops::{Codes, Part, serial};
use crate::channel::{Channel, Rules};
use crate::error::{Error, Field};
use crate::memory::Needs;
use crate::predict::fixed::First;
use crate::quantise::lookup::Lookup;
use crate::quantise::quantiser::{MAX_BITS, Step};
use crate::quantise::step::MAX_STEP;

/// The codec, with its look-up table.
#[derive(Clone, Copy, Debug)]
pub struct Qmd<'a> {
    /// The quantiser of all channels.
    pub quantiser: Lookup<'a>,
}

impl<'a> Codec<'a> for Qmd<'a> {
    fn parse(parameters: &'a [u8], at: usize) -> Result<Self, Error> {
        let none = Error::Encoding { field: Field::Parameters, at };
        Ok(Self { quantiser: Lookup::new(parameters).ok_or(none)? })
    }

    fn emit(&self, out: &mut impl Extend<u8>) {
        out.extend(self.quantiser.bytes().iter().copied());
    }

    fn rules(&self) -> Rules {
        Rules { bits: MAX_BITS, step: MAX_STEP, grid: false }
    }

    fn needs(&self, _: usize) -> Needs {
        Needs::default()
    }
}

impl<'a> ScalarCodec<'a> for Qmd<'a> {
    fn initial(&self, channel: &Channel<'_>) -> (Step, i32) {
        (step_size(channel), 0)
    }

    #[inline(always)]
    fn advance<C: Codes>(&self, part: Part<'_>, codes: &mut C) {
        serial(part.pose, part.states, &First, &self.quantiser, codes);
    }
}

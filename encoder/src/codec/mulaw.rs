//! mulaw: differences to a prediction of first order, in steps that widen with the difference by the mu-law (7-5).

use super::encode::Encode;
use super::scalar::allocate::{self, leaks};
use super::scalar::contract::{Allocation, ScalarEncode};
use super::scalar::encode::encode;
use crate::error::EncodeError;
use crate::quality::Quality;
use crate::task::Task;
use decoder_core::mclip::CodecId;

/// Most bits of a code: the table of levels is in the header.
const MOST_BITS: u8 = 9;

/// The settings of mulaw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MuLaw {
    /// μ: how much wider the widest step is than the narrowest.
    pub mu: f64,
}

impl Default for MuLaw {
    fn default() -> Self {
        Self { mu: 255.0 }
    }
}

impl MuLaw {
    /// Decision levels of the mu-law (7-5, by the inverse law) for codes of `bits` bits, as a header has them.
    fn levels(self, bits: u8) -> Vec<u8> {
        let Self { mu } = self;
        let count = 1usize << (bits - 1);
        let level = |i: usize| ((1.0 + mu).powf(i as f64 / count as f64) - 1.0) / mu * 65536.0;
        (0..count).flat_map(|i| (level(i).round() as u16).to_le_bytes()).collect()
    }
}

impl Encode for MuLaw {
    fn id(&self) -> CodecId {
        CodecId::MuLaw
    }

    fn most_bits(&self) -> u8 {
        MOST_BITS
    }

    /// The levels are spread over all differences.
    fn has_free_steps(&self) -> bool {
        false
    }

    fn encode(&self, task: &Task<'_>, quality: Quality<'_>) -> Result<Vec<u8>, EncodeError> {
        encode(self, task, quality)
    }
}

impl ScalarEncode for MuLaw {
    fn allocate_bits(&self, task: &Task<'_>, bits: u8) -> Result<Allocation, EncodeError> {
        allocate::by_bits(self, task, self.levels(bits), bits, leaks)
    }

    fn allocate_steps(&self, _: &Task<'_>, _: &[f64]) -> Result<Allocation, EncodeError> {
        Err(EncodeError::NoFreeSteps { codec: self.id().name() })
    }
}

//! pcm: values in steps between the lowest and the highest value of a channel (7-4).

use super::encode::Encode;
use super::scalar::allocate::{is_worth_codes, rest};
use super::scalar::contract::{Allocation, ScalarEncode};
use super::scalar::encode::encode;
use crate::column::{Choice, Column};
use crate::error::EncodeError;
use crate::quality::Quality;
use crate::task::Task;
use decoder_core::mclip::{Channel, CodecId};
use decoder_core::quantise::MAX_BITS;

/// The settings of pcm: there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pcm;

impl Encode for Pcm {
    fn id(&self) -> CodecId {
        CodecId::Pcm
    }

    fn encode(&self, task: &Task<'_>, quality: Quality<'_>) -> Result<Vec<u8>, EncodeError> {
        encode(self, task, quality)
    }
}

impl ScalarEncode for Pcm {
    fn has_grids(&self) -> bool {
        true
    }

    fn record(&self, column: &Column, choice: Choice) -> Channel<'static> {
        column.record_on_grid(choice.bits)
    }

    fn allocate_bits(&self, task: &Task<'_>, bits: u8) -> Result<Allocation, EncodeError> {
        let choose = |column: &Column| Choice {
            bits: if column.low == column.high { 0 } else { bits },
            ..Choice::REST
        };
        let choices = task.motion.columns.iter().map(choose).collect();
        Ok(Allocation { parameters: Vec::new(), choices, dead_zone: 0 })
    }

    fn allocate_steps(&self, task: &Task<'_>, steps: &[f64]) -> Result<Allocation, EncodeError> {
        let choose = |(column, &step): (&Column, &f64)| {
            if !is_worth_codes(column, step) {
                return rest(step);
            }
            let range = 2.0 * column.half_range();
            let bits = (range / step).log2().ceil().clamp(1.0, f64::from(MAX_BITS)) as u8;
            Choice { bits, ..Choice::REST }
        };
        let choices = task.motion.columns.iter().zip(steps).map(choose).collect();
        Ok(Allocation { parameters: Vec::new(), choices, dead_zone: 0 })
    }
}

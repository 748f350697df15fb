//! dpcm: differences to a prediction from the channel's last values, in steps of one size (7-4, 7-14).

use super::encode::Encode;
use super::scalar::allocate::{self, Coefficients, leaks, momenta, no_coefficient};
use super::scalar::contract::{Allocation, ScalarEncode};
use super::scalar::encode::encode;
use crate::error::EncodeError;
use crate::quality::Quality;
use crate::task::Task;
use decoder_core::mclip::CodecId;

/// What a value is predicted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The last value as it is.
    Zero,
    /// The last value, of which a part leaks away (7-14).
    First,
    /// The last value and a part of the last movement.
    Second,
}

/// The settings of dpcm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dpcm {
    /// The predictor; its coefficient is chosen for each channel.
    pub order: Order,
    /// How much smaller than half a step a difference counts where steps are chosen, in 64ths of a step, 0 to 32:
    /// rounding towards zero.
    pub dead_zone: i32,
}

impl Default for Dpcm {
    fn default() -> Self {
        Self { order: Order::Second, dead_zone: 12 }
    }
}

impl Dpcm {
    /// The order, as a header has it.
    fn parameters(self) -> Vec<u8> {
        vec![match self.order {
            Order::Zero => 0,
            Order::First => 1,
            Order::Second => 2,
        }]
    }

    fn coefficients(self) -> Coefficients {
        match self.order {
            Order::Zero => no_coefficient,
            Order::First => leaks,
            Order::Second => momenta,
        }
    }
}

impl Encode for Dpcm {
    fn id(&self) -> CodecId {
        CodecId::Dpcm
    }

    fn encode(&self, task: &Task<'_>, quality: Quality<'_>) -> Result<Vec<u8>, EncodeError> {
        encode(self, task, quality)
    }

    fn describe(&self) -> String {
        let order = match self.order {
            Order::Zero => "last value",
            Order::First => "first order",
            Order::Second => "second order",
        };
        order.to_owned()
    }

    fn curves() -> Vec<(&'static str, Self)> {
        let second = Self::default();
        vec![("order 1", Self { order: Order::First, ..second }), ("order 2", second)]
    }

    fn cheaper(self) -> Vec<Self> {
        [Order::Zero, Order::First, Order::Second].map(|order| Self { order, ..self }).to_vec()
    }
}

impl ScalarEncode for Dpcm {
    fn allocate_bits(&self, task: &Task<'_>, bits: u8) -> Result<Allocation, EncodeError> {
        allocate::by_bits(self, task, self.parameters(), bits, self.coefficients())
    }

    fn allocate_steps(&self, task: &Task<'_>, steps: &[f64]) -> Result<Allocation, EncodeError> {
        allocate::by_steps(self, task, self.parameters(), steps, self.dead_zone, self.coefficients())
    }
}

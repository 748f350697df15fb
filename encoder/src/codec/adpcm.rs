//! adpcm: as dpcm, with a predictor (7-15 to 7-18), a step (7-7) or both that adapt to the motion.

mod multipliers;

use super::encode::{CodecOption, Encode, OptionError};
use super::scalar::allocate::{self, Coefficients, momenta, no_coefficient};
use super::scalar::contract::{Allocation, ScalarEncode};
use super::scalar::encode::encode;
use crate::error::EncodeError;
use crate::quality::Quality;
use crate::task::Task;
use decoder_core::codec::Codec;
use decoder_core::codec::adpcm::{Adaptation, Adpcm as Parameters, Prediction, Steps};
use decoder_core::mclip::CodecId;
use decoder_core::predict::adaptive::MAX_WINDOW;
use decoder_core::predict::window::{LONGEST, SHORTEST};
use decoder_core::quantise::Adaptive;
use decoder_core::quantise::adaptive::CLASSES;
use decoder_core::quantise::step::MAX_STEP;
use multipliers::{FEWEST_BITS, TRAINED};

/// Magnitudes of a code of four bits.
pub const MAGNITUDES: usize = 8;

/// The settings of adpcm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adpcm {
    /// How the predictor adapts; without, it is of second order, its coefficient chosen for each channel.
    pub predictor: Option<Adaptation>,
    /// Whether steps adapt, and how.
    pub step: StepRule,
    /// As in [`Dpcm`](super::dpcm::Dpcm::dead_zone).
    pub dead_zone: i32,
}

/// How the step of a channel follows its codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepRule {
    /// It stays.
    Fixed,
    /// By the multipliers that were trained for the bits of a code.
    Trained,
    /// By these multipliers.
    By(StepAdaptation),
}

/// How the step of the adaptive quantiser (7-7) follows the codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct StepAdaptation {
    /// log₂ of the step multipliers in eighths, for the magnitudes 0 to 7 of a code of four bits; of longer codes the
    /// first four bits count, and shorter ones are as if zeros followed.
    pub multipliers: [i8; MAGNITUDES],
    /// Index of the lowest step. Where a channel rests its step falls, and all that is lower takes a frame more
    /// for each two or three multiplications to follow when it moves again.
    pub lowest: u8,
}

impl StepAdaptation {
    /// Those of a step that stays.
    pub const STILL: Self = Self { multipliers: [0; MAGNITUDES], lowest: 0 };

    /// Those that were trained for codes of so many bits, or for the nearest number that some were trained for.
    pub fn trained(bits: u8) -> Self {
        let index = usize::from(bits.saturating_sub(FEWEST_BITS));
        let (multipliers, lowest) = TRAINED[index.min(TRAINED.len() - 1)];
        Self { multipliers, lowest }
    }

    /// The quantiser of a clip. StepAdaptation are of a code's first four bits, of which −8 counts as 7.
    fn quantiser(self) -> Adaptive {
        let magnitude = |class: usize| if class < 8 { class } else { (16 - class).min(7) };
        let classes: [i8; CLASSES] = std::array::from_fn(|class| self.multipliers[magnitude(class)]);
        Adaptive::new(classes, self.lowest, MAX_STEP)
    }
}

impl Default for Adpcm {
    fn default() -> Self {
        Self { predictor: Some(Adaptation { window: 5, period: 4 }), step: StepRule::Fixed, dead_zone: 12 }
    }
}

impl Adpcm {
    /// Both adapt.
    pub const BOTH: Self =
        Self { predictor: Some(Adaptation { window: 5, period: 4 }), step: StepRule::Trained, dead_zone: 12 };

    /// The parameters as a header has them, with codes of so many bits or of any.
    pub(crate) fn parameters(self, bits: Option<u8>) -> Vec<u8> {
        let adaptation = match self.step {
            StepRule::Fixed => None,
            StepRule::Trained => bits.map(StepAdaptation::trained),
            StepRule::By(adaptation) => Some(adaptation),
        };
        let quantiser = adaptation.map(StepAdaptation::quantiser).filter(Adaptive::adapts);
        let steps = quantiser.map_or(Steps::Fixed, Steps::Adaptive);
        let prediction = self.predictor.map_or(Prediction::Fixed, Prediction::Adaptive);
        let mut bytes = Vec::new();
        Parameters { steps, prediction }.emit(&mut bytes);
        bytes
    }

    fn coefficients(self) -> Coefficients {
        if self.predictor.is_some() { no_coefficient } else { momenta }
    }
}

impl Encode for Adpcm {
    fn id(&self) -> CodecId {
        CodecId::Adpcm
    }

    /// Steps that adapt go where they want.
    fn has_free_steps(&self) -> bool {
        self.step == StepRule::Fixed
    }

    fn encode(&self, task: &Task<'_>, quality: Quality<'_>) -> Result<Vec<u8>, EncodeError> {
        encode(self, task, quality)
    }

    fn describe(&self) -> String {
        let predictor = if self.predictor.is_some() { "adaptive predictor" } else { "second order" };
        let step = if self.step == StepRule::Fixed { "" } else { ", adaptive step" };
        format!("{predictor}{step}")
    }

    fn options(&self) -> &'static [CodecOption] {
        &[ADAPT, WINDOW, ADAPT_EVERY]
    }

    fn set(&mut self, option: &str, value: &str) -> Result<(), OptionError> {
        let wrong = |option: CodecOption, expected: String| {
            Err(OptionError::Value { option: option.name, found: format!("{value:?}"), expected })
        };
        match option {
            "adapt" => {
                let predictor = self.predictor.or(Self::default().predictor);
                (self.predictor, self.step) = match value {
                    "predictor" => (predictor, StepRule::Fixed),
                    "step" => (None, StepRule::Trained),
                    "both" => (predictor, StepRule::Trained),
                    _ => return wrong(ADAPT, "predictor, step or both".to_owned()),
                };
            }
            "window" => match value.parse() {
                Ok(window @ (1..=MAX_WINDOW | SHORTEST..=LONGEST)) => {
                    self.predictor = self.predictor.map(|adaptation| Adaptation { window, ..adaptation });
                }
                _ => return wrong(WINDOW, format!("1 to {MAX_WINDOW}, or {SHORTEST} to {LONGEST}")),
            },
            "adapt-every" => match value.parse() {
                Ok(frames @ 1..=16384) if u16::is_power_of_two(frames) => {
                    let period = frames.ilog2() as u8;
                    self.predictor = self.predictor.map(|adaptation| Adaptation { period, ..adaptation });
                }
                _ => return wrong(ADAPT_EVERY, "1, 2, 4 … or 16384".to_owned()),
            },
            _ => return Err(OptionError::Unknown { codec: self.id().name(), option: option.to_owned() }),
        }
        Ok(())
    }

    fn check(&self) -> Result<(), OptionError> {
        let Some(Adaptation { window, period }) = self.predictor else { return Ok(()) };
        let every = 1u32 << period;
        if window >= SHORTEST && u32::from(window) > 8 * every {
            let expected = format!("at most 8 times --adapt-every, which is {every}");
            return Err(OptionError::Value { option: WINDOW.name, found: window.to_string(), expected });
        }
        Ok(())
    }

    fn curves() -> Vec<(&'static str, Self)> {
        let quantiser = Self { predictor: None, ..Self::BOTH };
        vec![("both", Self::BOTH), ("quantiser", quantiser), ("predictor", Self::default())]
    }
}

impl ScalarEncode for Adpcm {
    /// The coefficients of a channel are solved for when it is its turn.
    fn turns(&self) -> usize {
        self.predictor.map_or(1, |Adaptation { period, .. }| 1 << period.min(14))
    }

    fn allocate_bits(&self, task: &Task<'_>, bits: u8) -> Result<Allocation, EncodeError> {
        allocate::by_bits(self, task, self.parameters(Some(bits)), bits, self.coefficients())
    }

    fn allocate_steps(&self, task: &Task<'_>, steps: &[f64]) -> Result<Allocation, EncodeError> {
        let parameters = self.parameters(None);
        allocate::by_steps(self, task, parameters, steps, self.dead_zone, self.coefficients())
    }
}

const ADAPT: CodecOption = CodecOption {
    name: "adapt",
    value_name: "WHAT",
    default: "predictor",
    help: "What adapts",
    values: &[
        ("predictor", "The predictor"),
        ("step", "The quantiser's step; bits set the quality"),
        ("both", "Both"),
    ],
};

const WINDOW: CodecOption = CodecOption {
    name: "window",
    value_name: "FRAMES",
    default: "5",
    help: "Window of a predictor that adapts: the last 15 to 120 frames, or an exponential one of 2^1 to 2^6 (1 to 6)",
    values: &[],
};

const ADAPT_EVERY: CodecOption = CodecOption {
    name: "adapt-every",
    value_name: "FRAMES",
    default: "16",
    help: "Frames from one adaptation of a channel's predictor to the next, a power of two; a window of frames is at \
           most 8 times as long",
    values: &[],
};

#[cfg(test)]
mod tests {
    use super::*;

    fn set(options: &[(&str, &str)]) -> Result<Adpcm, OptionError> {
        let mut adpcm = Adpcm::default();
        options.iter().try_for_each(|(option, value)| adpcm.set(option, value))?;
        adpcm.check().map(|()| adpcm)
    }

    #[test]
    fn options_say_what_adapts() {
        assert_eq!(set(&[]).unwrap(), Adpcm::default());
        assert_eq!(set(&[("adapt", "both")]).unwrap(), Adpcm::BOTH);
        let step = set(&[("adapt", "step"), ("window", "60")]).unwrap();
        assert_eq!((step.predictor, step.step), (None, StepRule::Trained));
        let sliding = set(&[("window", "120"), ("adapt-every", "16")]).unwrap();
        assert_eq!(sliding.predictor, Some(Adaptation { window: 120, period: 4 }));
        for defaults in [ADAPT, WINDOW, ADAPT_EVERY] {
            assert_eq!(set(&[(defaults.name, defaults.default)]).unwrap(), Adpcm::default());
        }
    }

    #[test]
    fn wrong_values_are_named() {
        let said = |options: &[(&str, &str)]| set(options).unwrap_err().to_string();
        assert_eq!(said(&[("window", "7")]), "--window is \"7\", expected 1 to 6, or 15 to 120");
        assert_eq!(said(&[("adapt-every", "3")]), "--adapt-every is \"3\", expected 1, 2, 4 … or 16384");
        assert_eq!(said(&[("adapt", "all")]), "--adapt is \"all\", expected predictor, step or both");
        let long = [("window", "33"), ("adapt-every", "4")];
        assert_eq!(said(&long), "--window is 33, expected at most 8 times --adapt-every, which is 4");
        assert_eq!(said(&[("levels", "fitted")]), "codec adpcm has no --levels");
    }
}

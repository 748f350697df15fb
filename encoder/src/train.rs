//! Training of the step multipliers β of the adaptive quantiser (7-7).
//!
//! The document found its table "in a heuristic fashion". Here one is found for each number of bits by descending along
//! one multiplier after the other: what it should make small is the error that motions have after they were coded with codes of
//! so many bits, each motion counting by the logarithm of its error, so that a lively one counts no more than a calm one.

use crate::codec::adpcm::{Adpcm, MAGNITUDES, StepAdaptation, StepRule};
use crate::codec::scalar::allocate::entropy;
use crate::codec::scalar::contract::ScalarEncode;
use crate::codec::scalar::simulate;
use crate::column::{Choice, Column};
use crate::error::EncodeError;
use crate::mclip::encoder::{ENTRY_FRAMES, Encoder, Encoding};
use decoder_core::quantise::step::MAX_STEP;
use rayon::prelude::*;

/// Largest magnitude of a multiplier that is tried, in eighths of its logarithm.
const MOST: i8 = 32;

/// What a table of multipliers comes to on one motion.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Score {
    /// Displacement of the joints in cm: root of the sum over joints and mean over frames of its square, by how far each
    /// channel moves the joints.
    pub rms_cm: f64,
    /// Bits of a code by the frequencies of each channel's codes; fixed-width codes have all their bits.
    pub entropy_bits: f64,
}

/// A start for the lowest step: a thirtieth of a degree.
const LOWEST: u8 = 64;

/// The multipliers of N. S. Jayant, "Adaptive quantization with a one-word memory", Bell System Technical Journal 52 (1973),
/// for DPCM with codes of 2, 3 and 4 bits: β for each magnitude of a code.
///
/// His quantiser has no code for 0, so its magnitudes begin half a step higher than ours; codes of more than 4 bits have
/// the table of 4 by the same part of their range. The lowest step is ours to choose: a thirtieth of a degree.
pub fn jayant(bits: u8) -> StepAdaptation {
    let beta: &[f64] = match bits {
        0..=2 => &[0.80, 1.60],
        3 => &[0.90, 0.90, 1.25, 1.75],
        _ => &[0.90, 0.90, 0.90, 0.90, 1.20, 1.60, 2.00, 2.40],
    };
    let multiplier = |class| (8.0 * f64::log2(beta[class * beta.len() / MAGNITUDES])).round() as i8;
    StepAdaptation { multipliers: std::array::from_fn(multiplier), lowest: LOWEST }
}

/// What is changed to find something better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// The lowest step alone, with Jayant's multipliers.
    Lowest,
    /// The lowest step and the multipliers, beginning with Jayant's and with slower ones.
    All,
}

/// StepAdaptation to begin with that move less than Jayant's: coordinates alone do not lead from there to here.
const SLOW: StepAdaptation = StepAdaptation { multipliers: [-1, -1, 0, 0, 2, 4, 6, 8], lowest: LOWEST };

/// What steps that adapt like this come to on each motion with codes of `bits` bits, every channel having its best
/// first step. The predictor is that of `base`.
///
/// # Errors
/// [`EncodeError::Refused`] where no header can have these settings.
pub fn scores(
    encoders: &[Encoder<'_>],
    base: Adpcm,
    bits: u8,
    adaptation: StepAdaptation,
) -> Result<Vec<Score>, EncodeError> {
    let codec = Adpcm { step: StepRule::By(adaptation), ..base };
    let choices = choices(encoders, codec, bits)?;
    encoders.iter().zip(&choices).map(|(encoder, choices)| score(encoder, codec, choices)).collect()
}

/// The adaptation of steps that is best for these motions and codes of `bits` bits. The predictor is that of `base`.
///
/// Codes the motions some hundred times.
///
/// # Errors
/// [`EncodeError::Refused`] where no header can have these settings.
pub fn train(
    encoders: &[Encoder<'_>],
    base: Adpcm,
    bits: u8,
    search: Search,
) -> Result<StepAdaptation, EncodeError> {
    let with = |adaptation| Adpcm { step: StepRule::By(adaptation), ..base };
    // First steps that owe nothing to the multipliers: the best of many for one table is lucky with it, and what is
    // tried next would not be.
    let choices = choices(encoders, with(StepAdaptation::STILL), bits)?;
    let objective = |adaptation| -> Result<f64, EncodeError> {
        let mut sum = 0.0;
        for (encoder, choices) in encoders.iter().zip(&choices) {
            sum += score(encoder, with(adaptation), choices)?.rms_cm.ln();
        }
        Ok(sum)
    };
    let first = descend(objective, jayant(bits), bits, search)?;
    match search {
        Search::Lowest => Ok(first.1),
        Search::All => {
            let second = descend(objective, SLOW, bits, search)?;
            Ok(if second.0 < first.0 { second.1 } else { first.1 })
        }
    }
}

/// Moves one number after the other as long as that makes `objective` smaller; gives it too.
fn descend(
    objective: impl Fn(StepAdaptation) -> Result<f64, EncodeError>,
    start: StepAdaptation,
    bits: u8,
    search: Search,
) -> Result<(f64, StepAdaptation), EncodeError> {
    let mut best = (objective(start)?, start);
    let mut attempt = |changed: &dyn Fn(&mut StepAdaptation)| {
        let mut tried = best.1;
        changed(&mut tried);
        let found = objective(tried)?;
        if found < best.0 {
            best = (found, tried);
        }
        Ok::<_, EncodeError>(best)
    };
    let mut now = (f64::INFINITY, start);
    loop {
        let before = now.1;
        for by in [16, -16, 4, -4, 1, -1] {
            now = attempt(&|steps| steps.lowest = steps.lowest.saturating_add_signed(by).min(MAX_STEP))?;
        }
        for classes in classes(bits).iter().filter(|_| search == Search::All) {
            for by in [4, -4, 2, -2, 1, -1] {
                now = attempt(&|steps| {
                    for multiplier in &mut steps.multipliers[classes.clone()] {
                        *multiplier = (*multiplier + by).clamp(-MOST, MOST);
                    }
                })?;
            }
        }
        if now.1 == before {
            return Ok(now);
        }
    }
}

/// The classes that codes of so many bits have. Classes that no code has go with the one before.
fn classes(bits: u8) -> Vec<std::ops::Range<usize>> {
    let mut starts: Vec<usize> =
        (0..=1usize << (bits - 1)).map(|code| ((code * 16) >> bits).min(MAGNITUDES - 1)).collect();
    starts.dedup();
    let ends = starts.iter().skip(1).copied().chain([MAGNITUDES]).collect::<Vec<_>>();
    starts.into_iter().zip(ends).map(|(start, end)| start..end).collect()
}

fn choices(encoders: &[Encoder<'_>], codec: Adpcm, bits: u8) -> Result<Vec<Vec<Choice>>, EncodeError> {
    let each = encoders.iter().map(|encoder| codec.allocate_bits(&encoder.task(&Encoding::of(codec)), bits));
    each.map(|allocation| Ok(allocation?.choices)).collect()
}

fn score(encoder: &Encoder<'_>, codec: Adpcm, choices: &[Choice]) -> Result<Score, EncodeError> {
    let parameters = codec.parameters(None);
    let motion = encoder.motion();
    let channels = motion.columns.par_iter().zip(choices).zip(&motion.source.weights);
    let sums = channels.filter(|((_, choice), _)| choice.bits > 0).map(|((column, choice), weight)| {
        // Every channel as if it were the first: where coefficients are solved for in turns, its own place counts little.
        let column = Column { index: 0, ..column.clone() };
        let coded = simulate::column(&codec, ENTRY_FRAMES, &column, &parameters, *choice, 0)?;
        let squares = weight * column.squared_error(&coded.decoded) / 65536.0 / 65536.0;
        Ok((squares, entropy(&coded.codes), coded.codes.len()))
    });
    // In the order of channels, so that the sum is the same on every run.
    let sums: Vec<(f64, f64, usize)> = sums.collect::<Result<_, EncodeError>>()?;
    let squares: f64 = sums.iter().map(|sum| sum.0).sum();
    let bits: f64 = sums.iter().map(|sum| sum.1).sum();
    let codes: usize = sums.iter().map(|sum| sum.2).sum();
    Ok(Score {
        rms_cm: (squares / motion.source.frames() as f64).sqrt(),
        entropy_bits: if codes > 0 { bits / codes as f64 } else { 0.0 },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mocap::sample;

    #[test]
    fn jayants_tables_are_in_eighths_of_a_logarithm() {
        let of = |bits| jayant(bits).multipliers;
        assert_eq!(of(2), [-3, -3, -3, -3, 5, 5, 5, 5]);
        assert_eq!(of(3), [-1, -1, -1, -1, 3, 3, 6, 6]);
        assert_eq!(of(4), [-1, -1, -1, -1, 2, 5, 8, 10]);
        assert_eq!(of(7), of(4));
    }

    #[test]
    fn every_code_has_its_class() {
        assert_eq!(classes(1), [0..7, 7..8]);
        assert_eq!(classes(2), [0..4, 4..7, 7..8]);
        assert_eq!(classes(3), [0..2, 2..4, 4..6, 6..7, 7..8]);
        assert_eq!(classes(4).len(), 8);
        assert_eq!(classes(6).len(), 8);
    }

    #[test]
    fn training_lowers_the_error_and_is_the_same_again() {
        let clip = sample::clip();
        let encoders = [Encoder::new(&clip.skeleton, &clip.motion).unwrap()];
        for bits in [3, 4] {
            let [lowest, all] = [Search::Lowest, Search::All]
                .map(|search| train(&encoders, Adpcm::BOTH, bits, search).unwrap());
            let [start, low, best] = [jayant(bits), lowest, all]
                .map(|steps| scores(&encoders, Adpcm::BOTH, bits, steps).unwrap()[0].rms_cm);
            assert!(best < 0.98 * low && low <= start, "{bits} bits: {start} {low} {best}");
            assert_eq!(lowest.multipliers, jayant(bits).multipliers);
            assert_eq!(train(&encoders, Adpcm::BOTH, bits, Search::All), Ok(all));
        }
    }
}

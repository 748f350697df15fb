//! Training of the step multipliers β of the adaptive quantiser (7-7).
//!
//! The document found its table "in a heuristic fashion". Here one is found for each number of bits by descending along
//! one multiplier after the other: what it should make small is the error that motions have after they were coded with codes of
//! so many bits, each motion counting by the logarithm of its error, so that a lively one counts no more than a calm one.

use super::multipliers::{FEWEST_BITS, TRAINED};
use super::plan::{self, Choice};
use super::{Encoder, Settings};
use decoder_core::quantise::Adaptive;
use decoder_core::quantise::step::MAX_STEP;
use rayon::prelude::*;

/// Magnitudes of a code of four bits.
const MAGNITUDES: usize = 8;

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

/// How steps adapt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Steps {
    /// log₂ of the step multipliers in eighths, for the magnitudes 0 to 7 of a code of four bits; of longer codes the
    /// first four bits count, and shorter ones are as if zeros followed.
    pub multipliers: [i8; MAGNITUDES],
    /// Index of the lowest step. Where a channel rests its step falls, and all that is lower takes a frame more
    /// for each two or three multiplications to follow when it moves again.
    pub lowest: u8,
}

impl Steps {
    /// The quantiser of a clip.
    pub(super) fn quantiser(self) -> Adaptive {
        Adaptive::new(plan::classes(self.multipliers), self.lowest, MAX_STEP)
    }
}

/// A start for the lowest step: a thirtieth of a degree.
const LOWEST: u8 = 64;

/// The multipliers of N. S. Jayant, "Adaptive quantization with a one-word memory", Bell System Technical Journal 52 (1973),
/// for DPCM with codes of 2, 3 and 4 bits: β for each magnitude of a code.
///
/// His quantiser has no code for 0, so its magnitudes begin half a step higher than ours; codes of more than 4 bits have
/// the table of 4 by the same part of their range. The lowest step is ours to choose: a thirtieth of a degree.
pub fn jayant(bits: u8) -> Steps {
    let beta: &[f64] = match bits {
        0..=2 => &[0.80, 1.60],
        3 => &[0.90, 0.90, 1.25, 1.75],
        _ => &[0.90, 0.90, 0.90, 0.90, 1.20, 1.60, 2.00, 2.40],
    };
    let multiplier = |class| (8.0 * f64::log2(beta[class * beta.len() / MAGNITUDES])).round() as i8;
    Steps { multipliers: std::array::from_fn(multiplier), lowest: LOWEST }
}

/// The table that was trained for codes of so many bits, or the nearest number that one was trained for.
pub fn trained(bits: u8) -> Steps {
    let index = usize::from(bits.saturating_sub(FEWEST_BITS));
    let (multipliers, lowest) = TRAINED[index.min(TRAINED.len() - 1)];
    Steps { multipliers, lowest }
}

/// What steps that adapt like this come to on each motion with codes of `bits` bits, every channel having its best
/// first step. Other settings are taken as they are.
pub fn scores(encoders: &[Encoder<'_>], settings: &Settings, bits: u8, steps: Steps) -> Vec<Score> {
    let settings = Settings { steps: Some(steps), ..*settings };
    let choices = choices(encoders, &settings, bits);
    encoders.iter().zip(&choices).map(|(encoder, choices)| score(encoder, &settings, choices)).collect()
}

/// What is changed to find something better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// The lowest step alone, with Jayant's multipliers.
    Lowest,
    /// The lowest step and the multipliers, beginning with Jayant's and with slower ones.
    All,
}

/// Multipliers to begin with that move less than Jayant's: coordinates alone do not lead from there to here.
const SLOW: Steps = Steps { multipliers: [-1, -1, 0, 0, 2, 4, 6, 8], lowest: LOWEST };

/// The steps that are best for these motions and codes of `bits` bits. Other settings are taken as they are.
///
/// Codes the motions some hundred times.
pub fn train(encoders: &[Encoder<'_>], settings: &Settings, bits: u8, search: Search) -> Steps {
    let settings = |steps| Settings { steps: Some(steps), ..*settings };
    // First steps that owe nothing to the multipliers: the best of many for one table is lucky with it, and what is
    // tried next would not be.
    let still = Steps { multipliers: [0; MAGNITUDES], lowest: 0 };
    let choices = choices(encoders, &settings(still), bits);
    let objective = |steps| -> f64 {
        let parts = encoders.iter().zip(&choices);
        parts.map(|(encoder, choices)| score(encoder, &settings(steps), choices).rms_cm.ln()).sum()
    };
    let first = descend(objective, jayant(bits), bits, search);
    match search {
        Search::Lowest => first.1,
        Search::All => {
            let second = descend(objective, SLOW, bits, search);
            if second.0 < first.0 { second.1 } else { first.1 }
        }
    }
}

/// Moves one number after the other as long as that makes `objective` smaller; gives it too.
fn descend(objective: impl Fn(Steps) -> f64, start: Steps, bits: u8, search: Search) -> (f64, Steps) {
    let mut best = (objective(start), start);
    let mut attempt = |changed: &dyn Fn(&mut Steps)| {
        let mut tried = best.1;
        changed(&mut tried);
        let found = objective(tried);
        if found < best.0 {
            best = (found, tried);
        }
        best
    };
    let mut now = (f64::INFINITY, start);
    loop {
        let before = now.1;
        for by in [16, -16, 4, -4, 1, -1] {
            now = attempt(&|steps| steps.lowest = steps.lowest.saturating_add_signed(by).min(MAX_STEP));
        }
        for classes in classes(bits).iter().filter(|_| search == Search::All) {
            for by in [4, -4, 2, -2, 1, -1] {
                now = attempt(&|steps| {
                    for multiplier in &mut steps.multipliers[classes.clone()] {
                        *multiplier = (*multiplier + by).clamp(-MOST, MOST);
                    }
                });
            }
        }
        if now.1 == before {
            return now;
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

fn choices(encoders: &[Encoder<'_>], settings: &Settings, bits: u8) -> Vec<Vec<Choice>> {
    let settings = Settings { dead: 0, ..*settings };
    let parameters = plan::parameters(&settings, &[]);
    encoders.iter().map(|encoder| plan::by_bits(&encoder.columns, &settings, &parameters, bits)).collect()
}

fn score(encoder: &Encoder<'_>, settings: &Settings, choices: &[Choice]) -> Score {
    let settings = Settings { dead: 0, ..*settings };
    let parameters = plan::parameters(&settings, &[]);
    let channels = encoder.columns.par_iter().zip(choices).zip(&encoder.source.weights);
    let sums = channels.filter(|((_, choice), _)| choice.bits > 0).map(|((column, choice), weight)| {
        let coded = column.plan(&settings, &parameters, *choice).run(&column.targets);
        let squares = weight * column.squared_error(&coded) / 65536.0 / 65536.0;
        (squares, plan::entropy(&coded.codes), coded.codes.len())
    });
    // In the order of channels, so that the sum is the same on every run.
    let sums: Vec<(f64, f64, usize)> = sums.collect();
    let squares: f64 = sums.iter().map(|sum| sum.0).sum();
    let bits: f64 = sums.iter().map(|sum| sum.1).sum();
    let codes: usize = sums.iter().map(|sum| sum.2).sum();
    Score {
        rms_cm: (squares / encoder.source.frames() as f64).sqrt(),
        entropy_bits: if codes > 0 { bits / codes as f64 } else { 0.0 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoder_core::mclip::CodecId;
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
        let settings = Settings { adapt_step: true, ..Settings::new(CodecId::Adpcm) };
        for bits in [3, 4] {
            let [lowest, all] =
                [Search::Lowest, Search::All].map(|search| train(&encoders, &settings, bits, search));
            let [start, low, best] =
                [jayant(bits), lowest, all].map(|steps| scores(&encoders, &settings, bits, steps)[0].rms_cm);
            assert!(best < 0.98 * low && low <= start, "{bits} bits: {start} {low} {best}");
            assert_eq!(lowest.multipliers, jayant(bits).multipliers);
            assert_eq!(train(&encoders, &settings, bits, Search::All), all);
        }
    }
}

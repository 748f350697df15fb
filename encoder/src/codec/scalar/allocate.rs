//! What encoders of scalar codecs share: each channel gets the step and the predictor that suit it best.

use super::contract::{Allocation, ScalarEncode};
use super::simulate;
use crate::column::{Choice, Column, step_index};
use crate::error::EncodeError;
use crate::task::Task;
use decoder_core::predict::fixed::{LEAK_ONE, MOMENTUM_ONE};
use decoder_core::quantise::MAX_BITS;
use decoder_core::quantise::step::MAX_STEP;
use rayon::prelude::*;

/// Steps that are tried for codes of given bits: 14 octaves below the widest one.
const OCTAVES: u8 = 14;

/// Steps of an octave.
const STEPS: u8 = 8;

/// The coefficients that are tried for the predictor of a channel.
pub type Coefficients = fn(&Column) -> Vec<i16>;

/// A predictor without a coefficient.
pub fn no_coefficient(_: &Column) -> Vec<i16> {
    vec![0]
}

/// First order: none of the value leaks away, or as much as R(1)/R(0) says (7-14).
pub fn leaks(column: &Column) -> Vec<i16> {
    let x: Vec<f64> = column.targets.iter().map(|&word| f64::from(word)).collect();
    let r0: f64 = x.iter().map(|x| x * x).sum();
    let r1: f64 = x.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let leak = if r0 > 0.0 { (1.0 - r1 / r0) * f64::from(LEAK_ONE) } else { 0.0 };
    vec![0, leak.round().clamp(0.0, 32767.0) as i16]
}

/// Second order: the last value and a part of the last movement.
pub fn momenta(_: &Column) -> Vec<i16> {
    [0.0, 0.2, 0.4, 0.55, 0.7, 0.8, 0.9, 1.0]
        .iter()
        .map(|&part: &f64| (part * f64::from(MOMENTUM_ONE)).round() as i16)
        .collect()
}

/// Codes of `bits` bits: every channel has the step and the coefficient with the least error.
///
/// # Errors
/// [`EncodeError::Refused`] where no header can have the parameters.
pub fn by_bits(
    codec: &dyn ScalarEncode,
    task: &Task<'_>,
    parameters: Vec<u8>,
    bits: u8,
    coefficients: Coefficients,
) -> Result<Allocation, EncodeError> {
    let choose = |column: &Column| -> Result<Choice, EncodeError> {
        if column.low == column.high {
            return Ok(Choice::REST);
        }
        let highest = step_index(2.0 * column.half_range());
        let lowest = highest.saturating_sub(STEPS * OCTAVES);
        let mut best = (f64::INFINITY, Choice::REST);
        let coefficients = coefficients(column);
        let mut attempt = |step: u8| -> Result<u8, EncodeError> {
            for &coefficient in &coefficients {
                let choice = Choice { bits, step, coefficient };
                let coded = simulate::column(codec, task.entry_frames, column, &parameters, choice, 0)?;
                let error = column.squared_error(&coded.decoded);
                if error < best.0 {
                    best = (error, choice);
                }
            }
            Ok(best.1.step)
        };
        let mut middle = lowest;
        for step in (lowest..=highest).step_by(STEPS.into()) {
            middle = attempt(step)?;
        }
        for step in middle.saturating_sub(6)..=middle.saturating_add(6).min(MAX_STEP) {
            attempt(step)?;
        }
        Ok(best.1)
    };
    let choices = task.motion.columns.par_iter().map(choose).collect::<Result<_, _>>()?;
    Ok(Allocation { parameters, choices, dead_zone: 0 })
}

/// Steps of so many words, one for each channel: every channel has the coefficient with the fewest bits.
///
/// # Errors
/// [`EncodeError::Refused`] where no header can have the parameters.
pub fn by_steps(
    codec: &dyn ScalarEncode,
    task: &Task<'_>,
    parameters: Vec<u8>,
    steps: &[f64],
    dead_zone: i32,
    coefficients: Coefficients,
) -> Result<Allocation, EncodeError> {
    let choose = |(column, &step): (&Column, &f64)| -> Result<Choice, EncodeError> {
        // What does not move at all is exact, whatever the step.
        if column.low == column.high {
            return Ok(Choice::REST);
        }
        let mut best = (f64::INFINITY, rest(step));
        if !is_worth_codes(column, step) {
            return Ok(best.1);
        }
        for coefficient in coefficients(column) {
            let choice = Choice { bits: MAX_BITS, step: step_index(step), coefficient };
            let coded = simulate::column(codec, task.entry_frames, column, &parameters, choice, dead_zone)?;
            let bits = entropy(&coded.codes);
            if bits < best.0 {
                best = (bits, Choice { bits: bits_for(&coded.codes), ..choice });
            }
        }
        Ok(best.1)
    };
    let choices = task.motion.columns.par_iter().zip(steps).map(choose).collect::<Result<_, _>>()?;
    Ok(Allocation { parameters, choices, dead_zone })
}

/// Whether codes in such a step say more than none do: not where it is about as wide as the range.
pub fn is_worth_codes(column: &Column, step: f64) -> bool {
    column.half_range() > step / 2.0
}

/// A channel that keeps its value, to what a step says.
pub fn rest(step: f64) -> Choice {
    Choice { step: step_index(step), ..Choice::REST }
}

/// Bits of the codes by their own frequencies.
pub fn entropy(codes: &[i32]) -> f64 {
    let mut sorted = codes.to_vec();
    sorted.sort_unstable();
    let total = codes.len() as f64;
    sorted.chunk_by(|a, b| a == b).map(|run| run.len() as f64 * (total / run.len() as f64).log2()).sum()
}

/// Bits that hold all of the codes, at least 1.
fn bits_for(codes: &[i32]) -> u8 {
    let largest = codes.iter().map(|&code| code ^ (code >> 31)).max().unwrap_or(0);
    (33 - largest.leading_zeros()) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entropy_is_the_bits_of_the_best_code() {
        assert_eq!(entropy(&[]), 0.0);
        assert_eq!(entropy(&[7; 9]), 0.0);
        assert_eq!(entropy(&[0, 1, 2, 3]), 8.0);
        assert_eq!(entropy(&[0, 1, 0, 2]), 2.0 * 1.0 + 2.0 * 2.0);
    }

    #[test]
    fn bits_hold_both_signs() {
        for (codes, bits) in [(vec![], 1), (vec![0, -1], 1), (vec![1], 2), (vec![-2], 2), (vec![-32768], 16)]
        {
            assert_eq!(bits_for(&codes), bits, "{codes:?}");
        }
    }
}

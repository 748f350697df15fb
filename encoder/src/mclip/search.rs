//! Finds the quality that a person asks for.

use super::decode::decode;
use super::encoder::{Encoder, Encoding};
use crate::error::EncodeError;
use crate::quality::Quality;
use mocap::metrics::Evaluator;

/// What a clip should come to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Mean joint error in cm after forward kinematics, which is hit as well as possible.
    Error(f64),
    /// Bits per second, which are not exceeded where that is possible.
    Rate(f64),
}

/// A clip and what it came to.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// The clip.
    pub bytes: Vec<u8>,
    /// Its mean joint error in cm.
    pub mean_joint_cm: f64,
}

/// Halvings of the range of qualities: its last step is a thousandth.
const ROUNDS: usize = 14;

/// The range of qualities: cm that a step makes, finest and coarsest.
const RANGE: (f64, f64) = (1e-3, 300.0);

/// Most bits that are tried where bits set the quality: finer tables do not pay.
const MOST_BITS: u8 = 9;

impl Encoder<'_> {
    /// Encodes such that `target` is met as closely as the codec can.
    ///
    /// # Errors
    /// As [`encode`](Self::encode).
    pub fn encode_to(
        &self,
        encoding: &Encoding,
        target: Target,
        evaluator: &Evaluator,
    ) -> Result<Encoded, EncodeError> {
        let mut best: Option<(f64, Encoded)> = None;
        // Encodes, keeps the best, and says whether coarser steps are the way to go.
        let mut attempt = |quality| -> Result<bool, EncodeError> {
            let encoded = self.measured(encoding, quality, evaluator)?;
            let (off, coarser) = match target {
                Target::Error(cm) => ((encoded.mean_joint_cm / cm).ln().abs(), encoded.mean_joint_cm < cm),
                Target::Rate(rate) => {
                    let found = self.rate(&encoded.bytes);
                    // Anything within the rate is better than all above.
                    let over = if found > rate { 1e6 } else { 0.0 };
                    ((found / rate).ln().abs() + over, found > rate)
                }
            };
            if best.as_ref().is_none_or(|(least, _)| off < *least) {
                best = Some((off, encoded));
            }
            Ok(coarser)
        };
        if encoding.has_free_steps() {
            let (mut fine, mut coarse) = (RANGE.0.ln(), RANGE.1.ln());
            for _ in 0..ROUNDS {
                let middle = f64::midpoint(fine, coarse);
                if attempt(Quality::Step(middle.exp()))? {
                    fine = middle;
                } else {
                    coarse = middle;
                }
            }
        } else {
            for bits in 1..=encoding.most_bits().min(MOST_BITS) {
                attempt(Quality::Bits(bits))?;
            }
        }
        match best {
            Some((_, encoded)) => Ok(encoded),
            None => unreachable!("there is a first attempt"),
        }
    }

    /// Encodes and measures.
    ///
    /// # Errors
    /// As [`encode`](Self::encode).
    pub fn measured(
        &self,
        encoding: &Encoding,
        quality: Quality,
        evaluator: &Evaluator,
    ) -> Result<Encoded, EncodeError> {
        let bytes = self.encode(encoding, quality)?;
        let mean_joint_cm = evaluator.mean_joint_cm(&decode(&bytes)?.samples);
        Ok(Encoded { bytes, mean_joint_cm })
    }

    /// Bits per second of a clip of this motion.
    pub fn rate(&self, bytes: &[u8]) -> f64 {
        let source = &self.motion().source;
        let (numerator, denominator) = source.rate;
        let seconds = source.frames as f64 * f64::from(denominator) / f64::from(numerator);
        bytes.len() as f64 * 8.0 / seconds
    }
}

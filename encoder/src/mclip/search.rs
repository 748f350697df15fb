//! Finds the quality that a person asks for.
//!
//! Any codec, and any measure of errors: by the joints of a skeleton here, by whatever a caller measures in
//! [`Encoder::encode_each`]. Errors need not fall as steps do, so what counts is the clip that was measured: the smallest
//! of all that were tried that is within its bounds, and the nearest to them where none is.

use super::decode::decode;
use super::encoder::{Encoder, Encoding};
use crate::error::EncodeError;
use crate::quality::Quality;
use mocap::metrics::{Errors, Evaluator};

/// What a clip should come to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Mean joint error in cm over all joints and frames, which is hit as well as possible: to compare codecs at one error.
    Error(f64),
    /// The smallest clip within these bounds.
    Within(Bounds),
    /// Bits per second, which are not exceeded where that is possible.
    Rate(f64),
}

/// How large the errors of a skeleton's joints may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The larger average in cm: [`Errors::mean_cm`].
    pub mean_cm: f64,
    /// The greatest distance of any point in any frame in cm: [`Errors::max_point_cm`].
    pub worst_cm: f64,
}

impl Bounds {
    /// How many times what they may be the errors are: at most 1 where they are within.
    pub fn excess(&self, errors: &Errors) -> f64 {
        (errors.mean_cm() / self.mean_cm).max(errors.max_point_cm / self.worst_cm)
    }
}

/// A clip and what it came to.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// The clip.
    pub bytes: Vec<u8>,
    /// Its errors.
    pub errors: Errors,
}

/// Halvings of the range of qualities: its last step is a thousandth.
const ROUNDS: usize = 14;

/// The range of qualities: cm that a step makes, finest and coarsest.
const RANGE: (f64, f64) = (1e-3, 300.0);

/// How many times finer each step is than the one before, where the range is searched for the coarsest within bounds.
const STRIDE: f64 = 4.0;

/// The same where none of those steps is within bounds: an eighth of an octave, as steps have it.
const FINE_STRIDE: f64 = 1.090_507_732_665_257_7;

/// Halvings between two of those steps: the last is a 200th.
const STRIDE_ROUNDS: usize = 8;

/// Most bits that are tried where bits set the quality: finer tables do not pay.
const MOST_BITS: u8 = 9;

/// How many eighths of an octave apart the steps are that are tried for every channel, from 2 to the power of 5 coarser than
/// what was asked about, to 2 to the power of 9 finer.
const COARSER: std::ops::RangeInclusive<i32> = -9 * 8..=5 * 8;

/// Eighths of an octave from one of those steps to the next.
const SPACING: usize = 16;

/// A clip may be so many bytes larger than the smallest within bounds where its errors are smaller: what a short movement in a
/// long rest takes to be smooth instead of a jump.
const SPARE_BYTES: usize = 16;

/// The clips that were tried, each with how many times what they may be its errors are.
struct Tried<T>(Vec<(f64, usize, T)>);

impl<T> Tried<T> {
    /// Bytes of the smallest clip within bounds.
    fn smallest(&self) -> Option<usize> {
        self.0.iter().filter(|(excess, ..)| *excess <= 1.0).map(|&(_, bytes, _)| bytes).min()
    }

    /// The clip to take.
    fn best(self) -> T {
        let most = self.smallest().map(|bytes| bytes + SPARE_BYTES);
        let fits = |bytes: usize| most.is_none_or(|most| bytes <= most);
        let kept = self.0.into_iter().filter(|&(_, bytes, _)| fits(bytes));
        match kept.min_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1))) {
            Some((_, _, clip)) => clip,
            None => unreachable!("there is a first attempt"),
        }
    }
}

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
        let attempt = |quality: Quality<'_>| self.measured(encoding, quality, evaluator);
        match target {
            Target::Error(cm) => nearest(encoding, attempt, |encoded| {
                let found = encoded.errors.mean_joint_cm;
                ((found / cm).ln().abs(), found < cm)
            }),
            Target::Rate(rate) => nearest(encoding, attempt, |encoded| {
                let found = self.rate(&encoded.bytes);
                // Anything within the rate is better than all above.
                let over = if found > rate { 1e6 } else { 0.0 };
                ((found / rate).ln().abs() + over, found > rate)
            }),
            Target::Within(bounds) => {
                smallest_within(encoding, attempt, |encoded| bounds.excess(&encoded.errors))
            }
        }
    }

    /// Encodes such that every channel is within its bound, with a step of its own for each channel where that saves bytes.
    ///
    /// `excess` measures a clip: for each channel, how many times its bound the error is, at most 1 where the channel is
    /// within. `around` is a step in the channels' own unit near which the search begins, for instance the bound. A codec
    /// whose quality is a number of bits has one for all channels.
    ///
    /// The clip is the smallest of all that were tried whose channels are all within; where none is, the one whose
    /// channels are nearest to that. Encodes some 20 times.
    ///
    /// # Errors
    /// As [`encode`](Self::encode), and those of `excess`.
    pub fn encode_each<E: From<EncodeError>>(
        &self,
        encoding: &Encoding,
        around: f64,
        mut excess: impl FnMut(&[u8]) -> Result<Vec<f64>, E>,
    ) -> Result<Vec<u8>, E> {
        let mut tried = Tried(Vec::new());
        let mut attempt = |quality: Quality<'_>| -> Result<Vec<f64>, E> {
            let bytes = self.encode(encoding, quality)?;
            let found = excess(&bytes)?;
            let largest = found.iter().copied().fold(0.0, f64::max);
            // Summed, so that a channel that cannot come there does not hide the others.
            let beyond: f64 = found.iter().map(|excess| (excess - 1.0).max(0.0)).sum();
            tried.0.push((if beyond > 0.0 { 1.0 + beyond } else { largest }, bytes.len(), bytes));
            Ok(found)
        };
        if !encoding.has_free_steps() {
            for bits in 1..=encoding.most_bits().min(MOST_BITS) {
                attempt(Quality::Bits(bits))?;
            }
            return Ok(tried.best());
        }
        let size = |step: i32| around * (f64::from(step) / 8.0).exp2();
        let mut channels = vec![Coarsest::default(); self.motion().columns.len()];
        for step in COARSER.rev().step_by(SPACING) {
            let found = attempt(Quality::Even(size(step)))?;
            channels.iter_mut().zip(found).for_each(|(channel, excess)| channel.see(step, excess));
        }
        // Between the coarsest that is within and the next one, by halves; then whether one beyond is within all the same.
        for further in [8, 4, 2, 1, 1, 2, 3] {
            let steps: Vec<i32> = channels.iter().map(|channel| channel.step + further).collect();
            let found = attempt(Quality::Each(&steps.iter().map(|&step| size(step)).collect::<Vec<f64>>()))?;
            for ((channel, step), excess) in channels.iter_mut().zip(steps).zip(found) {
                channel.see(step, excess);
            }
        }
        let steps: Vec<f64> = channels.iter().map(|channel| size(channel.step)).collect();
        attempt(Quality::Each(&steps))?;
        Ok(tried.best())
    }

    /// Encodes and measures.
    ///
    /// # Errors
    /// As [`encode`](Self::encode).
    pub fn measured(
        &self,
        encoding: &Encoding,
        quality: Quality<'_>,
        evaluator: &Evaluator,
    ) -> Result<Encoded, EncodeError> {
        let bytes = self.encode(encoding, quality)?;
        let errors = evaluator.errors(&decode(&bytes)?.samples);
        Ok(Encoded { bytes, errors })
    }

    /// Bits per second of a clip of this motion.
    pub fn rate(&self, bytes: &[u8]) -> f64 {
        let source = &self.motion().source;
        let (numerator, denominator) = source.rate;
        let seconds = source.frames as f64 * f64::from(denominator) / f64::from(numerator);
        bytes.len() as f64 * 8.0 / seconds
    }
}

/// The coarsest step of a channel that is within its bound, in eighths of an octave; until one is, the one that comes nearest.
#[derive(Clone, Copy)]
struct Coarsest {
    step: i32,
    excess: f64,
}

impl Default for Coarsest {
    fn default() -> Self {
        Self { step: 0, excess: f64::INFINITY }
    }
}

impl Coarsest {
    fn see(&mut self, step: i32, excess: f64) {
        let better =
            if self.excess <= 1.0 { excess <= 1.0 && step > self.step } else { excess < self.excess };
        if better {
            *self = Self { step, excess };
        }
    }
}

/// The clip that is least `off`: what says how far off a clip is, and whether coarser steps are the way to go.
fn nearest(
    encoding: &Encoding,
    mut attempt: impl FnMut(Quality<'_>) -> Result<Encoded, EncodeError>,
    off: impl Fn(&Encoded) -> (f64, bool),
) -> Result<Encoded, EncodeError> {
    let mut best: Option<(f64, Encoded)> = None;
    let mut attempt = |quality: Quality<'_>| -> Result<bool, EncodeError> {
        let encoded = attempt(quality)?;
        let (off, coarser) = off(&encoded);
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

/// The smallest clip within bounds: `excess` says how many times over them a clip is.
///
/// From the coarsest step on, since steps may also be too fine: codes have 16 bits, and a jump may need more of them.
fn smallest_within(
    encoding: &Encoding,
    mut attempt: impl FnMut(Quality<'_>) -> Result<Encoded, EncodeError>,
    excess: impl Fn(&Encoded) -> f64,
) -> Result<Encoded, EncodeError> {
    let mut tried = Tried(Vec::new());
    // Says whether the clip is within, and how large it is.
    let mut attempt = |quality: Quality<'_>| -> Result<(bool, usize), EncodeError> {
        let encoded = attempt(quality)?;
        let (excess, bytes) = (excess(&encoded), encoded.bytes.len());
        tried.0.push((excess, bytes, encoded));
        Ok((excess <= 1.0, bytes))
    };
    if !encoding.has_free_steps() {
        for bits in 1..=encoding.most_bits().min(MOST_BITS) {
            attempt(Quality::Bits(bits))?;
        }
        return Ok(tried.best());
    }
    // Far apart first; where none of these is within, close together.
    let mut found = None;
    for stride in [STRIDE, FINE_STRIDE] {
        let mut step = RANGE.1;
        while found.is_none() && step > RANGE.0 {
            found = attempt(Quality::Step(step))?.0.then_some((step, step * stride));
            step /= stride;
        }
    }
    let Some((fine, coarse)) = found else { return Ok(tried.best()) };
    let (mut fine, mut coarse) = (fine.ln(), coarse.ln());
    for _ in 0..STRIDE_ROUNDS {
        let middle = f64::midpoint(fine, coarse);
        if attempt(Quality::Step(middle.exp()))?.0 {
            fine = middle;
        } else {
            coarse = middle;
        }
    }
    // Finer ones may be hardly larger.
    let mut step = fine.exp();
    let (_, coarsest) = attempt(Quality::Step(step))?;
    while step > RANGE.0 {
        step /= 2.0;
        if attempt(Quality::Step(step))?.1 > coarsest + SPARE_BYTES {
            break;
        }
    }
    Ok(tried.best())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::dpcm::Dpcm;
    use decoder_core::mclip::{CodecId, EntropyId};
    use mocap::skeleton::{Channel, Dof, Joint, Origin, Skeleton};
    use mocap::{Clip, Motion, sample};
    use std::ops::Range;

    /// A bone of 10 cm that nods by these degrees, a frame each, at 30 frames a second.
    fn nod(angles: impl Iterator<Item = f64>) -> Clip {
        let joint = |name: &str, parent: Option<usize>, height: f64, channels: Range<usize>| Joint {
            name: name.to_owned(),
            parent,
            offset: [0.0, height, 0.0],
            axis: mocap::angles::IDENTITY,
            tail: [0.0; 3],
            rotations: channels.clone().collect(),
            channels,
            level: 1,
        };
        let channel = Channel { name: "neck.rx".to_owned(), dof: Dof::Rx, joint: 0, limits: None };
        let skeleton = Skeleton {
            joints: vec![joint("neck", None, 0.0, 0..1), joint("head", Some(0), 10.0, 1..1)],
            channels: vec![channel],
            origin: Origin::Bvh { cm_per_unit: 1.0 },
        };
        Clip { skeleton, motion: Motion { fps: 30.0, channels: 1, samples: angles.collect() } }
    }

    fn within(clip: &Clip, mean_cm: f64) -> (Encoded, Vec<f64>) {
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).unwrap();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        let bounds = Target::Within(Bounds { mean_cm, worst_cm: 10.0 * mean_cm });
        let encoded = encoder.encode_to(&Encoding::new(CodecId::Dpcm), bounds, &evaluator).unwrap();
        let samples = decode(&encoded.bytes).unwrap().samples;
        (encoded, samples)
    }

    #[test]
    fn a_long_rest_does_not_hide_a_nod() {
        let angle = |frame: i32| {
            10.0 - 10.0 * (f64::from((frame - 540).clamp(0, 45)) / 45.0 * std::f64::consts::TAU).cos()
        };
        let clip = nod((0..600).map(angle));
        for mean_cm in [0.02, 0.1, 0.2, 0.5] {
            let (encoded, samples) = within(&clip, mean_cm);
            assert!(
                encoded.errors.mean_cm() <= mean_cm && encoded.errors.max_point_cm <= 10.0 * mean_cm,
                "{encoded:?}"
            );
            let highest = samples.iter().copied().fold(0.0, f64::max);
            assert!((15.0..25.0).contains(&highest), "{mean_cm} cm: nods to {highest} of 20 degrees");
            let jump = samples.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
            assert!(jump < 4.0, "{mean_cm} cm: {jump} degrees from one frame to the next, recorded 1.4");
        }
    }

    #[test]
    fn what_is_still_is_exact_at_every_target() {
        let mut clip = sample::clip();
        clip.motion.samples = clip.motion.frame(100).repeat(50);
        for mean_cm in [0.001, 0.1, 10.0] {
            let (encoded, _) = within(&clip, mean_cm);
            assert!(encoded.errors.max_point_cm < 1e-4, "{mean_cm} cm: {:?}", encoded.errors);
        }
    }

    #[test]
    fn bounds_hold_and_what_cannot_come_there_comes_as_near_as_it_can() {
        let clip = sample::clip();
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).unwrap();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        let encoding = Encoding { entropy: Some(EntropyId::Huffman), ..Encoding::new(CodecId::Dpcm) };
        let to = |encoding, mean_cm, worst_cm| {
            encoder.encode_to(encoding, Target::Within(Bounds { mean_cm, worst_cm }), &evaluator).unwrap()
        };
        let loose = to(&encoding, 0.1, 1e9);
        assert!((0.09..=0.1).contains(&loose.errors.mean_cm()), "{:?}", loose.errors);
        let worst_cm = loose.errors.max_point_cm / 2.0;
        let strict = to(&encoding, 0.1, worst_cm);
        assert!((0.9 * worst_cm..=worst_cm).contains(&strict.errors.max_point_cm), "{:?}", strict.errors);
        assert!(strict.bytes.len() > loose.bytes.len());
        // Codes of at most nine bits: the finest is the nearest.
        let qmd = Encoding { entropy: Some(EntropyId::Huffman), ..Encoding::new(CodecId::Qmd) };
        let nearest = to(&qmd, 1e-6, 1e9);
        let finest = encoder.measured(&qmd, Quality::Bits(MOST_BITS), &evaluator).unwrap();
        assert_eq!(nearest.bytes, finest.bytes);
    }

    #[test]
    fn every_channel_has_the_coarsest_step_within_its_own_bound() {
        let clip = sample::clip();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        let encoding = Encoding { entropy: Some(EntropyId::Huffman), ..Encoding::of(Dpcm::default()) };
        let channels = clip.motion.channels;
        // Every other channel may be off four times as far.
        let bound = |channel: usize| if channel.is_multiple_of(2) { 0.1 } else { 0.4 };
        let excess = |bytes: &[u8]| -> Result<Vec<f64>, EncodeError> {
            let decoded = decode(bytes)?;
            let square = |channel: usize| {
                let pairs = decoded.iter().zip(clip.motion.iter());
                pairs.map(|(one, other)| (one[channel] - other[channel]).powi(2)).sum::<f64>()
            };
            let frames = clip.motion.frames() as f64;
            Ok((0..channels).map(|channel| (square(channel) / frames).sqrt() / bound(channel)).collect())
        };
        let each = encoder.encode_each(&encoding, 0.1, excess).unwrap();
        assert!(excess(&each).unwrap().iter().all(|&excess| excess <= 1.0));
        // One step for all must be as fine as the strictest asks.
        let even = (0..200).map(|eighth| 10.0 * (-f64::from(eighth) / 8.0).exp2());
        let mut clips = even.map(|step| encoder.encode(&encoding, Quality::Even(step)).unwrap());
        let even = clips.find(|bytes| excess(bytes).unwrap().iter().all(|&excess| excess <= 1.0)).unwrap();
        assert!(each.len() * 20 < even.len() * 19, "{} and {}", each.len(), even.len());
        // A channel that is beyond whatever its step does not hide the others.
        let beyond = |bytes: &[u8]| {
            excess(bytes).map(|mut all| {
                all[3] = 5.0;
                all
            })
        };
        let others = encoder.encode_each(&encoding, 0.1, beyond).unwrap();
        let over = excess(&others)
            .unwrap()
            .iter()
            .enumerate()
            .filter(|&(index, &excess)| index != 3 && excess > 1.0)
            .count();
        assert_eq!(over, 0);
    }
}

//! The best FDF, b and n_d for a motion (paper, section 5.3).
//!
//! The figure of merit is bytes × DEF (equation 5); less is better. DEF stands for the mean over joints here, which
//! differs from the sum by a factor and so has its minimum at the same point.

use super::encode::decode;
use super::parameters::{Method, Parameters};
use crate::error::EncodeError;
use crate::source::Source;
use decoder_core::qmd::MIN_INDEX_BITS;
use mocap::metrics::Evaluator;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The parameters that are looked through.
#[derive(Clone, Debug)]
pub struct Space {
    /// Values of FDF, ascending.
    pub fixed_channels: Vec<u16>,
    /// Values of b, ascending.
    pub index_bits: Vec<u8>,
    /// Values of n_d, ascending.
    pub segment_frames: Vec<u32>,
    /// Largest clip that is of use, in bytes.
    pub max_bytes: usize,
    frames: usize,
    channels: usize,
}

impl Space {
    /// FDF from 0 to `max_fdf` (or all channels), b from 8 to `max_bits`, and for n_d every multiple of `step`
    /// up to `frames`; no clip larger than `max_bytes`.
    ///
    /// Without a bound the search is won by FDF = m: all floats, no error. [`float32_bytes`](Self::float32_bytes)
    /// is a natural one: what the motion takes uncompressed.
    pub fn new(
        frames: usize,
        channels: usize,
        max_fdf: u16,
        max_bits: u8,
        step: u32,
        max_bytes: usize,
    ) -> Self {
        let whole = frames as u32;
        let mut segment_frames: Vec<u32> = (step..whole).step_by(step.max(1) as usize).collect();
        segment_frames.push(whole);
        Self {
            fixed_channels: (0..=max_fdf.min(channels as u16)).collect(),
            index_bits: (MIN_INDEX_BITS..=max_bits).collect(),
            segment_frames,
            max_bytes,
            frames,
            channels,
        }
    }

    /// What a motion takes as 32-bit floats.
    pub const fn float32_bytes(frames: usize, channels: usize) -> usize {
        frames * channels * 4
    }

    fn parameters(&self, [fdf, b, n_d]: [usize; 3]) -> Parameters {
        Parameters {
            fixed_channels: self.fixed_channels[fdf],
            index_bits: self.index_bits[b],
            segment_frames: self.segment_frames[n_d],
        }
    }

    fn bytes(&self, cell: [usize; 3]) -> usize {
        self.parameters(cell).bytes(self.frames, self.channels)
    }

    fn sizes(&self) -> [usize; 3] {
        [self.fixed_channels.len(), self.index_bits.len(), self.segment_frames.len()]
    }

    /// All cells that are small enough.
    fn cells(&self) -> Vec<[usize; 3]> {
        let [fdfs, bs, n_ds] = self.sizes();
        let all =
            (0..fdfs).flat_map(|fdf| (0..bs).flat_map(move |b| (0..n_ds).map(move |n_d| [fdf, b, n_d])));
        all.filter(|&cell| self.bytes(cell) <= self.max_bytes).collect()
    }

    /// Clips that an exhaustive search encodes.
    pub fn len(&self) -> usize {
        self.cells().len()
    }

    /// Whether no parameters give a clip that is small enough.
    pub fn is_empty(&self) -> bool {
        self.cells().is_empty()
    }
}

/// One encoded clip, judged.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Candidate {
    /// What it was encoded with.
    pub parameters: Parameters,
    /// Its size.
    pub bytes: usize,
    /// Mean distance between joints, in cm.
    pub mean_joint_cm: f64,
    /// Equation 5: the product of the two.
    pub merit: f64,
}

/// What a search found.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Outcome {
    /// The candidate of the least merit; of equal ones that with the least parameters.
    pub best: Candidate,
    /// Clips that were encoded.
    pub encodes: usize,
}

/// A motion to find parameters for.
pub struct Problem<'a> {
    source: &'a Source,
    evaluator: &'a Evaluator,
    method: Method,
}

impl<'a> Problem<'a> {
    /// `evaluator` judges against the motion that `source` was made of.
    pub const fn new(source: &'a Source, evaluator: &'a Evaluator, method: Method) -> Self {
        Self { source, evaluator, method }
    }

    /// Encodes, decodes and judges.
    ///
    /// # Errors
    /// Where the parameters do not fit the format.
    pub fn candidate(&self, parameters: Parameters) -> Result<Candidate, EncodeError> {
        let bytes = self.source.encode(parameters, self.method)?;
        let decoded = match decode(&bytes) {
            Ok(decoded) => decoded,
            Err(error) => unreachable!("what was just encoded decodes: {error}"),
        };
        let mean_joint_cm = self.evaluator.mean_joint_cm(&decoded.samples);
        let merit = bytes.len() as f64 * mean_joint_cm;
        Ok(Candidate { parameters, bytes: bytes.len(), mean_joint_cm, merit })
    }

    /// Encodes with all parameters of `space`, in parallel. `progress` is told the number of clips done.
    /// `None` where the space is empty.
    ///
    /// # Errors
    /// Where parameters do not fit the format.
    pub fn exhaustive(&self, space: &Space, progress: &Progress) -> Result<Option<Outcome>, EncodeError> {
        let done = AtomicUsize::new(0);
        let candidates = self.candidates(space, &space.cells(), &done, progress)?;
        let encodes = candidates.len();
        Ok(candidates.into_iter().min_by(better).map(|best| Outcome { best, encodes }))
    }

    /// Finds the same optimum with far fewer encodes, by branch and bound over FDF for each b and n_d.
    ///
    /// With more fixed channels a clip grows, and its error shrinks but for chance. So of all FDF below one that
    /// was tried, none has a merit below the bytes of the least of them times the error of the one that was tried,
    /// divided by a slack for chance. Intervals whose bound is not below the best merit so far are
    /// left out; the most promising others are split at their middle.
    ///
    /// # Errors
    /// Where parameters do not fit the format.
    pub fn pruned(&self, space: &Space, progress: &Progress) -> Result<Option<Outcome>, EncodeError> {
        // The largest FDF that fits, for each b and n_d.
        let mut largest: HashMap<[usize; 2], usize> = HashMap::new();
        for [fdf, b, n_d] in space.cells() {
            let entry = largest.entry([b, n_d]).or_insert(fdf);
            *entry = fdf.max(*entry);
        }
        let mut batch: Vec<([usize; 3], Interval)> = largest
            .into_iter()
            .map(|([b, n_d], fdf)| {
                ([fdf, b, n_d], Interval { bound: 0.0, error: 0.0, fdfs: 0..fdf + 1, b, n_d })
            })
            .collect();
        batch.sort_unstable_by_key(|&(cell, _)| cell);
        let slack = slack(self.method);
        let done = AtomicUsize::new(0);
        let mut open = BTreeSet::new();
        let mut best: Option<Candidate> = None;
        while !batch.is_empty() {
            let cells: Vec<[usize; 3]> = batch.iter().map(|&(cell, _)| cell).collect();
            let candidates = self.candidates(space, &cells, &done, progress)?;
            for (([fdf, ..], interval), candidate) in batch.into_iter().zip(candidates) {
                if best.as_ref().is_none_or(|best| better(&candidate, best).is_lt()) {
                    best = Some(candidate);
                }
                let Range { start, end } = interval.fdfs;
                open.extend(interval.part(space, start..fdf, candidate.mean_joint_cm, slack));
                open.extend(interval.part(space, fdf + 1..end, interval.error, slack));
            }
            let merit = best.map_or(f64::INFINITY, |best| best.merit);
            batch = (0..BATCH)
                .map_while(|_| open.pop_first().filter(|interval: &Interval| interval.bound < merit))
                .map(|interval| ([interval.middle(), interval.b, interval.n_d], interval))
                .collect();
        }
        Ok(best.map(|best| Outcome { best, encodes: done.into_inner() }))
    }

    fn candidates(
        &self,
        space: &Space,
        cells: &[[usize; 3]],
        done: &AtomicUsize,
        progress: &Progress,
    ) -> Result<Vec<Candidate>, EncodeError> {
        cells
            .par_iter()
            .map(|&cell| {
                let candidate = self.candidate(space.parameters(cell))?;
                progress(done.fetch_add(1, Ordering::Relaxed) + 1);
                Ok(candidate)
            })
            .collect()
    }
}

/// What a search calls with the number of clips that it has encoded so far, from any thread.
pub type Progress<'a> = dyn Fn(usize) + Sync + 'a;

/// By how much an error may grow with FDF and still not mislead [`Problem::pruned`].
///
/// Of the paper's trials, the six that we have lose no optimum with these. In the faithful encoder errors add up
/// to a random walk, so chance has more to say than in the closed loop.
const fn slack(method: Method) -> f64 {
    match method {
        Method::Faithful { .. } => 6.0,
        Method::ClosedLoop => 2.0,
    }
}

/// Intervals that are split at a time. Fixed, so that the search is the same on any number of cores.
const BATCH: usize = 2;

/// A range of FDF, as indices, for one b and n_d. Ordered by `bound`.
#[derive(Clone, Debug)]
struct Interval {
    /// No clip of the range has a merit below this, but for more than chance.
    bound: f64,
    /// The error of the FDF at the range's end, the first that is not in it.
    error: f64,
    fdfs: Range<usize>,
    b: usize,
    n_d: usize,
}

impl Interval {
    /// A part of the range, with the error at its end; `None` where it is empty.
    fn part(&self, space: &Space, fdfs: Range<usize>, error: f64, slack: f64) -> Option<Self> {
        if fdfs.is_empty() {
            return None;
        }
        let bound = space.bytes([fdfs.start, self.b, self.n_d]) as f64 * error / slack;
        Some(Self { bound, error, fdfs, b: self.b, n_d: self.n_d })
    }

    const fn middle(&self) -> usize {
        usize::midpoint(self.fdfs.start, self.fdfs.end - 1)
    }
}

impl PartialEq for Interval {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Interval {}

impl PartialOrd for Interval {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Interval {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let rest = |interval: &Self| (interval.b, interval.n_d, interval.fdfs.start, interval.fdfs.end);
        self.bound.total_cmp(&other.bound).then_with(|| rest(self).cmp(&rest(other)))
    }
}

/// Less merit first, then the least parameters, so that the order of threads does not matter.
fn better(left: &Candidate, right: &Candidate) -> std::cmp::Ordering {
    left.merit.total_cmp(&right.merit).then(left.parameters.cmp(&right.parameters))
}

#[cfg(test)]
mod tests {
    use super::*;
    use mocap::sample;

    #[test]
    fn pruning_finds_the_optimum_of_the_exhaustive_search() {
        let clip = sample::clip();
        let source = Source::new(&clip.skeleton, &clip.motion).unwrap();
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).unwrap();
        let (frames, channels) = (source.frames(), source.channels());
        for method in [Method::FAITHFUL, Method::ClosedLoop] {
            let problem = Problem::new(&source, &evaluator, method);
            let whole = Space::float32_bytes(frames, channels);
            for max_bytes in [whole, whole / 2, whole * 2 / 5] {
                let space = Space::new(frames, channels, u16::MAX, 10, 120, max_bytes);
                let done = AtomicUsize::new(0);
                let count = |_| _ = done.fetch_add(1, Ordering::Relaxed);
                let all = problem.exhaustive(&space, &count).unwrap().unwrap();
                assert_eq!(all.encodes, space.len());
                assert_eq!(done.swap(0, Ordering::Relaxed), space.len());
                let pruned = problem.pruned(&space, &count).unwrap().unwrap();
                assert_eq!(pruned.best, all.best, "{method:?} {max_bytes}");
                assert_eq!(done.into_inner(), pruned.encodes);
                assert!(pruned.encodes <= all.encodes);
                assert!(pruned.best.bytes <= max_bytes);
            }
        }
    }

    #[test]
    fn a_space_without_clips_has_no_optimum() {
        let clip = sample::clip();
        let source = Source::new(&clip.skeleton, &clip.motion).unwrap();
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).unwrap();
        let problem = Problem::new(&source, &evaluator, Method::ClosedLoop);
        let space = Space::new(source.frames(), source.channels(), u16::MAX, 16, 30, 100);
        assert!(space.is_empty());
        assert_eq!(problem.exhaustive(&space, &|_| ()).unwrap(), None);
        assert_eq!(problem.pruned(&space, &|_| ()).unwrap(), None);
    }
}

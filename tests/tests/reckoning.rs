//! Dead reckoning and the way back on recorded motion, as a decoder gives it: what docs/STORE.md says of them.
#![allow(clippy::unwrap_used)]

use bunraku_tests::live::{Clip, clips};
use decoder_core::I16F16;
use firmware::stream::{AVERAGE_MILLIS, DECAY_MILLIS, EASE_MILLIS, Reckoner, Reckoning};
use mocap::kinematics::Kinematics;

/// Gaps in ms.
const GAPS: [usize; 4] = [33, 100, 200, 500];

/// Time in ms after a gap that is looked at.
const AFTER: usize = 500;

/// What a way to bridge gaps costs, over all clips.
#[derive(Clone, Copy, Debug, Default)]
struct Cost {
    /// Distance of joints from where they should be in cm, averaged over joints and the frames of a gap of each length.
    gap_cm: [f64; 4],
    /// The same over a gap of 200 ms and half a second after it.
    after_cm: f64,
    /// The largest step of a joint in a frame of these, in the largest of the clip itself; the worst clip.
    step: f64,
}

fn poses(memory: &mut [I16F16]) -> [&mut [I16F16]; 4] {
    let mut parts = memory.chunks_mut(memory.len() / 4);
    std::array::from_fn(|_| parts.next().unwrap())
}

/// Distances of joints in cm; the root is where it should be, as in a puppet that stands: largest and sum.
struct Body {
    kinematics: Kinematics,
    places: [Vec<[f64; 3]>; 2],
}

impl Body {
    fn new(clip: &Clip) -> Self {
        let kinematics = Kinematics::new(&clip.skeleton);
        let joints = vec![[0.0; 3]; kinematics.joints()];
        Self { kinematics, places: [joints.clone(), joints] }
    }

    fn distance(&mut self, one: &[I16F16], other: &[I16F16], root: &[I16F16]) -> (f64, f64) {
        for (pose, places) in [one, other].into_iter().zip(&mut self.places) {
            let values = root[..6].iter().chain(&pose[6..]).map(|value| value.to_num());
            self.kinematics.positions(&values.collect::<Vec<f64>>(), places);
        }
        let distances = self.places[0]
            .iter()
            .zip(&self.places[1])
            .map(|(a, b)| (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt());
        let (largest, sum) = distances.fold((0f64, 0.0), |(most, sum), cm| (most.max(cm), sum + cm));
        (largest, sum / self.places[0].len() as f64)
    }
}

/// Bridges gaps all over the clips; without a reckoning it holds the last frame, and jumps back.
fn cost(clips: &[(Clip, f64)], reckoning: impl Fn(u16) -> Option<Reckoning>) -> Cost {
    let mut cost = Cost::default();
    let (mut counts, mut afters) = ([0.0; 4], 0.0);
    for (clip, own) in clips {
        let mut body = Body::new(clip);
        let per_second = usize::from(clip.rate_centihertz) / 100;
        let frames_of = |millis: usize| millis * per_second / 1000;
        let reckoning = reckoning(clip.rate_centihertz);
        let of_gap = |gap: usize| frames_of(GAPS[gap]);
        let last = clip.frames.len().saturating_sub(of_gap(3).max(of_gap(2) + frames_of(AFTER)));
        for start in (per_second / 4..last).step_by(151) {
            let mut memory = vec![I16F16::ZERO; 4 * clip.frames[0].len()];
            let some = reckoning.unwrap_or(Reckoning::of(clip.rate_centihertz));
            let mut reckoner = Reckoner::new(poses(&mut memory), some);
            let before = &clip.frames[start - per_second / 8..start];
            before.iter().for_each(|frame| _ = reckoner.right(frame));
            let mut sum = 0.0;
            for frame in 0..of_gap(3) {
                if reckoning.is_some() {
                    reckoner.missing();
                }
                let right = &clip.frames[start + frame];
                sum += body.distance(reckoner.shown(), right, right).1;
                if let Some(gap) = (0..4).find(|&gap| of_gap(gap) == frame + 1) {
                    cost.gap_cm[gap] += sum / (frame + 1) as f64;
                    counts[gap] += 1.0;
                }
            }
            // Once more, a gap of 200 ms and the way back.
            let mut memory = vec![I16F16::ZERO; 4 * clip.frames[0].len()];
            let mut reckoner = Reckoner::new(poses(&mut memory), some);
            before.iter().for_each(|frame| _ = reckoner.right(frame));
            for frame in 0..of_gap(2) + frames_of(AFTER) {
                let (right, shown) = (&clip.frames[start + frame], reckoner.shown().to_vec());
                let gap = frame < of_gap(2);
                let now = match reckoning {
                    None if gap => before.last().unwrap().clone(),
                    None => right.clone(),
                    Some(_) => {
                        if gap {
                            reckoner.missing();
                        } else {
                            reckoner.right(right);
                        }
                        reckoner.shown().to_vec()
                    }
                };
                let shown = match (reckoning, frame) {
                    (Some(_), _) => shown,
                    (None, frame) if frame <= of_gap(2) => before.last().unwrap().clone(),
                    _ => clip.frames[start + frame - 1].clone(),
                };
                cost.after_cm += body.distance(&now, right, right).1;
                afters += 1.0;
                cost.step = cost.step.max(body.distance(&now, &shown, right).0 / own);
            }
        }
    }
    cost.gap_cm.iter_mut().zip(counts).for_each(|(sum, count)| *sum /= count);
    cost.after_cm /= afters;
    cost
}

#[test]
fn dead_reckoning_is_nearer_than_holding_and_its_times_are_the_best() {
    let Some(clips) = clips(usize::MAX, 2.0) else { return };
    let own = |clip: &Clip| {
        let mut body = Body::new(clip);
        let steps = clip.frames.windows(2).map(|pair| body.distance(&pair[0], &pair[1], &pair[0]).0);
        steps.fold(0.0, f64::max)
    };
    let clips: Vec<(Clip, f64)> =
        clips.into_iter().map(|clip| (own(&clip), clip)).map(|(own, clip)| (clip, own)).collect();
    let hold = cost(&clips, |_| None);
    let with = |decay, average, ease| cost(&clips, |rate| Some(Reckoning::new(rate, decay, average, ease)));
    let ours = with(DECAY_MILLIS, AVERAGE_MILLIS, EASE_MILLIS);
    println!("hold: {hold:.3?}\nours: {ours:.3?}");
    assert!(ours.gap_cm.iter().zip(hold.gap_cm).all(|(ours, hold)| *ours < hold));
    assert!(ours.gap_cm[1] < 0.65 * hold.gap_cm[1]);
    for (decay, average) in [(75, AVERAGE_MILLIS), (300, AVERAGE_MILLIS), (DECAY_MILLIS, 0)] {
        let other = with(decay, average, EASE_MILLIS);
        println!("decay {decay} ms, average {average} ms: {other:.3?}");
        assert!((1..3).all(|gap| ours.gap_cm[gap] < other.gap_cm[gap]));
    }
    // A faster way back is nearer to the motion, a slower one has smaller steps.
    let slow = with(DECAY_MILLIS, AVERAGE_MILLIS, 300);
    println!("fade of 300 ms: {slow:.3?}");
    assert!(ours.step < 2.5 && ours.step < hold.step / 4.0);
    assert!(slow.after_cm > ours.after_cm && slow.step < ours.step);
}

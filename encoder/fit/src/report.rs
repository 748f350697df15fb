//! What a puppet cannot do of a recording, joint by joint, and where its bones point instead.

use crate::smooth::differences;
use serde::Serialize;

/// What became of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// For each joint of the puppet.
    pub joints: Vec<JointReport>,
    /// For each bone that chains or turns drive.
    pub bones: Vec<BoneReport>,
    /// For each upper arm and thigh whose elbow or knee bends.
    pub twists: Vec<TwistReport>,
}

/// How a limb's upper bone was turned about itself in the T-pose, so that its hinge bends as elbows and knees do.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TwistReport {
    /// The skeleton's joint that turns the bone.
    pub bone: String,
    /// The part of the body that it is.
    pub part: String,
    /// In degrees, about where the bone points.
    pub degrees: f64,
    /// Whether it was known before; else it was found from the recording.
    pub is_known: bool,
}

/// What a recording asks of a joint that the joint cannot do. Values are in degrees or cm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointReport {
    /// Name of the joint.
    pub name: String,
    /// `°` or `cm`.
    pub unit: &'static str,
    /// Lowest and highest value recorded, by whole turns near to the joint's range; `None` for a joint of a chain, of
    /// which nothing is recorded.
    pub recorded: Option<[f64; 2]>,
    /// Lowest and highest value in the fitted clip.
    pub fitted: [f64; 2],
    /// Recorded beyond the range. Of a joint of a chain: at an end of the range while the bone points elsewhere.
    pub out_of_range: Option<Excess>,
    /// Above its speed, in the fitted clip; how far is the highest speed.
    pub too_fast: Option<Excess>,
    /// Above its acceleration, in the fitted clip; how far is the highest acceleration.
    pub too_sudden: Option<Excess>,
    /// Root mean square of what smoothing changed, where there was smoothing.
    pub smoothed: Option<f64>,
}

/// How often, how long and how far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Excess {
    /// How often: spells of frames in a row.
    pub times: usize,
    /// How long, in seconds in all.
    pub seconds: f64,
    /// How far at most.
    pub most: f64,
    /// When that is, in seconds of the clip.
    pub at: f64,
}

impl Excess {
    /// Of frames with how far each is beyond a limit, 0 or less where it is not.
    pub fn of(beyond: impl Iterator<Item = f64>, fps: f64) -> Option<Self> {
        let (mut found, mut in_spell) = (Self { times: 0, seconds: 0.0, most: 0.0, at: 0.0 }, false);
        for (frame, beyond) in beyond.enumerate() {
            let is_beyond = beyond > 0.0;
            found.times += usize::from(is_beyond && !in_spell);
            in_spell = is_beyond;
            if is_beyond {
                found.seconds += 1.0 / fps;
            }
            if beyond > found.most {
                (found.most, found.at) = (beyond, frame as f64 / fps);
            }
        }
        (found.times > 0).then_some(found)
    }

    /// Of a way whose differences of this order are above `limit` a second (squared).
    pub fn of_differences(values: &[f64], order: usize, limit: f64, fps: f64) -> Option<Self> {
        let scale = fps.powi(order as i32);
        let found = differences(values, order).into_iter().map(|value| value.abs() * scale);
        let beyond = found.map(|value| if value > limit * (1.0 + 1e-6) { value } else { 0.0 });
        Self::of(beyond, fps)
    }
}

/// Where a bone points in the recording and in the fitted clip; of the trunk and the head, where they face.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BoneReport {
    /// The skeleton's joint that turns the bone.
    pub bone: String,
    /// That of the bone against which it is seen, or "world".
    pub against: String,
    /// The puppet's joints that drive it, in their order.
    pub joints: Vec<String>,
    /// Mean angle between the two directions, in degrees.
    pub mean: f64,
    /// The largest one.
    pub worst: f64,
    /// When that is, in seconds of the clip.
    pub at: f64,
    /// Of a bone that two joints drive: what there is near the axis of the first one.
    pub pole: Option<Pole>,
}

/// A bone along the axis of the first of its two joints. How it goes on from there may need a jump of that joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pole {
    /// Part of the frames in which the bone is within [`Pole::NEAR`] of the axis.
    pub frames: f64,
    /// The largest angle between where the bone points and where it should, in these frames.
    pub worst: f64,
}

impl Pole {
    /// So near to an axis is near, in degrees.
    pub const NEAR: f64 = 30.0;
}

impl BoneReport {
    /// Sets the angles from those of all frames.
    pub(crate) fn see(&mut self, angles: &[f64], fps: f64) {
        self.mean = angles.iter().sum::<f64>() / angles.len().max(1) as f64;
        let worst = angles.iter().enumerate().max_by(|(_, one), (_, other)| one.total_cmp(other));
        (self.worst, self.at) = worst.map_or((0.0, 0.0), |(frame, angle)| (*angle, frame as f64 / fps));
    }
}

/// Lowest and highest of some values.
pub(crate) fn ends(values: &[f64]) -> [f64; 2] {
    let fold = |least: [f64; 2], value: &f64| [least[0].min(*value), least[1].max(*value)];
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], fold)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_excess_is_counted_by_spells() {
        let beyond = [0.0, 1.0, 2.0, 0.0, -1.0, 0.5, 0.0];
        let found = Excess::of(beyond.into_iter(), 10.0).unwrap();
        assert_eq!((found.times, found.most, found.at), (2, 2.0, 0.2));
        assert!((found.seconds - 0.3).abs() < 1e-12);
        assert_eq!(Excess::of([0.0, -3.0].into_iter(), 10.0), None);
        let fast = Excess::of_differences(&[0.0, 1.0, 3.0, 3.0], 1, 15.0, 10.0).unwrap();
        assert_eq!((fast.times, fast.most, fast.at), (1, 20.0, 0.1));
    }
}

//! How a limb is twisted about itself in its T-pose, from the way its hinge bends.
//!
//! A skeleton says where its bones point at rest, and often not how they are twisted. But elbows bend forward and knees
//! backward. So the upper bone of each limb, with all that hangs on it, is turned about its length until the lower bone
//! bends to that side in the mean of the recording. A limb that hardly bends stays as it is.

use mocap::Clip;
use mocap::angles::{IDENTITY, Matrix, about, apply, multiply, transpose};
use mocap::body::{Body, Part, Side, TPose};

/// Least mean of the sine of the bend by which a hinge is found: 9 degrees.
const LEAST_BEND: f64 = 0.15;

/// A limb's twist.
#[derive(Clone, Debug, PartialEq)]
pub struct Hinge {
    /// The joint of the upper bone.
    pub upper: usize,
    /// Degrees about the bone, from the T-pose as it was.
    pub degrees: f64,
    /// The same as a rotation.
    pub rotation: Matrix,
    /// Which joints hang on it, itself among them.
    pub below: Vec<bool>,
}

/// The twists of a figure's limbs that its recording shows.
pub fn hinges(clip: &Clip, body: &Body, t_pose: &mut TPose) -> Vec<Hinge> {
    let limbs = Side::BOTH.into_iter().flat_map(|side| {
        [
            (Part::UpperArm(side), Part::Forearm(side), [0.0, 0.0, 1.0]),
            (Part::Thigh(side), Part::Shin(side), [0.0, 0.0, -1.0]),
        ]
    });
    let limbs: Vec<(usize, usize, [f64; 3])> =
        limbs.filter_map(|(upper, lower, to)| Some((body.joint(upper)?, body.joint(lower)?, to))).collect();
    let mut bends = vec![[0.0; 3]; limbs.len()];
    let mut rotations = vec![IDENTITY; clip.skeleton.joints.len()];
    for pose in clip.motion.iter() {
        t_pose.rotations(pose, &mut rotations);
        for ((upper, lower, _), bend) in limbs.iter().zip(&mut bends) {
            let turned = multiply(&transpose(&rotations[*upper]), &rotations[*lower]);
            let points = apply(&turned, t_pose.direction(*lower));
            (0..3).for_each(|k| bend[k] += points[k]);
        }
    }
    let frames = clip.motion.frames().max(1) as f64;
    limbs
        .iter()
        .zip(bends)
        .filter_map(|(&(upper, _, to), bend)| {
            let along = t_pose.direction(upper);
            let sideways = [
                to[1] * along[2] - to[2] * along[1],
                to[2] * along[0] - to[0] * along[2],
                to[0] * along[1] - to[1] * along[0],
            ];
            // A turn about the bone brings `to` towards along × to.
            let (forward, side) = (dot(bend, to), -dot(bend, sideways));
            if forward.hypot(side) / frames < LEAST_BEND {
                return None;
            }
            let degrees = side.atan2(forward).to_degrees();
            let joints = &clip.skeleton.joints;
            let mut below = vec![false; joints.len()];
            below[upper] = true;
            for (index, joint) in joints.iter().enumerate().skip(upper + 1) {
                below[index] = joint.parent.is_some_and(|parent| below[parent]);
            }
            Some(Hinge { upper, degrees, rotation: about(along, degrees), below })
        })
        .collect()
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

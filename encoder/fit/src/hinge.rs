//! How a limb is twisted about itself in its T-pose, from the way its hinge bends.
//!
//! A skeleton says where its bones point at rest, and often not how they are twisted. But elbows bend forward and knees
//! backward. So the upper bone of each limb, with all that hangs on it, is turned about its length until the lower bone
//! bends to that side in the mean of the recording. A limb that hardly bends stays as it is.
//!
//! Where a foot is in line with its shin at rest, all bones are along one axis, and how the leg is twisted is not told
//! at all. A leg that hardly bends, or whose knee bends elsewhere than behind its foot, is then turned until the foot
//! points forward in the mean. The T-pose has brought such a foot forward before the twist was known: it is brought
//! there anew.

use mocap::Clip;
use mocap::angles::{self, IDENTITY, Matrix, about, apply, multiply, transpose};
use mocap::body::{Body, Part, Side, TPose};

/// Least mean of the sine of the bend by which a hinge is found: 9 degrees.
const LEAST_BEND: f64 = 0.15;

/// Where feet point in the T-pose.
const FORWARD: [f64; 3] = [0.0, 0.0, 1.0];

/// A foot that the T-pose has turned by more than this against its shin, in degrees, was brought forward.
const BROUGHT: f64 = 1.0;

/// A foot is turned out from where its knee bends by less than this, in degrees. Else the knee bends sideways, and the
/// foot is right.
const TURNED_OUT: f64 = 60.0;

/// A limb's twist.
#[derive(Clone, Debug, PartialEq)]
pub struct Hinge {
    /// The joint of the upper bone.
    pub upper: usize,
    /// The part of the body that the upper bone is.
    pub part: Part,
    /// Degrees about the bone, from the T-pose as it was.
    pub degrees: f64,
    /// Whether they were known before.
    pub is_known: bool,
    /// For each joint that hangs on the upper bone, itself among them, what turns its frame in the T-pose.
    pub rotations: Vec<Option<Matrix>>,
}

/// The bones of a limb, and where the lower one bends to.
struct Limb {
    part: Part,
    upper: usize,
    lower: usize,
    to: [f64; 3],
    /// A foot that the T-pose has brought forward, and how it did.
    foot: Option<(usize, Matrix)>,
}

/// The twists of a figure's limbs that are known, or that its recording shows.
pub fn hinges(clip: &Clip, body: &Body, t_pose: &mut TPose, known: &[(usize, f64)]) -> Vec<Hinge> {
    let limbs: Vec<Limb> = limbs(body, t_pose);
    // Where the lower bone and the foot point, seen from the bone above.
    let mut bends = vec![[[0.0; 3]; 2]; limbs.len()];
    let mut rotations = vec![IDENTITY; clip.skeleton.joints.len()];
    for pose in clip.motion.iter() {
        t_pose.rotations(pose, &mut rotations);
        for (limb, bends) in limbs.iter().zip(&mut bends) {
            let foot = limb.foot.map(|(foot, _)| (limb.lower, foot));
            let pairs = std::iter::once((limb.upper, limb.lower)).chain(foot);
            for ((above, joint), bend) in pairs.zip(bends) {
                let turned = multiply(&transpose(&rotations[above]), &rotations[joint]);
                let points = apply(&turned, t_pose.direction(joint));
                (0..3).for_each(|k| bend[k] += points[k]);
            }
        }
    }
    let frames = clip.motion.frames().max(1) as f64;
    limbs
        .iter()
        .zip(bends)
        .filter_map(|(limb, [lower, foot])| {
            let along = t_pose.direction(limb.upper);
            let by_bend = degrees_about(along, limb.to, lower, frames);
            let by_foot = degrees_about(along, FORWARD, foot, frames);
            let known = known.iter().find(|(upper, _)| *upper == limb.upper).map(|(_, degrees)| *degrees);
            let degrees = match (known, by_bend, by_foot) {
                (Some(known), ..) => known,
                (None, Some(bend), Some(foot)) if angles::wrap(bend - foot).abs() > TURNED_OUT => foot,
                (None, bend, foot) => bend.or(foot)?,
            };
            Some(Hinge {
                upper: limb.upper,
                part: limb.part,
                degrees,
                is_known: known.is_some(),
                rotations: limb.rotations(clip, &about(along, degrees)),
            })
        })
        .collect()
}

/// The limbs of which both bones are known.
fn limbs(body: &Body, t_pose: &TPose) -> Vec<Limb> {
    let limb = |part, lower, to, foot: Option<Part>| {
        let (upper, lower) = (body.joint(part)?, body.joint(lower)?);
        let foot = foot.and_then(|foot| body.joint(foot)).map(|foot| (foot, t_pose.brought(foot, lower)));
        let foot = foot.filter(|(_, brought)| angles::turned(brought) > BROUGHT);
        Some(Limb { part, upper, lower, to, foot })
    };
    let of_side = |side| {
        [
            limb(Part::UpperArm(side), Part::Forearm(side), FORWARD, None),
            limb(Part::Thigh(side), Part::Shin(side), [0.0, 0.0, -1.0], Some(Part::Foot(side))),
        ]
    };
    Side::BOTH.into_iter().flat_map(of_side).flatten().collect()
}

impl Limb {
    /// What turns the frames of the limb's joints, where its upper bone is turned by `rotation`.
    fn rotations(&self, clip: &Clip, rotation: &Matrix) -> Vec<Option<Matrix>> {
        let joints = &clip.skeleton.joints;
        let mut rotations: Vec<Option<Matrix>> = vec![None; joints.len()];
        rotations[self.upper] = Some(*rotation);
        for (index, joint) in joints.iter().enumerate().skip(self.upper + 1) {
            rotations[index] = joint.parent.and_then(|parent| rotations[parent]);
            if let Some((foot, brought)) = &self.foot
                && *foot == index
            {
                // Back to the foot in line with the shin, turned with the leg, and then forward.
                let in_line = multiply(brought, rotation);
                let forward = angles::least_turn(apply(&transpose(&in_line), FORWARD), FORWARD);
                rotations[index] = Some(multiply(&in_line, &transpose(&forward)));
            }
        }
        rotations
    }
}

/// The turn about a bone after which the mean of `frames` directions, of which this is the sum, is towards `to`;
/// nothing where they are along the bone.
fn degrees_about(along: [f64; 3], to: [f64; 3], sum: [f64; 3], frames: f64) -> Option<f64> {
    let sideways = [
        to[1] * along[2] - to[2] * along[1],
        to[2] * along[0] - to[0] * along[2],
        to[0] * along[1] - to[1] * along[0],
    ];
    // A turn about the bone brings `to` towards along × to.
    let (forward, side) = (dot(sum, to), -dot(sum, sideways));
    (forward.hypot(side) / frames >= LEAST_BEND).then(|| side.atan2(forward).to_degrees())
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

#[cfg(test)]
mod tests {
    use crate::fit;
    use crate::plan::{Bones, Follows, Joint, Plan, Turn};
    use mocap::Clip;
    use mocap::body::{Body, Part, Side};

    /// All bones of the legs are along y. The left thigh is turned by half a turn about it, the right one by a quarter,
    /// and the feet slope by 20 degrees. Knees are bent by `knees`, and by `sideways` about the axis along the feet.
    fn legs_along_one_axis(knees: f64, sideways: f64) -> Clip {
        let leg = |side: &str, x: f64| {
            format!(
                "JOINT {side}UpLeg {{ OFFSET {x} 0 0 CHANNELS 1 Yrotation
                 JOINT {side}Leg {{ OFFSET 0 -40 0 CHANNELS 2 Xrotation Zrotation
                 JOINT {side}Foot {{ OFFSET 0 -40 0 CHANNELS 2 Xrotation Zrotation
                 JOINT {side}ToeBase {{ OFFSET 0 -15 0 CHANNELS 1 Xrotation End Site {{ OFFSET 0 -5 0 }} }} }} }} }}\n"
            )
        };
        let text = format!(
            "HIERARCHY\nROOT Hips {{ OFFSET 0 90 0 CHANNELS 3 Zrotation Xrotation Yrotation
             JOINT Spine {{ OFFSET 0 10 0 CHANNELS 1 Yrotation
             JOINT Head {{ OFFSET 0 45 0 CHANNELS 1 Yrotation End Site {{ OFFSET 0 20 0 }} }} }}
             {}{}}}\nMOTION\nFrames: 1\nFrame Time: 0.02\n0 0 0 0 0 \
             180 {} {sideways} 70 0 0 -90 {sideways} {} 0 70 0\n",
            leg("Left", 9.0),
            leg("Right", -9.0),
            -knees,
            -knees,
        );
        let import = mocap::import::bvh::parse(text.as_bytes(), "legs.bvh", 1.0, None).expect("a BVH file");
        Clip { skeleton: import.clip.skeleton, motion: import.clip.motion }
    }

    #[test]
    fn feet_point_forward_however_the_bones_of_a_leg_are_turned() {
        for (bent, sideways) in [(0.0, 0.0), (50.0, 0.0), (0.0, 40.0)] {
            let clip = legs_along_one_axis(bent, sideways);
            let body = Body::of(&clip.skeleton);
            let joint = |name: &str, part, against| Joint {
                name: name.to_owned(),
                follows: Follows::Turns(vec![(
                    Turn {
                        bones: Bones {
                            bone: body.joint(part).expect("a bone"),
                            against: body.joint(against),
                        },
                        axis: [1.0, 0.0, 0.0],
                    },
                    1.0,
                )]),
                is_rotation: true,
                offset: 0.0,
                range: [-180.0, 180.0],
                max_speed: 1000.0,
                max_acceleration: 1e6,
            };
            for side in Side::BOTH {
                let knee = joint("knee", Part::Shin(side), Part::Thigh(side));
                let ankle = joint("ankle", Part::Foot(side), Part::Shin(side));
                let toes = joint("toes", Part::Toes(side), Part::Foot(side));
                let plan = Plan { joints: vec![knee, ankle, toes], chains: Vec::new(), twists: Vec::new() };
                let fitted = fit(&plan, &clip, false);
                for (value, expected) in fitted.clip.motion.samples.iter().zip([bent, 20.0, 0.0]) {
                    assert!((value - expected).abs() < 1e-6, "{side:?}: {:?}", fitted.clip.motion.samples);
                }
                // A hinge does not bend sideways, and toes and feet do not know.
                for bone in fitted.report.bones.iter().skip(usize::from(sideways > 0.0)) {
                    assert!(bone.worst < 1e-6, "{side:?}: {bone:?}");
                }
            }
        }
    }

    /// Two recordings of one figure, whose knees bend to other sides, and one pose that is in both.
    #[test]
    fn a_known_twist_is_the_same_in_all_recordings() {
        let one = legs_along_one_axis(40.0, 0.0);
        let part_of = |sideways: f64| {
            let mut clip = legs_along_one_axis(40.0, sideways);
            clip.motion.samples.extend(one.motion.samples.iter().copied());
            clip
        };
        let knee = |clip: &Clip, twists: Vec<(usize, f64)>| {
            let body = Body::of(&clip.skeleton);
            let joint = |part| body.joint(part).expect("a bone");
            let bones =
                Bones { bone: joint(Part::Shin(Side::Left)), against: body.joint(Part::Thigh(Side::Left)) };
            let knee = Joint {
                name: "knee".to_owned(),
                follows: Follows::Turns(vec![(Turn { bones, axis: [1.0, 0.0, 0.0] }, 1.0)]),
                is_rotation: true,
                offset: 0.0,
                range: [-180.0, 180.0],
                max_speed: 1000.0,
                max_acceleration: 1e6,
            };
            let fitted = fit(&Plan { joints: vec![knee], chains: Vec::new(), twists }, clip, false);
            (*fitted.clip.motion.samples.last().expect("a value"), fitted.report.twists)
        };
        let (first, shown) = knee(&one, Vec::new());
        let other = part_of(30.0);
        let (without, _) = knee(&other, Vec::new());
        assert!((first - 40.0).abs() < 1e-6 && (first - without).abs() > 1.0, "{first} {without}");
        let upper =
            one.skeleton.joints.iter().position(|joint| joint.name == shown[0].bone).expect("a joint");
        assert!(shown[0].part == "left thigh" && !shown[0].is_known);
        let (with, told) = knee(&other, vec![(upper, shown[0].degrees)]);
        assert!((first - with).abs() < 1e-6, "{first} {with}");
        assert!(told.iter().any(|twist| twist.is_known && twist.degrees == shown[0].degrees));
    }
}

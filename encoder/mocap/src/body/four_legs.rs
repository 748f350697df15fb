//! Whether a figure goes on four legs, so that what was taken for arms are its forelegs.

use super::figure::Body;
use super::part::{Part, Side};
use super::tree::{add, cross, dot, length, subtract, unit};
use crate::clip::Clip;
use crate::kinematics::Kinematics;

/// Forelegs point where hind legs do, to within these degrees; the trunk is as far at least from being in line with them.
const ALIKE: f64 = 45.0;

/// Poses that are looked at.
const POSES: usize = 50;

/// Part of the poses in which a figure on four legs is on four legs.
const MOSTLY: f64 = 0.8;

/// Whether the figure goes on four legs: in nearly all frames both limbs that were taken for arms and the legs point one
/// way, and the trunk across them.
///
/// A person's trunk is in line with the legs, but for one that crawls.
pub fn goes_on_four_legs(clip: &Clip, body: &Body) -> bool {
    let mut kinematics = Kinematics::new(&clip.skeleton);
    let mut points = vec![[0.0; 3]; kinematics.joints()];
    let limb = |from: fn(Side) -> Part, to: fn(Side) -> Part| -> Option<[[usize; 2]; 2]> {
        let of_side = |side| Some([body.joint(from(side))?, body.joint(to(side))?]);
        Some([of_side(Side::Left)?, of_side(Side::Right)?])
    };
    let Some(legs) = limb(Part::Thigh, Part::Foot) else { return false };
    let arms = limb(Part::UpperArm, Part::Hand).or_else(|| limb(Part::UpperArm, Part::Forearm));
    let Some(arms) = arms else { return false };
    let step = clip.motion.frames().div_ceil(POSES).max(1);
    let poses = (0..clip.motion.frames()).step_by(step);
    let count = poses.len();
    let on_four = poses.filter(|&frame| {
        // Joints are at their origins: a tail, as an ASF has, moves all ends of bones alike.
        kinematics.positions(clip.motion.frame(frame), &mut points);
        let along = |[from, to]: [usize; 2]| unit(subtract(points[to], points[from]));
        let middle =
            |limbs: [[usize; 2]; 2]| add(points[limbs[0][0]], points[limbs[1][0]]).map(|sum| sum / 2.0);
        let both = |limbs: [[usize; 2]; 2]| unit(add(along(limbs[0])?, along(limbs[1])?));
        let trunk = unit(subtract(middle(arms), middle(legs)));
        let (Some(down), Some(fore), Some(trunk)) = (both(legs), both(arms), trunk) else { return false };
        degrees(down, fore) < ALIKE && (degrees(down, trunk) - 90.0).abs() < 90.0 - ALIKE
    });
    on_four.count() as f64 >= MOSTLY * count.max(1) as f64
}

fn degrees(a: [f64; 3], b: [f64; 3]) -> f64 {
    length(cross(a, b)).atan2(dot(a, b)).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{import, sample};

    /// A figure whose trunk goes along z, or up, with limbs that hang down.
    fn figure(along: [i32; 3]) -> Clip {
        let limb = |name: [&str; 4], x: i32| {
            format!(
                "JOINT {} {{ OFFSET {x} 0 0 CHANNELS 1 Xrotation JOINT {} {{ OFFSET 0 -25 0 CHANNELS 1 Xrotation \
                 JOINT {} {{ OFFSET 0 -25 0 CHANNELS 1 Xrotation JOINT {} {{ OFFSET 0 0 8 CHANNELS 1 Xrotation \
                 End Site {{ OFFSET 0 0 2 }} }} }} }} }}\n",
                name[0], name[1], name[2], name[3]
            )
        };
        let [x, y, z] = along;
        let text = format!(
            "HIERARCHY\nROOT Hips {{ OFFSET 0 50 0 CHANNELS 3 Zrotation Xrotation Yrotation
             JOINT Spine {{ OFFSET {x} {y} {z} CHANNELS 1 Yrotation JOINT Chest {{ OFFSET {x} {y} {z} CHANNELS 1 Yrotation
             JOINT Head {{ OFFSET {x} {y} {z} CHANNELS 1 Yrotation End Site {{ OFFSET {x} {y} {z} }} }}
             {}{}}} }}\n{}{}}}\nMOTION\nFrames: 2\nFrame Time: 0.02\n{}\n{}\n",
            limb(["LeftArm", "LeftForeArm", "LeftHand", "LeftFinger"], 9),
            limb(["RightArm", "RightForeArm", "RightHand", "RightFinger"], -9),
            limb(["LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase"], 9),
            limb(["RightUpLeg", "RightLeg", "RightFoot", "RightToeBase"], -9),
            "0 ".repeat(22),
            "5 ".repeat(22),
        );
        import::bvh::parse(text.as_bytes(), "x.bvh", 1.0, None).expect("a BVH file").clip
    }

    #[test]
    fn a_dog_and_people() {
        let on_four = |clip: &Clip| goes_on_four_legs(clip, &Body::of(&clip.skeleton));
        assert!(on_four(&figure([0, 0, 20])));
        // One whose arms hang down, and one that walks.
        assert!(!on_four(&figure([0, 20, 0])));
        assert!(!on_four(&sample::clip()));
    }
}

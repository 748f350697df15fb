//! The rotation of each bone from the T-pose, whatever the skeleton's rest pose is.

use std::f64::consts::FRAC_1_SQRT_2;

use super::figure::Body;
use super::part::{Part, Side};
use super::tree::{Tree, add, cross, dot, length, subtract, unit};
use crate::angles::{self, IDENTITY, Matrix};
use crate::kinematics::Kinematics;
use crate::skeleton::Skeleton;

/// Axes of the figure: x to its left, y up, z forward.
const LEFT: [f64; 3] = [1.0, 0.0, 0.0];
const UP: [f64; 3] = [0.0, 1.0, 0.0];
const FORWARD: [f64; 3] = [0.0, 0.0, 1.0];

/// A frame of the figure this near to the world's axes, in degrees, is meant to be along them.
const NEAR_AXES: f64 = 30.0;

/// The spine, neck, head and hands may be so far from straight at rest, in degrees, and still be as in a T-pose: backs
/// and necks are curved. What is farther off is no T-pose, and is brought there.
const CURVED: f64 = 45.0;

/// The same for feet: the ankle is higher than the toes.
const SLOPING: f64 = 70.0;

/// The T-pose of a skeleton, prepared for many poses.
///
/// In the T-pose the figure stands upright, its arms out to the sides, and faces along z. It is found in two steps.
/// 1. The figure's axes: up is from the hips to the spine, left from the right thigh to the left one (else by the
///    shoulders). They are the world's where these are within 30 degrees.
/// 2. From the hips on outwards, every bone is as at rest, moved by what its parent was moved. Upper arms, forearms,
///    thighs and shins are then brought to their direction in the T-pose by the least rotation. Spine, chest, neck,
///    head and hands are so only where they are more than 45 degrees from it, feet and toes where more than 70.
///
/// Where all bones are along one axis at rest (as in exports of some programs), the twist of a limb about itself is
/// not told by the skeleton. Its direction is right then, and its twist is off by a constant.
#[derive(Clone, Debug)]
pub struct TPose {
    kinematics: Kinematics,
    /// From world to figure axes.
    axes: Matrix,
    /// For each joint what follows its rotation from rest: from figure axes in the T-pose to the world at rest.
    before: Vec<Matrix>,
    directions: Vec<[f64; 3]>,
}

impl TPose {
    /// Prepares the T-pose of a skeleton with this body.
    pub fn of(skeleton: &Skeleton, body: &Body) -> Self {
        let tree = Tree::of(skeleton);
        let axes = figure_axes(&tree, body);
        let joints = skeleton.joints.len();
        // Rotations from rest to the T-pose, in figure axes.
        let mut turns: Vec<Matrix> = Vec::with_capacity(joints);
        let mut directions: Vec<[f64; 3]> = Vec::with_capacity(joints);
        for joint in 0..joints {
            let (mut turn, above) =
                tree.parents[joint].map_or((IDENTITY, UP), |parent| (turns[parent], directions[parent]));
            let rest = angles::apply(&axes, aim(&tree, body, joint));
            let part = body.part(joint);
            if let (Some(part), Some(rest)) = (part, unit(rest)) {
                let (wanted, tolerance) = direction_of(part);
                let found = angles::apply(&turn, rest);
                if degrees_between(found, wanted) > tolerance {
                    turn = angles::multiply(&angles::least_turn(found, wanted), &turn);
                }
            }
            if part == Some(Part::Chest) {
                turn = angles::multiply(&twist_of_chest(&tree, body, &axes, &turn), &turn);
            }
            turns.push(turn);
            directions.push(match part {
                // A head that nods or turns is seen by its face, not by its crown.
                Some(Part::Head) => FORWARD,
                _ => unit(rest).map_or(above, |rest| angles::apply(&turn, rest)),
            });
        }
        let back = angles::transpose(&axes);
        let before = turns.iter().map(|turn| angles::multiply(&back, &angles::transpose(turn))).collect();
        Self { kinematics: Kinematics::new(skeleton), axes, before, directions }
    }

    /// Writes for every joint the rotation of its bone from the T-pose, in figure axes, to `out`.
    ///
    /// In the T-pose all are the identity. The rotation of bone b against bone a is `transpose(out[a]) · out[b]`.
    /// Costs about as much as forward kinematics.
    ///
    /// # Panics
    /// If `pose` has not one value per channel, or `out` not one element per joint.
    pub fn rotations(&mut self, pose: &[f64], out: &mut [Matrix]) {
        self.kinematics.rotations(pose, out);
        for (rotation, before) in out.iter_mut().zip(&self.before) {
            *rotation = angles::multiply(&self.axes, &angles::multiply(rotation, before));
        }
    }

    /// The direction of a joint's bone in the T-pose, in figure axes: a unit vector. That of the head is where the face
    /// looks.
    ///
    /// Where the bone points in a pose is `out[joint]` of [`rotations`](Self::rotations) times it.
    ///
    /// # Panics
    /// If the skeleton has no such joint.
    pub fn direction(&self, joint: usize) -> [f64; 3] {
        self.directions[joint]
    }

    /// How a joint's bone was brought to the T-pose beside the bone `above` it, in figure axes: the identity where the
    /// two are to each other as at rest.
    ///
    /// # Panics
    /// If the skeleton has no such joints.
    pub fn brought(&self, joint: usize, above: usize) -> Matrix {
        angles::multiply(&angles::transpose(&self.before[joint]), &self.before[above])
    }

    /// The figure's axes in the world at rest: the rows are its left, up and forward.
    pub const fn axes(&self) -> &Matrix {
        &self.axes
    }
}

/// The direction of a part's bone in the T-pose, and how far off is as good, in degrees.
const fn direction_of(part: Part) -> ([f64; 3], f64) {
    match part {
        // What these are is told by what hangs on them.
        Part::Hips | Part::Clavicle(_) => (UP, f64::INFINITY),
        Part::Spine | Part::Chest | Part::Neck | Part::Head => (UP, CURVED),
        Part::UpperArm(side) | Part::Forearm(side) => ([side.sign(), 0.0, 0.0], 0.0),
        Part::Hand(side) => ([side.sign(), 0.0, 0.0], CURVED),
        Part::Thigh(_) | Part::Shin(_) => ([0.0, -1.0, 0.0], 0.0),
        Part::Foot(_) | Part::Toes(_) => (FORWARD, SLOPING),
    }
}

/// From a joint to where its bone ends, at rest: to the next part's joint where there is one.
fn aim(tree: &Tree, body: &Body, joint: usize) -> [f64; 3] {
    let next: &[Part] = match body.part(joint) {
        Some(Part::Hips) => &[Part::Spine, Part::Chest, Part::Neck, Part::Head],
        Some(Part::Spine) => &[Part::Chest, Part::Neck, Part::Head],
        Some(Part::Chest) => &[Part::Neck, Part::Head],
        Some(Part::Neck) => &[Part::Head],
        Some(Part::Clavicle(side)) => &[Part::UpperArm(side)],
        Some(Part::UpperArm(side)) => &[Part::Forearm(side)],
        Some(Part::Forearm(side)) => &[Part::Hand(side)],
        Some(Part::Thigh(side)) => &[Part::Shin(side)],
        Some(Part::Shin(side)) => &[Part::Foot(side)],
        Some(Part::Foot(side)) => &[Part::Toes(side)],
        Some(Part::Head | Part::Hand(_) | Part::Toes(_)) | None => &[],
    };
    for next in next.iter().filter_map(|&part| body.joint(part)) {
        // A long spine is curved: only as far as the next joint.
        let path = tree.path(joint, next);
        let ends = path.iter().map(|&below| subtract(tree.origins[below], tree.origins[joint]));
        if let Some(end) = ends.into_iter().find(|&end| length(end) > 1e-6) {
            return end;
        }
    }
    tree.bone(joint)
}

/// The figure's left, up and forward in the world at rest.
fn figure_axes(tree: &Tree, body: &Body) -> Matrix {
    let origin = |part: Part| body.joint(part).map(|joint| tree.origins[joint]);
    let across = |part: fn(Side) -> Part| {
        let (left, right) = (origin(part(Side::Left))?, origin(part(Side::Right))?);
        unit(subtract(left, right))
            .map(|left_of_right| (left_of_right, add(left, right).map(|sum| sum / 2.0)))
    };
    let thighs = across(Part::Thigh);
    let from = origin(Part::Hips).or(thighs.map(|(_, middle)| middle)).unwrap_or([0.0; 3]);
    let above = body.joint(Part::Hips).map_or([0.0; 3], |hips| aim(tree, body, hips));
    let torso = [Part::Spine, Part::Chest, Part::Neck, Part::Head];
    let up = unit(above)
        .filter(|_| torso.iter().any(|&part| body.joint(part).is_some()))
        .or_else(|| torso.iter().filter_map(|&part| origin(part)).find_map(|end| unit(subtract(end, from))))
        .or_else(|| {
            let thigh = Side::BOTH.into_iter().find_map(|side| body.joint(Part::Thigh(side)))?;
            unit(aim(tree, body, thigh).map(|part| -part))
        })
        .unwrap_or(UP);
    let left = thighs
        .or_else(|| across(Part::UpperArm))
        .or_else(|| across(Part::Clavicle))
        .map_or_else(|| unit(cross(up, FORWARD)).unwrap_or(LEFT), |(left, _)| left);
    let Some(forward) = unit(cross(left, up)) else { return IDENTITY };
    let Some(left) = unit(cross(up, forward)) else { return IDENTITY };
    let axes = [left, up, forward];
    snapped(&axes).unwrap_or(axes)
}

/// The nearest axes that are along the world's, if they are near.
fn snapped(axes: &Matrix) -> Option<Matrix> {
    let near = |axis: [f64; 3]| {
        let k = (0..3).max_by(|&i, &j| axis[i].abs().total_cmp(&axis[j].abs()))?;
        let mut along = [0.0; 3];
        along[k] = axis[k].signum();
        (degrees_between(axis, along) < NEAR_AXES).then_some(along)
    };
    let (left, up) = (near(axes[0])?, near(axes[1])?);
    Some([left, up, unit(cross(left, up))?])
}

/// About the figure's up axis, what brings the line of the shoulders to the left, where that is far off.
fn twist_of_chest(tree: &Tree, body: &Body, axes: &Matrix, turn: &Matrix) -> Matrix {
    let origin = |part: Part| body.joint(part).map(|joint| tree.origins[joint]);
    let across =
        |part: fn(Side) -> Part| unit(subtract(origin(part(Side::Left))?, origin(part(Side::Right))?));
    let Some(left) = across(Part::Clavicle).or_else(|| across(Part::UpperArm)) else { return IDENTITY };
    let [x, y, z] = angles::apply(turn, angles::apply(axes, left));
    match unit([x, 0.0, z]) {
        Some(level) if y.abs() < FRAC_1_SQRT_2 && degrees_between(level, LEFT) > CURVED => {
            angles::least_turn(level, LEFT)
        }
        _ => IDENTITY,
    }
}

fn degrees_between(a: [f64; 3], b: [f64; 3]) -> f64 {
    length(cross(a, b)).atan2(dot(a, b)).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::Clip;
    use crate::skeleton::Dof;
    use crate::{export, import, sample};

    /// For every part that the figure has, and every frame, the rotation against the hips.
    fn against_hips(clip: &Clip) -> Vec<(Part, Vec<Matrix>)> {
        let body = Body::of(&clip.skeleton);
        let mut pose = TPose::of(&clip.skeleton, &body);
        let mut rotations = vec![IDENTITY; clip.skeleton.joints.len()];
        let hips = body.joint(Part::Hips).expect("hips");
        let found = Part::ALL.into_iter().filter_map(|part| Some((part, body.joint(part)?)));
        let mut all: Vec<(Part, usize, Vec<Matrix>)> =
            found.map(|(part, joint)| (part, joint, Vec::new())).collect();
        for frame in clip.motion.iter() {
            pose.rotations(frame, &mut rotations);
            for (_, joint, course) in &mut all {
                course.push(angles::multiply(&angles::transpose(&rotations[hips]), &rotations[*joint]));
            }
        }
        all.into_iter().map(|(part, _, course)| (part, course)).collect()
    }

    /// The largest angle between the two, in degrees, over all frames and parts.
    fn largest_difference(a: &Clip, b: &Clip) -> f64 {
        let (a, b) = (against_hips(a), against_hips(b));
        assert_eq!(a.len(), b.len());
        let mut largest: f64 = 0.0;
        for ((part, a), (other, b)) in a.iter().zip(&b) {
            assert_eq!((part, a.len()), (other, b.len()));
            for (a, b) in a.iter().zip(b) {
                largest = largest.max(angles::turned(&angles::multiply(&angles::transpose(a), b)));
            }
        }
        largest
    }

    fn as_bvh(clip: &Clip) -> Clip {
        let mut bytes = Vec::new();
        export::bvh::write(&mut bytes, &clip.skeleton, &clip.motion).expect("a BVH file");
        let twin = import::bvh::parse(&bytes, "twin.bvh", 1.0, None).expect("our own BVH file").clip;
        let (skeleton, motion) = (twin.skeleton, twin.motion);
        Clip { skeleton, motion }
    }

    #[test]
    fn a_bvh_twin_has_the_same_rotations() {
        let clip = sample::clip();
        assert_eq!(against_hips(&clip).len(), 17, "parts of the sample");
        // The file has six decimals of a degree, and chains of five joints.
        let difference = largest_difference(&clip, &as_bvh(&clip));
        assert!(difference < 5e-6, "{difference}");
    }

    /// The same motion of the same figure in other words. The figure is turned by `world`, and at rest the bone of each
    /// joint is turned by what `rest` says of its name; all angles are given anew, as Z, Y and X.
    fn reworded(clip: &Clip, world: &Matrix, rest: impl Fn(&str) -> Matrix) -> Clip {
        let mut reworded = clip.clone();
        let joints = &clip.skeleton.joints;
        let rest: Vec<Matrix> = joints.iter().map(|joint| rest(&joint.name)).collect();
        for (joint, other) in joints.iter().zip(&mut reworded.skeleton.joints) {
            let carried = joint.parent.map_or(world, |parent| &rest[parent]);
            other.offset = angles::apply(carried, joint.offset);
        }
        for (frame, pose) in clip.motion.iter().enumerate() {
            for (index, joint) in joints.iter().enumerate() {
                let turn = joint.rotations.iter().fold(IDENTITY, |before, &channel| {
                    let axis = clip.skeleton.channels[channel].dof.axis().expect("a rotation");
                    angles::multiply(&before, &angles::rotation(axis, pose[channel]))
                });
                let carried = joint.parent.map_or(world, |parent| &rest[parent]);
                let turn = angles::multiply(carried, &turn);
                let angles = angles::euler_zyx(&angles::multiply(&turn, &angles::transpose(&rest[index])));
                for (&channel, angle) in joint.rotations.iter().zip(angles) {
                    reworded.motion.samples[frame * clip.motion.channels + channel] = angle;
                }
            }
        }
        reworded
    }

    /// Not exactly the same: sines and cosines of other angles are rounded, five joints in a row.
    const ROUNDING: f64 = 1e-6;

    #[test]
    fn flips_and_whole_turns_do_not_matter() {
        let clip = as_bvh(&sample::clip());
        let mut other = clip.clone();
        for joint in &clip.skeleton.joints {
            let [z, y, x] = joint.rotations[..] else { continue };
            let frames = other.motion.samples.chunks_exact_mut(clip.motion.channels);
            for (frame, pose) in frames.enumerate() {
                if (frame / 7) % 2 == 0 {
                    (pose[z], pose[y], pose[x]) = (pose[z] + 180.0, 180.0 - pose[y], pose[x] + 180.0);
                }
                pose[z] += 360.0 * (frame % 3) as f64 - 360.0;
            }
        }
        let difference = largest_difference(&clip, &other);
        assert!(difference < ROUNDING, "{difference}");
    }

    #[test]
    fn the_order_of_the_angles_does_not_matter() {
        let clip = as_bvh(&sample::clip());
        let mut other = clip.clone();
        for joint in &clip.skeleton.joints {
            let [z, y, x] = joint.rotations[..] else { continue };
            // What was Z Y X becomes X Y Z, in the same columns.
            other.skeleton.channels[z].dof = Dof::Rx;
            other.skeleton.channels[x].dof = Dof::Rz;
            for pose in other.motion.samples.chunks_exact_mut(clip.motion.channels) {
                let turns = [(2, pose[z]), (1, pose[y]), (0, pose[x])];
                let turns = turns.map(|(axis, degrees)| angles::rotation(axis, degrees));
                let turn = angles::multiply(&angles::multiply(&turns[0], &turns[1]), &turns[2]);
                let [c, b, a] = angles::euler_zyx(&angles::transpose(&turn));
                (pose[z], pose[y], pose[x]) = (-a, -b, -c);
            }
        }
        let difference = largest_difference(&clip, &other);
        assert!(difference < ROUNDING, "{difference}");
    }

    /// Arms down in the sample; here arms and legs are apart at rest, as in an A-pose.
    fn a_pose(name: &str) -> Matrix {
        let side = if name.starts_with('l') { 1.0 } else { -1.0 };
        match name.get(1..) {
            Some("humerus" | "radius" | "hand") => angles::rotation(2, side * 40.0),
            Some("femur" | "tibia" | "foot") => angles::rotation(2, side * 8.0),
            _ => IDENTITY,
        }
    }

    #[test]
    fn an_a_pose_at_rest_does_not_matter() {
        let clip = as_bvh(&sample::clip());
        let difference = largest_difference(&clip, &reworded(&clip, &IDENTITY, a_pose));
        assert!(difference < ROUNDING, "{difference}");
    }

    /// Elbows that are bent at rest, out of the plane of the arms: a forearm's twist is then told otherwise, but where
    /// the bones point is not.
    #[test]
    fn bones_point_alike_whatever_the_rest_pose_is() {
        let clip = as_bvh(&sample::clip());
        let bent = |name: &str| match name.get(1..) {
            Some("radius" | "hand") => angles::multiply(&a_pose(name), &angles::rotation(0, -25.0)),
            _ => a_pose(name),
        };
        let other = reworded(&clip, &IDENTITY, bent);
        let turns = against_hips(&clip).into_iter().zip(against_hips(&other));
        let directions = directions(&clip).into_iter().zip(directions(&other));
        for (((part, a), (_, b)), (of_a, of_b)) in turns.zip(directions) {
            for (a, b) in a.iter().zip(&b) {
                let difference = degrees_between(angles::apply(a, of_a), angles::apply(b, of_b));
                assert!(difference < ROUNDING, "{part}: {difference}");
            }
        }
    }

    fn directions(clip: &Clip) -> Vec<[f64; 3]> {
        let body = Body::of(&clip.skeleton);
        let pose = TPose::of(&clip.skeleton, &body);
        let found = Part::ALL.into_iter().filter_map(|part| body.joint(part));
        found.map(|joint| pose.direction(joint)).collect()
    }

    #[test]
    fn where_the_figure_faces_and_its_size_do_not_matter() {
        let clip = as_bvh(&sample::clip());
        // z up and facing along -y; facing along x.
        let z_up = angles::rotation(0, 90.0);
        for world in [z_up, angles::rotation(1, 90.0), angles::multiply(&z_up, &angles::rotation(1, -90.0))] {
            let mut other = reworded(&clip, &world, |_| world);
            for joint in &mut other.skeleton.joints {
                joint.offset = joint.offset.map(|part| part / 100.0);
            }
            let difference = largest_difference(&clip, &other);
            assert!(difference < ROUNDING, "{world:?}: {difference}");
        }
    }
}

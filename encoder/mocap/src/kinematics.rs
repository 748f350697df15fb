//! Forward kinematics: where a pose puts the joints.

use crate::angles::{self, Matrix};
use crate::motion::Motion;
use crate::skeleton::Skeleton;

/// Forward kinematics of one skeleton, prepared for many poses; a pose of the CMU skeleton (31 joints, 62
/// channels) takes about 1 µs.
///
/// Follows the transform in [`Joint`](crate::skeleton::Joint): the ASF convention of the lecture notes, with
/// rotations that a bone's rest orientation frames.
#[derive(Clone, Debug)]
pub struct Kinematics {
    links: Vec<Link>,
    channels: usize,
    /// Per joint: its origin and its own axes, in the world, as the pose before left them.
    frames: Vec<Frame>,
}

#[derive(Clone, Copy, Debug)]
struct Frame {
    origin: [f64; 3],
    /// The directions of the joint's own x, y and z axes.
    axes: [[f64; 3]; 3],
}

/// A joint in the terms of its parent's own axes.
#[derive(Clone, Debug)]
struct Link {
    parent: Option<usize>,
    offset: [f64; 3],
    /// The joint's own axes at rest, or nothing if they are the parent's.
    axes: Option<[[f64; 3]; 3]>,
    /// From the world's axes to the joint's own at rest.
    to_own: Matrix,
    /// In the joint's own axes.
    tail: [f64; 3],
    translations: Vec<(usize, usize)>,
    rotations: Vec<(usize, usize)>,
    /// The channel that lengthens the parent, and its direction in the parent's own axes.
    parent_length: Option<(usize, [f64; 3])>,
    /// The channel that lengthens this bone, and its direction in its own axes.
    length: Option<(usize, [f64; 3])>,
}

impl Kinematics {
    /// Prepares the kinematics of a skeleton.
    pub fn new(skeleton: &Skeleton) -> Self {
        let mut links: Vec<Link> = Vec::with_capacity(skeleton.joints.len());
        for joint in &skeleton.joints {
            let parent = joint.parent.map(|parent| &skeleton.joints[parent]);
            let from_parent = parent.map_or(angles::IDENTITY, |parent| angles::transpose(&parent.axis));
            let to_own = angles::transpose(&joint.axis);
            let rest = angles::multiply(&from_parent, &joint.axis);
            let dof = |channel: &usize| skeleton.channels[*channel].dof;
            let axis = |channel: usize| Some((channel, skeleton.channels[channel].dof.axis()?));
            let translations = joint.channels.clone().filter(|channel| !dof(channel).is_rotation());
            let tail = angles::apply(&to_own, joint.tail);
            let stretched = joint.channels.clone().find(|channel| dof(channel).axis().is_none());
            links.push(Link {
                parent: joint.parent,
                offset: angles::apply(&from_parent, joint.offset),
                axes: (rest != angles::IDENTITY).then(|| angles::transpose(&rest)),
                to_own,
                tail,
                translations: translations.filter_map(axis).collect(),
                rotations: joint.rotations.iter().copied().filter_map(axis).collect(),
                parent_length: joint.parent.and_then(|parent| links[parent].length),
                length: stretched.map(|channel| (channel, unit(tail))),
            });
        }
        let frame = Frame { origin: [0.0; 3], axes: angles::IDENTITY };
        Self { frames: vec![frame; links.len()], links, channels: skeleton.channels.len() }
    }

    /// Number of joints, the root included.
    pub fn joints(&self) -> usize {
        self.links.len()
    }

    /// Number of channels in a pose.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Writes the position of every joint to `out`, in centimetres, in the order of the skeleton's joints.
    ///
    /// # Panics
    /// If `pose` has not one value per channel, or `out` not one element per joint.
    pub fn positions(&mut self, pose: &[f64], out: &mut [[f64; 3]]) {
        self.walk(pose, out, |_, _, _| {});
    }

    /// The points `off` cm from the position of joint `index` along its own x, y and z axes, in the pose that
    /// [`positions`](Self::positions) was given last; `position` is what that call said of the joint.
    pub(crate) fn points_off(&self, index: usize, position: [f64; 3], off: f64) -> [[f64; 3]; 3] {
        self.frames[index].axes.map(|axis| std::array::from_fn(|k| position[k] + off * axis[k]))
    }

    /// Writes the rotation of every joint's bone from its rest pose to `out`, in the world's axes.
    ///
    /// At rest all are the identity; a joint without rotations has its parent's.
    ///
    /// # Panics
    /// If `pose` has not one value per channel, or `out` not one element per joint.
    pub fn rotations(&mut self, pose: &[f64], out: &mut [Matrix]) {
        assert_eq!(out.len(), self.links.len(), "rotations of joints");
        let mut positions = vec![[0.0; 3]; self.links.len()];
        self.walk(pose, &mut positions, |_, _, _| {});
        for ((rotation, frame), link) in out.iter_mut().zip(&self.frames).zip(&self.links) {
            *rotation = angles::multiply(&angles::transpose(&frame.axes), &link.to_own);
        }
    }

    /// As [`positions`](Self::positions), and tells `visit` for every channel of a joint the point and the
    /// direction in the world about or along which it moves.
    #[inline]
    fn walk(&mut self, pose: &[f64], out: &mut [[f64; 3]], mut visit: impl FnMut(usize, [f64; 3], [f64; 3])) {
        assert_eq!(pose.len(), self.channels, "values in the pose");
        assert_eq!(out.len(), self.links.len(), "positions of joints");
        let world = Frame { origin: [0.0; 3], axes: angles::IDENTITY };
        for (index, link) in self.links.iter().enumerate() {
            let Frame { mut origin, mut axes } = link.parent.map_or(world, |parent| self.frames[parent]);
            move_by(&mut origin, &axes, link.offset);
            if let Some((channel, direction)) = link.parent_length {
                move_by(&mut origin, &axes, direction.map(|part| part * pose[channel]));
            }
            if let Some(rest) = &link.axes {
                axes = rest.map(|axis| combine(&axes, axis));
            }
            for &(channel, axis) in &link.translations {
                visit(channel, origin, axes[axis]);
                let mut step = [0.0; 3];
                step[axis] = pose[channel];
                move_by(&mut origin, &axes, step);
            }
            for &(channel, axis) in &link.rotations {
                visit(channel, origin, axes[axis]);
                let (sin, cos) = pose[channel].to_radians().sin_cos();
                let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
                let (a, b) = (axes[i], axes[j]);
                for k in 0..3 {
                    axes[i][k] = cos * a[k] + sin * b[k];
                    axes[j][k] = cos * b[k] - sin * a[k];
                }
            }
            self.frames[index] = Frame { origin, axes };
            out[index] = origin;
            move_by(&mut out[index], &axes, link.tail);
            if let Some((channel, direction)) = link.length {
                visit(channel, origin, combine(&axes, direction));
                move_by(&mut out[index], &axes, direction.map(|part| part * pose[channel]));
            }
        }
    }

    /// Positions of all joints in all frames: `frames × joints` elements, row-major.
    ///
    /// # Panics
    /// If the motion has another number of channels than the skeleton.
    pub fn all_positions(&mut self, motion: &Motion) -> Vec<[f64; 3]> {
        let joints = self.joints();
        let mut positions = vec![[0.0; 3]; motion.frames() * joints];
        for (pose, out) in motion.iter().zip(positions.chunks_exact_mut(joints)) {
            self.positions(pose, out);
        }
        positions
    }
}

/// How much each channel moves the joints: the sum over joints of the squared displacement in cm², per
/// squared degree of a rotation or squared centimetre of a translation, averaged over frames.
///
/// From the Jacobian: a joint at lever arm r from a rotation axis a moves by a × r for a radian. An error of
/// `e` degrees in channel `c` alone moves the joints by about `e² · sensitivity[c]` cm² in all. Costs about
/// twice as much as forward kinematics of the motion.
///
/// # Panics
/// If the motion has no frame or another number of channels than the skeleton.
pub fn sensitivity(skeleton: &Skeleton, motion: &Motion) -> Vec<f64> {
    assert!(motion.frames() > 0, "a motion without frames");
    let mut kinematics = Kinematics::new(skeleton);
    let mut positions = vec![[0.0; 3]; kinematics.joints()];
    let mut levers = vec![([0.0; 3], [0.0; 3]); skeleton.channels.len()];
    let mut total = vec![0.0; skeleton.channels.len()];
    for pose in motion.iter() {
        kinematics.walk(pose, &mut positions, |channel, origin, axis| levers[channel] = (origin, axis));
        // About the root's position, so that a place far from the world's origin costs no precision.
        let centre = positions[0];
        let mut moments: Vec<Moments> =
            positions.iter().map(|&position| Moments::of(subtract(position, centre))).collect();
        for (index, joint) in skeleton.joints.iter().enumerate().rev() {
            if let Some(parent) = joint.parent {
                let below = moments[index];
                moments[parent].add(&below);
            }
        }
        for ((channel, total), &(origin, axis)) in skeleton.channels.iter().zip(&mut total).zip(&levers) {
            let moments = &moments[channel.joint];
            *total += if channel.dof.is_rotation() {
                moments.about(subtract(origin, centre), axis) * 1_f64.to_radians().powi(2)
            } else {
                moments.count
            };
        }
    }
    total.iter().map(|total| total / motion.frames() as f64).collect()
}

/// Number, sum and sum of products of points.
#[derive(Clone, Copy)]
struct Moments {
    count: f64,
    sum: [f64; 3],
    products: Matrix,
}

impl Moments {
    fn of(point: [f64; 3]) -> Self {
        Self { count: 1.0, sum: point, products: point.map(|a| point.map(|b| a * b)) }
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        for i in 0..3 {
            self.sum[i] += other.sum[i];
            for j in 0..3 {
                self.products[i][j] += other.products[i][j];
            }
        }
    }

    /// Sum of the squared distances from the line through `origin` along the unit vector `axis`.
    fn about(&self, origin: [f64; 3], axis: [f64; 3]) -> f64 {
        let mut squares = 0.0;
        let mut along = 0.0;
        for i in 0..3 {
            for j in 0..3 {
                let product = self.products[i][j] - origin[i] * self.sum[j] - self.sum[i] * origin[j]
                    + self.count * origin[i] * origin[j];
                squares += if i == j { product } else { 0.0 };
                along += axis[i] * axis[j] * product;
            }
        }
        (squares - along).max(0.0)
    }
}

fn subtract(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `vector`, given along `axes`, in the axes' own frame of reference.
#[inline]
fn combine(axes: &[[f64; 3]; 3], vector: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| axes[0][k] * vector[0] + axes[1][k] * vector[1] + axes[2][k] * vector[2])
}

#[inline]
fn move_by(point: &mut [f64; 3], axes: &[[f64; 3]; 3], vector: [f64; 3]) {
    let step = combine(axes, vector);
    for k in 0..3 {
        point[k] += step[k];
    }
}

fn unit(vector: [f64; 3]) -> [f64; 3] {
    let length = vector.iter().map(|part| part * part).sum::<f64>().sqrt();
    if length > 0.0 { vector.map(|part| part / length) } else { vector }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::asf;
    use crate::import::asf::tests::odd_skeleton;
    use crate::sample;
    use crate::skeleton::Dof;

    /// The definition in [`Joint`](crate::skeleton::Joint), matrix by matrix.
    fn by_definition(skeleton: &Skeleton, pose: &[f64]) -> Vec<[f64; 3]> {
        // Rotation and translation of a 4 × 4 matrix.
        type Transform = (Matrix, [f64; 3]);
        let then = |a: &Transform, b: &Transform| -> Transform {
            let moved = angles::apply(&a.0, b.1);
            (angles::multiply(&a.0, &b.0), std::array::from_fn(|k| a.1[k] + moved[k]))
        };
        let point = |by: [f64; 3]| (angles::IDENTITY, by);
        let turn = |by: Matrix| (by, [0.0; 3]);
        let mut transforms: Vec<Transform> = Vec::new();
        let mut positions = Vec::new();
        let longer = |joint: &crate::skeleton::Joint| {
            let length = joint.tail.iter().map(|part| part * part).sum::<f64>().sqrt();
            let channel = joint.channels.clone().find(|&c| skeleton.channels[c].dof == Dof::Length);
            channel.map_or([0.0; 3], |channel| joint.tail.map(|part| part / length * pose[channel]))
        };
        for joint in &skeleton.joints {
            let mut m = joint.parent.map_or(point([0.0; 3]), |parent| transforms[parent]);
            m = then(&m, &point(joint.offset));
            if let Some(parent) = joint.parent {
                m = then(&m, &point(longer(&skeleton.joints[parent])));
            }
            m = then(&m, &turn(joint.axis));
            for channel in joint.channels.clone() {
                let mut by = [0.0; 3];
                match skeleton.channels[channel].dof {
                    Dof::Tx => by[0] = pose[channel],
                    Dof::Ty => by[1] = pose[channel],
                    Dof::Tz => by[2] = pose[channel],
                    _ => {}
                }
                m = then(&m, &point(by));
            }
            for &channel in &joint.rotations {
                let axis = skeleton.channels[channel].dof.axis().expect("a rotation");
                m = then(&m, &turn(angles::rotation(axis, pose[channel])));
            }
            m = then(&m, &turn(angles::transpose(&joint.axis)));
            transforms.push(m);
            let (tail, longer) = (joint.tail, longer(joint));
            positions.push(then(&m, &point(std::array::from_fn(|k| tail[k] + longer[k]))).1);
        }
        positions
    }

    /// Poses that bend everything.
    fn poses(channels: usize) -> impl Iterator<Item = Vec<f64>> {
        (1..20).map(move |seed| (0..channels).map(|c| ((seed * 37 + c * 101) % 173) as f64 - 80.0).collect())
    }

    fn largest_difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
        assert_eq!(a.len(), b.len());
        let pairs = a.as_flattened().iter().zip(b.as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn positions_are_those_of_the_definition() {
        for skeleton in [odd_skeleton(), sample::clip().skeleton] {
            let mut kinematics = Kinematics::new(&skeleton);
            let mut positions = vec![[0.0; 3]; kinematics.joints()];
            for pose in poses(skeleton.channels.len()) {
                kinematics.positions(&pose, &mut positions);
                let difference = largest_difference(&positions, &by_definition(&skeleton, &pose));
                assert!(difference < 1e-9, "{difference}");
            }
        }
    }

    #[test]
    fn a_bone_turns_about_its_own_axes() {
        // Its x axis is the world's y axis, about which z turns to x; and z of the world is its own.
        let text = ":root\norder TX\n:bonedata\nbegin\nname a\ndirection 0 0 1\nlength 1\naxis 0 0 90 XYZ\ndof rx\n\
            end\n:hierarchy\nbegin\nroot a\nend\n";
        let skeleton = asf::parse(text.as_bytes(), "a.asf").expect("a skeleton");
        let mut positions = [[0.0; 3]; 2];
        Kinematics::new(&skeleton).positions(&[3.0, 90.0], &mut positions);
        let difference = largest_difference(&positions, &[[3.0, 0.0, 0.0], [3.0 + 2.54, 0.0, 0.0]]);
        assert!(difference < 1e-12, "{positions:?}");
    }

    #[test]
    fn sensitivity_is_that_of_finite_differences() {
        for skeleton in [odd_skeleton(), sample::clip().skeleton] {
            let channels = skeleton.channels.len();
            let samples: Vec<f64> = poses(channels).flatten().collect();
            let motion = Motion { fps: 1.0, channels, samples };
            let mut kinematics = Kinematics::new(&skeleton);
            for (channel, found) in sensitivity(&skeleton, &motion).into_iter().enumerate() {
                let step = 1e-3;
                let mut moved = [motion.clone(), motion.clone()];
                for (motion, step) in moved.iter_mut().zip([-step, step]) {
                    motion
                        .samples
                        .iter_mut()
                        .skip(channel)
                        .step_by(channels)
                        .for_each(|value| *value += step);
                }
                let [low, high] = moved.map(|motion| kinematics.all_positions(&motion));
                let pairs = low.as_flattened().iter().zip(high.as_flattened());
                let squares: f64 = pairs.map(|(a, b)| ((b - a) / (2.0 * step)).powi(2)).sum();
                let expected = squares / motion.frames() as f64;
                let error = (found - expected).abs();
                assert!(error <= 1e-6 * expected.max(1.0), "{channel}: {found} {expected}");
            }
        }
    }
}

//! Euler angles without turns and flips.
//!
//! Three angles about three different axes have a twin for each pose: (a + 180, 180 - b, c + 180). Files change from one
//! to the other where they like. Here they do not.

use mocap::angles::wrap;
use mocap::{Motion, Skeleton};

/// The angles of a joint's three rotations in all frames.
pub type Triples = Vec<[f64; 3]>;

/// The channels of a joint's rotations, in the order in which these multiply, where there are three about different axes.
pub fn triple(skeleton: &Skeleton, joint: usize) -> Option<[usize; 3]> {
    let channels: [usize; 3] = skeleton.joints[joint].rotations.as_slice().try_into().ok()?;
    let axes = channels.map(|channel| skeleton.channels[channel].dof.axis());
    (axes[0] != axes[1] && axes[1] != axes[2] && axes[0] != axes[2]).then_some(channels)
}

/// A joint's angles, continuous from the first frame on, and their twins, which are so too.
pub fn continuous(motion: &Motion, channels: [usize; 3]) -> [Triples; 2] {
    let mut straight: Triples = Vec::with_capacity(motion.frames());
    for pose in motion.iter() {
        let angles = channels.map(|channel| pose[channel]);
        let near = match straight.last() {
            None => angles,
            Some(before) => {
                let here = nearest_turns(angles, before);
                let there = nearest_turns(twin(angles), before);
                if distance(&there, before) < distance(&here, before) { there } else { here }
            }
        };
        straight.push(near);
    }
    let twins = straight.iter().map(|angles| twin(*angles)).collect();
    [straight, twins]
}

/// The other three angles of the same rotation.
fn twin([a, b, c]: [f64; 3]) -> [f64; 3] {
    [a + 180.0, 180.0 - b, c + 180.0]
}

fn nearest_turns(angles: [f64; 3], to: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|index| to[index] + wrap(angles[index] - to[index]))
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use mocap::angles::{multiply, rotation};

    #[test]
    fn a_twin_is_the_same_rotation_in_every_order() {
        for order in [[0, 1, 2], [2, 0, 1], [1, 0, 2]] {
            let matrix = |angles: [f64; 3]| {
                let [a, b, c] = [0, 1, 2].map(|index| rotation(order[index], angles[index]));
                multiply(&a, &multiply(&b, &c))
            };
            let angles = [10.0, -50.0, 120.0];
            let (one, other) = (matrix(angles), matrix(twin(angles)));
            assert!(one.as_flattened().iter().zip(other.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }

    #[test]
    fn flips_and_turns_are_taken_out() {
        let truth: Triples = (0..50).map(|frame| [f64::from(frame), 80.0 - f64::from(frame), 5.0]).collect();
        let written = truth.iter().enumerate().map(|(frame, angles)| match frame % 3 {
            0 => *angles,
            1 => twin(*angles),
            _ => angles.map(|angle| angle + 360.0),
        });
        let samples = written.flatten().collect();
        let motion = Motion { fps: 60.0, channels: 3, samples };
        let [straight, twins] = continuous(&motion, [0, 1, 2]);
        let near = |a: &Triples, b: &Triples| a.iter().zip(b).all(|(a, b)| distance(a, b) < 1e-18);
        assert!(near(&straight, &truth));
        assert!(near(&twins, &truth.into_iter().map(twin).collect()));
    }
}

//! The turn of a rotation about an axis: the twist of the swing-twist decomposition.
//!
//! A rotation is a swing, whose axis is perpendicular to the given one, after a twist about the given one. With the
//! quaternion (w, v) of the rotation and the unit axis a, the twist is `2 · atan2(v · a, w)`. (P. Dobrowolski,
//! "Swing-twist decomposition in Clifford algebra", 2015, section 2.)

use mocap::angles::Matrix;
use mocap::quaternion;

/// A twist, and how well it is defined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist {
    /// In degrees, in (-360, 360].
    pub degrees: f64,
    /// From 1, where the rotation is a twist alone, to 0, where it swings by 180 degrees and each twist gives the same
    /// rotation: the squared cosine of half the swing.
    pub certainty: f64,
}

/// The twist of a rotation about a unit vector.
pub fn twist(rotation: &Matrix, axis: [f64; 3]) -> Twist {
    let [x, y, z, w] = quaternion::of_matrix(rotation);
    let along = x * axis[0] + y * axis[1] + z * axis[2];
    Twist { degrees: 2.0 * along.atan2(w).to_degrees(), certainty: along.mul_add(along, w * w).min(1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mocap::angles::{about, multiply, wrap};

    #[test]
    fn a_twist_is_what_is_left_of_a_rotation_without_its_swing() {
        let axis = [0.6, 0.0, 0.8];
        for degrees in [-179.0, -120.0, -1.0, 0.0, 35.0, 90.0, 180.0] {
            for swing in [0.0, 20.0, 100.0, 170.0] {
                let rotation = multiply(&about([0.8, 0.0, -0.6], swing), &about(axis, degrees));
                let found = twist(&rotation, axis);
                assert!(wrap(found.degrees - degrees).abs() < 1e-9, "{degrees}, {swing}: {found:?}");
                let expected = (swing / 2.0).to_radians().cos().powi(2);
                assert!((found.certainty - expected).abs() < 1e-12, "{degrees}, {swing}: {found:?}");
            }
        }
        assert!(twist(&about([0.0, 1.0, 0.0], 180.0), axis).certainty < 1e-12);
    }
}

//! The turn of a rotation about an axis: the twist of the swing-twist decomposition.
//!
//! A rotation is a swing, whose axis is perpendicular to the given one, after a twist about the given one. With the
//! quaternion (w, v) of the rotation and the unit axis a, the twist is `2 · atan2(v · a, w)`. (P. Dobrowolski,
//! "Swing-twist decomposition in Clifford algebra", 2015, section 2.)

use mocap::angles::Matrix;

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
    let [w, x, y, z] = quaternion(rotation);
    let along = x * axis[0] + y * axis[1] + z * axis[2];
    Twist { degrees: 2.0 * along.atan2(w).to_degrees(), certainty: along.mul_add(along, w * w).min(1.0) }
}

/// The unit quaternion `[w, x, y, z]` of a rotation; of the two that there are either.
///
/// The largest part is found first, so that nothing is divided by a small number. (S. W. Shepperd, "Quaternion from
/// rotation matrix", 1978.)
fn quaternion(m: &Matrix) -> [f64; 4] {
    let trace = m[0][0] + m[1][1] + m[2][2];
    let parts = [trace, m[0][0], m[1][1], m[2][2]];
    let largest = (0..4).max_by(|&i, &j| parts[i].total_cmp(&parts[j])).unwrap_or(0);
    let part = (1.0 + 2.0 * parts[largest] - trace).max(0.0).sqrt() / 2.0;
    let rest = |value: f64| value / (4.0 * part);
    let (wx, wy, wz) = (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]);
    let (xy, xz, yz) = (m[0][1] + m[1][0], m[0][2] + m[2][0], m[1][2] + m[2][1]);
    match largest {
        0 => [part, rest(wx), rest(wy), rest(wz)],
        1 => [rest(wx), part, rest(xy), rest(xz)],
        2 => [rest(wy), rest(xy), part, rest(yz)],
        _ => [rest(wz), rest(xz), rest(yz), part],
    }
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

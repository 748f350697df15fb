//! Angles in degrees and rotation matrices.

/// A 3 × 3 matrix, row-major, that multiplies column vectors.
pub type Matrix = [[f64; 3]; 3];

/// The matrix that changes nothing.
pub const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The same angle in (-180, 180], in degrees. Angles that are there already are not changed by a bit.
pub fn wrap(degrees: f64) -> f64 {
    if degrees > -180.0 && degrees <= 180.0 {
        return degrees;
    }
    let turned = degrees.rem_euclid(360.0);
    if turned > 180.0 { turned - 360.0 } else { turned }
}

/// The same rotation as `angles` about three different axes, in degrees, written such that it is nearest to `to`: with
/// whole turns, and either as it is or as (a + 180, 180 - b, c + 180).
pub fn nearest_triple(angles: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    let [a, b, c] = angles;
    // Angles that are near already do not change by a bit.
    let turned = |angle: f64, to: f64| angle - 360.0 * ((angle - to) / 360.0).round();
    let near = |angles: [f64; 3]| [0, 1, 2].map(|k| turned(angles[k], to[k]));
    let distance = |angles: &[f64; 3]| -> f64 { (0..3).map(|k| (angles[k] - to[k]).powi(2)).sum() };
    let (same, other) = (near(angles), near([a + 180.0, 180.0 - b, c + 180.0]));
    if distance(&other) < distance(&same) { other } else { same }
}

/// Rotation by `degrees` about axis 0 (x), 1 (y) or 2 (z), right-handed.
///
/// # Panics
/// If `axis` is not 0, 1 or 2.
pub fn rotation(axis: usize, degrees: f64) -> Matrix {
    assert!(axis < 3, "axis {axis}, expected 0, 1 or 2");
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut matrix = IDENTITY;
    (matrix[i][i], matrix[i][j]) = (cos, -sin);
    (matrix[j][i], matrix[j][j]) = (sin, cos);
    matrix
}

/// Rotation by `degrees` about a unit vector, right-handed (Rodrigues' formula).
pub fn about(axis: [f64; 3], degrees: f64) -> Matrix {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let [x, y, z] = axis;
    let cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    std::array::from_fn(|i| {
        std::array::from_fn(|j| cos * IDENTITY[i][j] + sin * cross[i][j] + (1.0 - cos) * axis[i] * axis[j])
    })
}

/// The least rotation that brings a unit vector to another; of opposite ones, about z, or about y where they are
/// along z.
pub fn least_turn(from: [f64; 3], to: [f64; 3]) -> Matrix {
    let axis: [f64; 3] = std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        from[i] * to[j] - from[j] * to[i]
    });
    let sin = axis[0].hypot(axis[1]).hypot(axis[2]);
    let cos = from[0] * to[0] + from[1] * to[1] + from[2] * to[2];
    if sin > 1e-9 {
        about(axis.map(|part| part / sin), sin.atan2(cos).to_degrees())
    } else if cos > 0.0 {
        IDENTITY
    } else {
        rotation(if from[2].abs() < 0.7 { 2 } else { 1 }, 180.0)
    }
}

/// How far a rotation turns, in degrees from 0 to 180, about whatever axis.
///
/// To about 1e-8 degrees near 0 and 180 too, where the trace alone loses half the digits.
pub fn turned(rotation: &Matrix) -> f64 {
    let [[a, b, c], [d, e, f], [g, h, i]] = *rotation;
    let twice_sin = (h - f).hypot(c - g).hypot(d - b);
    twice_sin.atan2(a + e + i - 1.0).to_degrees()
}

/// Product `a · b`.
pub fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|column| (0..3).map(|k| a[row][k] * b[k][column]).sum()))
}

/// Product of a matrix and a column vector.
pub fn apply(matrix: &Matrix, vector: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2])
}

/// The transpose, which is a rotation's inverse.
pub fn transpose(matrix: &Matrix) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[column][row]))
}

/// Angles `[z, y, x]` in degrees with `matrix = Rz · Ry · Rx`; y is in [-90, 90].
///
/// Where y is ±90 degrees, only z ± x is defined, and x is taken as 0.
pub fn euler_zyx(matrix: &Matrix) -> [f64; 3] {
    let [[m00, m01, _], [m10, m11, _], [m20, m21, m22]] = *matrix;
    let cos_y = m00.hypot(m10);
    let y = (-m20).atan2(cos_y);
    let (z, x) = if cos_y > 1e-9 { (m10.atan2(m00), m21.atan2(m22)) } else { ((-m01).atan2(m11), 0.0) };
    [z, y, x].map(f64::to_degrees)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zyx([z, y, x]: [f64; 3]) -> Matrix {
        multiply(&multiply(&rotation(2, z), &rotation(1, y)), &rotation(0, x))
    }

    #[test]
    fn wraps_into_half_open_range() {
        for (degrees, wrapped) in
            [(180.0, 180.0), (-180.0, 180.0), (181.0, -179.0), (-540.0, 180.0), (725.0, 5.0), (1e-17, 1e-17)]
        {
            assert_eq!(wrap(degrees), wrapped);
        }
    }

    #[test]
    fn rotations_are_right_handed() {
        for axis in 0..3 {
            let mut from = [0.0; 3];
            from[(axis + 1) % 3] = 1.0;
            let to = apply(&rotation(axis, 90.0), from);
            assert!((to[(axis + 2) % 3] - 1.0).abs() < 1e-15, "{axis}: {to:?}");
        }
    }

    #[test]
    fn a_turn_about_an_axis_is_that_rotation() {
        for (k, axis) in IDENTITY.into_iter().enumerate() {
            for degrees in [-170.0, -1e-7, 0.0, 30.0, 179.0] {
                let (found, expected) = (about(axis, degrees), rotation(k, degrees));
                let pairs = found.as_flattened().iter().zip(expected.as_flattened());
                assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-15), "{k} {degrees}");
                assert!((turned(&found) - degrees.abs()).abs() < 1e-7, "{k} {degrees}");
            }
        }
        let diagonal = [1.0, 1.0, 1.0].map(|part: f64| part / 3.0_f64.sqrt());
        let moved = apply(&about(diagonal, 120.0), [1.0, 0.0, 0.0]);
        assert!((moved[1] - 1.0).abs() < 1e-15, "x goes to y: {moved:?}");
    }

    #[test]
    fn the_least_turn_brings_one_direction_to_the_other() {
        let directions = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [0.6, 0.0, 0.8]];
        for from in directions {
            for to in directions.into_iter().chain([from.map(|part| -part)]) {
                let turn = least_turn(from, to);
                let moved = apply(&turn, from);
                assert!(moved.iter().zip(to).all(|(a, b)| (a - b).abs() < 1e-12), "{from:?} {to:?}");
                let cos: f64 = from.iter().zip(to).map(|(a, b)| a * b).sum();
                assert!((turned(&turn) - cos.acos().to_degrees()).abs() < 1e-5, "{from:?} {to:?}");
            }
        }
    }

    #[test]
    fn euler_angles_give_the_matrix_back() {
        for angles in [[10.0, 20.0, 30.0], [-170.0, 89.0, 140.0], [50.0, 90.0, 20.0], [50.0, -90.0, 20.0]] {
            let matrix = zyx(angles);
            let again = zyx(euler_zyx(&matrix));
            for (a, b) in matrix.as_flattened().iter().zip(again.as_flattened()) {
                assert!((a - b).abs() < 1e-12, "{angles:?}");
            }
        }
    }
}

//! Rotations as unit quaternions `[x, y, z, w]`, the order of glTF.

use crate::angles::Matrix;

/// The matrix of a quaternion, which need not have length 1; the identity where its length is 0.
pub fn to_matrix(quaternion: [f64; 4]) -> Matrix {
    let square: f64 = quaternion.iter().map(|part| part * part).sum();
    if square == 0.0 {
        return crate::angles::IDENTITY;
    }
    let [x, y, z, w] = quaternion;
    let s = 2.0 / square;
    [
        [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)],
    ]
}

/// The quaternion of a rotation, of the two with the one whose largest part is above 0.
pub fn of_matrix(m: &Matrix) -> [f64; 4] {
    // Squares of the parts, times 4: the largest is divided by, so that nothing is divided by a small number.
    let squares = [
        1.0 + m[0][0] - m[1][1] - m[2][2],
        1.0 - m[0][0] + m[1][1] - m[2][2],
        1.0 - m[0][0] - m[1][1] + m[2][2],
        1.0 + m[0][0] + m[1][1] + m[2][2],
    ];
    let largest = (0..4).max_by(|&a, &b| squares[a].total_cmp(&squares[b])).unwrap_or(3);
    let part = squares[largest].max(0.0).sqrt() / 2.0;
    let by = 1.0 / (4.0 * part);
    let [xy, xz, yz] = [m[0][1] + m[1][0], m[0][2] + m[2][0], m[1][2] + m[2][1]].map(|sum| sum * by);
    let [xw, yw, zw] =
        [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]].map(|difference| difference * by);
    match largest {
        0 => [part, xy, xz, xw],
        1 => [xy, part, yz, yw],
        2 => [xz, yz, part, zw],
        _ => [xw, yw, zw, part],
    }
}

/// The rotation that is `t` of the shortest way from one to another; both have length 1.
pub fn slerp(from: &[f64; 4], to: &[f64; 4], t: f64) -> [f64; 4] {
    let dot: f64 = from.iter().zip(to).map(|(a, b)| a * b).sum();
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    let angle = (dot * sign).min(1.0).acos();
    // So near, the arc is a line.
    let (a, b) = match angle < 1e-6 {
        true => (1.0 - t, t),
        false => (((1.0 - t) * angle).sin() / angle.sin(), (t * angle).sin() / angle.sin()),
    };
    std::array::from_fn(|k| a * from[k] + sign * b * to[k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angles;

    fn largest_difference(a: &Matrix, b: &Matrix) -> f64 {
        let pairs = a.as_flattened().iter().zip(b.as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn there_and_back() {
        for turn in 0..200 {
            let [z, y, x] = [37, 59, 83].map(|step| f64::from((turn * step) % 361) - 180.0);
            let turn = |axis, angle| angles::rotation(axis, angle);
            let matrix = angles::multiply(&turn(2, z), &angles::multiply(&turn(1, y), &turn(0, x)));
            let quaternion = of_matrix(&matrix);
            assert!((quaternion.iter().map(|part| part * part).sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(largest_difference(&to_matrix(quaternion), &matrix) < 1e-12, "{z} {y} {x}");
        }
    }

    #[test]
    fn a_third_of_the_way() {
        let [from, to] = [10.0, 100.0].map(|angle| of_matrix(&angles::rotation(1, angle)));
        let expected = angles::rotation(1, 40.0);
        assert!(largest_difference(&to_matrix(slerp(&from, &to, 1.0 / 3.0)), &expected) < 1e-12);
        // The same rotation with the other sign.
        let other = to.map(|part| -part);
        assert!(largest_difference(&to_matrix(slerp(&from, &other, 1.0 / 3.0)), &expected) < 1e-12);
        assert_eq!(slerp(&from, &from, 0.5), from);
    }
}

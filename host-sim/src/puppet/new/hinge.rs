//! The axis of a hinge (elbow, knee), measured in a recording.

use mocap::angles::{self, Matrix};

/// The least mean of the sine of a hinge's angle from which its axis is told: a limb that is nearly straight all the
/// time does not show it.
const BENT: f64 = 0.15;

/// The unit vector about which a bone is bent, and by which a bend is positive; nothing if it is hardly ever bent.
///
/// `turns` are the bone's rotations against the one that carries it, and `direction` is where it points in the T-pose.
/// A hinge is at right angles to its bone. So a bone that points along v now was bent about `direction × v`, whatever
/// its twist about itself is (a forearm's pronation). The axis is the mean of these, in which larger bends count more.
pub fn axis(turns: &[Matrix], direction: [f64; 3]) -> Option<[f64; 3]> {
    let mut sum = [0.0; 3];
    for turn in turns {
        let now = angles::apply(turn, direction);
        for (k, sum) in sum.iter_mut().enumerate() {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            *sum += direction[i] * now[j] - direction[j] * now[i];
        }
    }
    let length = sum.iter().map(|part| part * part).sum::<f64>().sqrt();
    (length > BENT * turns.len() as f64).then(|| sum.map(|part| part / length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use mocap::angles::{about, multiply, turned};

    #[test]
    fn a_hinge_is_found_whatever_the_bones_twist_is() {
        let direction = [1.0, 0.0, 0.0];
        let hinge = [0.0, -0.6, 0.8];
        let turns: Vec<Matrix> = (0..60)
            .map(|frame| multiply(&about(hinge, f64::from(frame)), &about(direction, f64::from(frame * 3))))
            .collect();
        let found = axis(&turns, direction).expect("a hinge");
        assert!(found.iter().zip(hinge).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        assert!(turned(&turns[59]) > 100.0);
    }

    #[test]
    fn a_limb_that_is_never_bent_has_none() {
        let turns: Vec<Matrix> = (0..60).map(|frame| about([0.0, 1.0, 0.0], f64::from(frame % 3))).collect();
        assert_eq!(axis(&turns, [1.0, 0.0, 0.0]), None);
        assert_eq!(axis(&[], [1.0, 0.0, 0.0]), None);
    }
}

//! Servos in series that turn a bone as a recording does, as nearly as they can.
//!
//! The rotation of a chain is the product of its joints' turns about their axes in the T-pose. Wanted is first that the
//! bone points where it should, and then the rest of the rotation: the bone's twist. For each frame the angles that are
//! best near a start are found by damped least squares within the ranges (K. Levenberg, 1944; variables at a bound whose
//! gradient leads out of it stay there). Several starts give several solutions. [`Track::best`](crate::track::Track::best) chooses among these over
//! the whole clip, and [`Chain::settle`] then smooths all frames together where the bone's direction leaves a joint free
//! to turn: where a bone is along a joint's axis.

use crate::track::{Candidate, MOST_JOINTS, STILLNESS, Values};
use mocap::angles::{IDENTITY, Matrix, about, apply, multiply};

/// What a difference of the whole rotation counts, beside one of the bone's direction.
///
/// Three joints can do both. With one or two for a bone that twists by 90 degrees more than they can, the direction is
/// off by 0.1 degrees.
const fn twist_weight(joints: usize) -> f64 {
    if joints < MOST_JOINTS { 0.03 } else { 0.3 }
}

/// Solutions that are kept of a frame.
const MOST_SOLUTIONS: usize = 8;

/// Solutions nearer to each other than this, in radians, are one.
const SAME: f64 = 0.01;

/// A bone of two joints that is nearer to the first one's axis than this, in degrees, can be led past it: there the first
/// joint may also be at each of these places, in radians from one to the next, with the second one where it is best.
const NEAR_POLE: f64 = 30.0;
const LEAD: f64 = 0.1;

/// Most steps of a solution, and of the whole clip's.
const MOST_STEPS: usize = 40;
const MOST_SWEEPS: usize = 12;

/// Joints in series that move a bone. Angles are in radians here.
#[derive(Clone, Debug)]
pub struct Chain {
    /// What each joint turns about in the T-pose.
    pub axes: Vec<[f64; 3]>,
    /// Lowest and highest angle of each joint.
    pub ranges: Vec<[f64; 2]>,
    /// Where the bone points in the T-pose.
    pub direction: [f64; 3],
}

/// How far a chain is from where it should be, and how that changes with its angles.
struct Slope {
    /// Half the squared differences.
    cost: f64,
    gradient: Values,
    /// Gauss and Newton's approximation of the second derivatives.
    curvature: [Values; MOST_JOINTS],
}

impl Chain {
    /// The rotation at these angles.
    pub fn rotation(&self, angles: &Values) -> Matrix {
        let turns = self.axes.iter().zip(angles).map(|(axis, angle)| about(*axis, angle.to_degrees()));
        turns.fold(IDENTITY, |before, turn| multiply(&before, &turn))
    }

    /// The angle in degrees between where the bone points at these angles and where it should.
    pub fn off(&self, angles: &Values, wanted: &Matrix) -> f64 {
        let (found, wanted) = (apply(&self.rotation(angles), self.direction), apply(wanted, self.direction));
        let chord = (0..3).map(|k| (found[k] - wanted[k]).powi(2)).sum::<f64>().sqrt();
        2.0 * (chord / 2.0).min(1.0).asin().to_degrees()
    }

    /// The angle in degrees between where the bone should point and the axis of the first joint, whichever way that points.
    pub fn from_first_axis(&self, wanted: &Matrix) -> f64 {
        dot(apply(wanted, self.direction), self.axes[0]).abs().min(1.0).acos().to_degrees()
    }

    /// For each frame what the joints may be, in degrees.
    ///
    /// A frame's solutions are looked for from places all over the ranges, from those of the frame before, and from those
    /// of the frame behind: a way that is only found later in the clip is followed back to where it begins.
    pub fn candidates(&self, wanted: &[Matrix]) -> Vec<Vec<Candidate>> {
        let seeds = self.seeds();
        let mut frames: Vec<Vec<(Values, f64)>> = Vec::with_capacity(wanted.len());
        for wanted in wanted {
            let before = frames.last().into_iter().flatten().map(|(angles, _)| *angles);
            let starts: Vec<Values> = before.chain(seeds.iter().copied()).collect();
            let found = starts.iter().map(|start| self.solve(wanted, start, false));
            let found = best_of(found.collect());
            frames.push(found);
        }
        for frame in (1..frames.len()).rev() {
            let (earlier, later) = frames.split_at_mut(frame);
            let (own, behind) = (&mut earlier[frame - 1], &later[0]);
            let found = behind.iter().map(|(angles, _)| self.solve(&wanted[frame - 1], angles, false));
            let all = own.iter().copied().chain(found).collect();
            *own = best_of(all);
        }
        for (solutions, wanted) in frames.iter_mut().zip(wanted) {
            if self.axes.len() == 2 && self.from_first_axis(wanted) < NEAR_POLE {
                solutions.extend(self.led(wanted, solutions));
            }
        }
        let candidate = |(angles, cost): &(Values, f64)| Candidate {
            values: angles.map(f64::to_degrees),
            cost: 2.0 * cost * 1_f64.to_degrees().powi(2),
        };
        frames.iter().map(|solutions| solutions.iter().map(candidate).collect()).collect()
    }

    /// The ways to be near a rotation with the first of two joints anywhere in its range.
    fn led(&self, wanted: &Matrix, solutions: &[(Values, f64)]) -> Vec<(Values, f64)> {
        let [min, max] = self.ranges[0];
        let places = (((max - min) / LEAD).ceil() as usize).max(1);
        let at = |place: usize| min + (max - min) * place as f64 / places as f64;
        let lead = |place: usize| {
            // The second joint begins where it is in the solution that is nearest.
            let first = at(place);
            let far = |angles: &Values| (angles[0] - first).abs();
            let nearest = solutions.iter().min_by(|(one, _), (other, _)| far(one).total_cmp(&far(other)));
            let mut start = nearest.map_or([0.0; MOST_JOINTS], |(angles, _)| *angles);
            start[0] = first;
            self.solve(wanted, &start, true)
        };
        (0..=places).map(lead).collect()
    }

    /// Places all over the ranges: in the middle of each third, or half where there are three joints.
    fn seeds(&self) -> Vec<Values> {
        let mut seeds = vec![[0.0; MOST_JOINTS]];
        for (joint, [min, max]) in self.ranges.iter().enumerate() {
            let parts: &[f64] =
                if self.axes.len() < MOST_JOINTS { &[1.0 / 6.0, 0.5, 5.0 / 6.0] } else { &[0.25, 0.75] };
            let places: Vec<f64> = parts.iter().map(|part| min + part * (max - min)).collect();
            seeds = seeds
                .into_iter()
                .flat_map(|seed| {
                    places
                        .iter()
                        .map(move |place| {
                            let mut seed = seed;
                            seed[joint] = *place;
                            seed
                        })
                        .collect::<Vec<_>>()
                })
                .collect();
        }
        seeds
    }

    /// The angles near a start at which the chain is nearest to a rotation, and the cost that is left. The first joint may
    /// be held where it is.
    fn solve(&self, wanted: &Matrix, start: &Values, hold_first: bool) -> (Values, f64) {
        let mut angles = self.within(start);
        let mut slope = self.slope(&angles, wanted);
        let mut damping = 1e-4;
        for _ in 0..MOST_STEPS {
            let mut free = self.free(&angles, &slope.gradient);
            free[0] &= !hold_first;
            let mut curvature = slope.curvature;
            (0..MOST_JOINTS).for_each(|k| curvature[k][k] += damping * (slope.curvature[k][k] + 1e-6));
            hold(&mut curvature, &free);
            let wish = std::array::from_fn(|k| if free[k] { -slope.gradient[k] } else { 0.0 });
            let step = solve(&curvature, &wish);
            let next = self.within(&std::array::from_fn(|k| angles[k] + step[k]));
            let moved = (0..MOST_JOINTS).map(|k| (next[k] - angles[k]).abs()).fold(0.0, f64::max);
            if moved < 1e-9 {
                break;
            }
            let there = self.slope(&next, wanted);
            if there.cost < slope.cost {
                (angles, slope) = (next, there);
                damping = (damping / 8.0).max(1e-9);
            } else {
                damping *= 8.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
        (angles, slope.cost)
    }

    /// Smooths a way through all frames, in degrees, by what [`Track::best`](crate::track::Track::best) judges: errors, steps,
    /// and steps that a joint with these highest speeds, in degrees a second, cannot make in a frame.
    ///
    /// Gauss and Newton's method on all frames at once: the normal equations are block tridiagonal. A frame costs about
    /// 1 µs a step.
    pub fn settle(&self, way: &mut [Values], wanted: &[Matrix], fps: f64, max_speed: &Values) {
        let most: Values = max_speed.map(|speed| (speed / fps).to_radians());
        let stillness = STILLNESS * fps * fps;
        // What the square of a step counts, and half its slope beside the step.
        let late = |step: f64, most: f64| if step > most { (step / most - 1.0) / 3.0 } else { 0.0 };
        let price = |step: f64, most: f64| stillness + late(step, most);
        let slope_of = |step: f64, most: f64| {
            stillness + if step > most { (1.5 * step / most - 1.0) / 3.0 } else { 0.0 }
        };
        let mut angles: Vec<Values> = way.iter().map(|values| values.map(f64::to_radians)).collect();
        let cost = |angles: &[Values], slopes: &[Slope]| {
            let steps = angles
                .windows(2)
                .flat_map(|pair| (0..MOST_JOINTS).map(|k| ((pair[1][k] - pair[0][k]).abs(), most[k])));
            let steps = steps.map(|(step, most)| step * step * price(step, most));
            slopes.iter().map(|slope| slope.cost).sum::<f64>() + steps.sum::<f64>() / 2.0
        };
        let slopes = |angles: &[Values]| -> Vec<Slope> {
            angles.iter().zip(wanted).map(|(angles, wanted)| self.slope(angles, wanted)).collect()
        };
        let mut here = slopes(&angles);
        let mut damping = 1e-6;
        for _ in 0..MOST_SWEEPS {
            let bonds: Vec<Values> = angles
                .windows(2)
                .map(|pair| std::array::from_fn(|k| slope_of((pair[1][k] - pair[0][k]).abs(), most[k])))
                .collect();
            let step = self.step_of_all(&angles, &here, &bonds, damping);
            let next: Vec<Values> = angles
                .iter()
                .zip(&step)
                .map(|(angles, step)| self.within(&std::array::from_fn(|k| angles[k] + step[k])))
                .collect();
            let there = slopes(&next);
            let (before, after) = (cost(&angles, &here), cost(&next, &there));
            if after < before {
                (angles, here) = (next, there);
                damping = (damping / 8.0).max(1e-9);
                if before - after < 1e-9 * before {
                    break;
                }
            } else {
                damping = f64::max(damping * 64.0, 1e-3);
            }
        }
        for (values, angles) in way.iter_mut().zip(angles) {
            *values = angles.map(f64::to_degrees);
        }
    }

    /// One step of Gauss and Newton's method for all frames, by elimination from the first to the last. `bonds` say how much
    /// each joint's step from a frame to the next counts.
    fn step_of_all(
        &self,
        angles: &[Values],
        slopes: &[Slope],
        bonds: &[Values],
        damping: f64,
    ) -> Vec<Values> {
        let none = [0.0; MOST_JOINTS];
        // Of each frame: the inverse of its block after elimination, times what couples it to the next, and the wish.
        let mut eliminated: Vec<([Values; MOST_JOINTS], Values)> = Vec::with_capacity(angles.len());
        let mut held: Vec<[bool; MOST_JOINTS]> = Vec::with_capacity(angles.len());
        for (frame, slope) in slopes.iter().enumerate() {
            let mut gradient = slope.gradient;
            let mut block = slope.curvature;
            let before = frame.checked_sub(1).map(|before| (before, bonds[before]));
            let behind = bonds.get(frame).map(|bond| (frame + 1, *bond));
            let onward = behind.map_or(none, |(_, bond)| bond);
            for k in 0..MOST_JOINTS {
                block[k][k] += damping;
                for (other, bond) in [before, behind].into_iter().flatten() {
                    gradient[k] += bond[k] * (angles[frame][k] - angles[other][k]);
                    block[k][k] += bond[k];
                }
            }
            let back = before.map_or(none, |(_, bond)| bond);
            let free = self.free(&angles[frame], &gradient);
            hold(&mut block, &free);
            let mut wish: Values = std::array::from_fn(|k| if free[k] { -gradient[k] } else { 0.0 });
            if let (Some((coupled, before)), Some(earlier)) = (eliminated.last(), held.last()) {
                for k in (0..MOST_JOINTS).filter(|&k| free[k] && earlier[k]) {
                    wish[k] += back[k] * before[k];
                    for j in (0..MOST_JOINTS).filter(|&j| free[j]) {
                        block[k][j] -= back[k] * coupled[k][j];
                    }
                }
            }
            let columns: [Values; MOST_JOINTS] = std::array::from_fn(|j| {
                let unit = std::array::from_fn(|k| if k == j && free[j] { onward[j] } else { 0.0 });
                solve(&block, &unit)
            });
            let coupled = std::array::from_fn(|k| std::array::from_fn(|j| columns[j][k]));
            eliminated.push((coupled, solve(&block, &wish)));
            held.push(free);
        }
        let mut steps = vec![[0.0; MOST_JOINTS]; angles.len()];
        let mut next = [0.0; MOST_JOINTS];
        for (frame, (coupled, wish)) in eliminated.iter().enumerate().rev() {
            next = std::array::from_fn(|k| {
                wish[k] + (0..MOST_JOINTS).map(|j| coupled[k][j] * next[j]).sum::<f64>()
            });
            steps[frame] = next;
        }
        steps
    }

    fn slope(&self, angles: &Values, wanted: &Matrix) -> Slope {
        // The axes as the joints before have turned them, and the rotation of all.
        let mut rotation = IDENTITY;
        let mut axes = [[0.0; 3]; MOST_JOINTS];
        for ((axis, angle), turned) in self.axes.iter().zip(angles).zip(&mut axes) {
            *turned = apply(&rotation, *axis);
            rotation = multiply(&rotation, &about(*axis, angle.to_degrees()));
        }
        // Four vectors that the rotation moves, and where they should be: the bone, and the three axes of the figure.
        let (mut cost, mut gradient, mut curvature) =
            (0.0, [0.0; MOST_JOINTS], [[0.0; MOST_JOINTS]; MOST_JOINTS]);
        let column = |matrix: &Matrix, k: usize| [matrix[0][k], matrix[1][k], matrix[2][k]];
        let mut see = |found: [f64; 3], wanted: [f64; 3], weight: f64| {
            let off = [found[0] - wanted[0], found[1] - wanted[1], found[2] - wanted[2]];
            cost += weight / 2.0 * dot(off, off);
            let moves = axes.map(|axis| cross(axis, found));
            for (k, one) in moves.iter().enumerate() {
                gradient[k] += weight * dot(*one, off);
                for (j, other) in moves.iter().enumerate() {
                    curvature[k][j] += weight * dot(*one, *other);
                }
            }
        };
        see(apply(&rotation, self.direction), apply(wanted, self.direction), 1.0);
        let twist = twist_weight(self.axes.len());
        for k in 0..3 {
            see(column(&rotation, k), column(wanted, k), twist * twist / 2.0);
        }
        Slope { cost, gradient, curvature }
    }

    fn within(&self, angles: &Values) -> Values {
        std::array::from_fn(|k| self.ranges.get(k).map_or(0.0, |[min, max]| angles[k].clamp(*min, *max)))
    }

    /// Which angles may move: those that are not at an end of their range beyond which the cost would be less.
    fn free(&self, angles: &Values, gradient: &Values) -> [bool; MOST_JOINTS] {
        std::array::from_fn(|k| {
            self.ranges.get(k).is_some_and(|[min, max]| {
                !(angles[k] <= *min && gradient[k] > 0.0 || angles[k] >= *max && gradient[k] < 0.0)
            })
        })
    }
}

/// Makes the equations of variables that are held say that they do not move.
fn hold(block: &mut [Values; MOST_JOINTS], free: &[bool; MOST_JOINTS]) {
    for (k, row) in block.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            if !(free[k] && free[j]) {
                *entry = f64::from(u8::from(k == j));
            }
        }
    }
}

/// The best of the solutions of a frame, the cheapest first; of those that are the same the first one.
fn best_of(mut found: Vec<(Values, f64)>) -> Vec<(Values, f64)> {
    let cheapest = found.iter().map(|(_, cost)| *cost).fold(f64::INFINITY, f64::min);
    found.retain(|(_, cost)| cost - cheapest < 1.0);
    let mut solutions: Vec<(Values, f64)> = Vec::new();
    for (angles, cost) in found {
        let is_same =
            |(other, _): &(Values, f64)| (0..MOST_JOINTS).all(|k| (other[k] - angles[k]).abs() < SAME);
        if !solutions.iter().any(is_same) {
            solutions.push((angles, cost));
        }
    }
    solutions.sort_by(|(_, one), (_, other)| one.total_cmp(other));
    solutions.truncate(MOST_SOLUTIONS);
    solutions
}

/// The solution of three equations, by Gauss' elimination with the largest pivot of a column. A variable that the
/// equations do not determine is 0.
fn solve(matrix: &[Values; MOST_JOINTS], wish: &Values) -> Values {
    let mut rows: [[f64; MOST_JOINTS + 1]; MOST_JOINTS] =
        std::array::from_fn(|k| [matrix[k][0], matrix[k][1], matrix[k][2], wish[k]]);
    for k in 0..MOST_JOINTS {
        let pivot =
            (k..MOST_JOINTS).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs())).unwrap_or(k);
        rows.swap(k, pivot);
        if rows[k][k].abs() < 1e-15 {
            continue;
        }
        for below in k + 1..MOST_JOINTS {
            let factor = rows[below][k] / rows[k][k];
            (k..=MOST_JOINTS).for_each(|j| rows[below][j] -= factor * rows[k][j]);
        }
    }
    let mut found = [0.0; MOST_JOINTS];
    for k in (0..MOST_JOINTS).rev() {
        let known: f64 = (k + 1..MOST_JOINTS).map(|j| rows[k][j] * found[j]).sum();
        found[k] = if rows[k][k].abs() < 1e-15 { 0.0 } else { (rows[k][MOST_JOINTS] - known) / rows[k][k] };
    }
    found
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::Track;
    use mocap::angles::turned;

    const X: [f64; 3] = [1.0, 0.0, 0.0];
    const Y: [f64; 3] = [0.0, 1.0, 0.0];
    const Z: [f64; 3] = [0.0, 0.0, 1.0];

    fn chain(axes: &[[f64; 3]], range: [f64; 2], direction: [f64; 3]) -> Chain {
        Chain { axes: axes.to_vec(), ranges: vec![range.map(f64::to_radians); axes.len()], direction }
    }

    /// The way through a path, and how far each frame is off.
    fn follow(chain: &Chain, wanted: &[Matrix]) -> (Vec<Values>, Vec<f64>) {
        let track = Track { fps: 60.0, max_speed: [400.0; MOST_JOINTS] };
        let mut way = track.best(&chain.candidates(wanted)).0;
        chain.settle(&mut way, wanted, 60.0, &[400.0; MOST_JOINTS]);
        let off =
            way.iter().zip(wanted).map(|(values, wanted)| chain.off(&values.map(f64::to_radians), wanted));
        let off = off.collect();
        (way, off)
    }

    fn most(values: &[f64]) -> f64 {
        values.iter().copied().fold(0.0, f64::max)
    }

    fn longest_step(way: &[Values]) -> f64 {
        let step =
            |pair: &[Values]| (0..MOST_JOINTS).map(|k| (pair[1][k] - pair[0][k]).abs()).fold(0.0, f64::max);
        way.windows(2).map(step).fold(0.0, f64::max)
    }

    #[test]
    fn three_joints_do_any_rotation_and_two_any_direction() {
        let path: Vec<Matrix> = (0..300)
            .map(|frame| {
                let time = f64::from(frame) / 60.0;
                let swing = about(Z, 50.0 + 40.0 * (2.0 * time).sin());
                multiply(
                    &multiply(&about(Y, 70.0 * time.cos()), &swing),
                    &about(X, 60.0 * (1.5 * time).sin()),
                )
            })
            .collect();
        let three = chain(&[Y, Z, X], [-170.0, 170.0], [-1.0, 0.0, 0.0]);
        let (way, off) = follow(&three, &path);
        assert!(most(&off) < 0.1, "{}", most(&off));
        assert!(longest_step(&way) < 5.0, "{}", longest_step(&way));
        let rest = way.iter().zip(&path).map(|(values, wanted)| {
            let found = three.rotation(&values.map(f64::to_radians));
            turned(&multiply(&mocap::angles::transpose(wanted), &found))
        });
        assert!(most(&rest.collect::<Vec<_>>()) < 1.0);
        let (way, off) = follow(&chain(&[Y, Z], [-170.0, 170.0], [-1.0, 0.0, 0.0]), &path);
        // The path comes to the axis of the first joint, where the twist that is missing counts as well.
        assert!(most(&off) < 1.5, "{}", most(&off));
        assert!(longest_step(&way) < 10.0, "{}", longest_step(&way));
    }

    /// A bone that goes through the axis of the first joint: straight over it, and near past it.
    #[test]
    fn poles_are_passed_smoothly() {
        for aside in [0.0, 0.2, 2.0] {
            let sweep = |frame: i32| multiply(&about(Z, aside), &about(Y, f64::from(frame) - 45.0));
            let path: Vec<Matrix> = (0..90).map(sweep).collect();
            // The arm points along x, and so does the first axis.
            let arm = chain(&[X, Y], [-120.0, 120.0], X);
            let (way, off) = follow(&arm, &path);
            assert!(most(&off) < 2.5, "{aside}: {}", most(&off));
            assert!(longest_step(&way) < 20.0, "{aside}: {}", longest_step(&way));
            let ends = [way[0], way[89]];
            assert!(ends.iter().all(|values| values[0].abs() < 15.0), "{aside}: {ends:?}");
        }
    }

    /// A bone that comes near the axis of the first joint and leaves on the other side, where the second joint cannot bend
    /// the other way: the first one has to turn by half a turn meanwhile, and begins before it must.
    #[test]
    fn a_joint_turns_early_where_a_pole_is_near() {
        let sweep = |frame: i32| {
            let along = f64::from(frame) - 60.0;
            let (side, apart) = (if along < 0.0 { 80.0 } else { -100.0 }, 5.0 + along.abs());
            multiply(&about(X, side), &about(Y, apart))
        };
        let path: Vec<Matrix> = (0..120).map(sweep).collect();
        let ranges = [[-120.0, 120.0], [0.0, 90.0]].map(|range| range.map(f64::to_radians));
        let arm = Chain { ranges: ranges.to_vec(), ..chain(&[X, Y], [0.0; 2], X) };
        let (way, off) = follow(&arm, &path);
        // At 400 degrees a second a frame has 6.7 of them, and all at once would be 180.
        assert!(longest_step(&way) < 45.0, "{}", longest_step(&way));
        assert!(most(&off) < 20.0, "{}", most(&off));
        assert!(off[..30].iter().chain(&off[90..]).all(|off| *off < 0.5), "{off:?}");
    }

    #[test]
    fn within_its_ranges_a_chain_does_what_it_can() {
        let path: Vec<Matrix> = (0..120).map(|frame| about(Z, f64::from(frame))).collect();
        let lift = chain(&[Z], [-10.0, 60.0], X);
        let (way, off) = follow(&lift, &path);
        for (frame, (values, off)) in way.iter().zip(&off).enumerate() {
            let wanted = (frame as f64).min(60.0);
            assert!((values[0] - wanted).abs() < 0.2, "frame {frame}: {values:?}");
            assert!((off - (frame as f64 - wanted)).abs() < 0.2, "frame {frame}: {off}");
        }
        // The other solution, where the first does not reach.
        let path: Vec<Matrix> = (0..60).map(|frame| about(Y, 20.0 + f64::from(frame) / 2.0)).collect();
        let head =
            Chain { ranges: vec![[90_f64, 270.0].map(f64::to_radians); 2], ..chain(&[Z, Y], [0.0; 2], X) };
        let (way, off) = follow(&head, &path);
        assert!(most(&off) < 0.5, "{} {:?}", most(&off), way[0]);
    }
}

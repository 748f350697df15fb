//! Brings a joint's way within its speed and its acceleration, without delay.
//!
//! Of all ways within the limits the one that is nearest to the given one, by the sum of squared differences: a quadratic
//! program, solved by alternating directions (ADMM: S. Boyd et al., 2011; B. Stellato et al., "OSQP", 2020). It looks
//! ahead as far as back, so that a movement begins earlier instead of ending later. A puppet is at rest before a clip and
//! after it: the way begins and ends such that it can get going and stop. Costs about 30 ns a frame and round.

/// Limits of a joint, in its unit.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Lowest and highest value.
    pub range: [f64; 2],
    /// Highest speed, a second.
    pub speed: f64,
    /// Highest acceleration, a second squared.
    pub acceleration: f64,
}

/// Part of the speed that is used: a cubic curve through the frames is faster between them.
const SPEED_PART: f64 = 0.85;

/// Part of the acceleration that is used. At a frame where second differences go from a to -a, a Catmull-Rom curve has
/// the acceleration 2a + a.
const ACCELERATION_PART: f64 = 1.0 / 3.0;

/// Rounds at most, and how often the weight of the limits is set anew.
const MOST_ROUNDS: usize = 3000;
const ROUNDS_A_WEIGHT: usize = 100;

/// Part of a limit that a way may be above it.
const NEAR: f64 = 0.01;

/// The nearest way within the limits, to a hundredth of each; `values` at `fps` frames a second.
pub fn within(values: &[f64], fps: f64, limits: &Limits) -> Vec<f64> {
    let (speed, acceleration) =
        (SPEED_PART * limits.speed / fps, ACCELERATION_PART * limits.acceleration / (fps * fps));
    let bound = |order: usize, value: f64| match order {
        0 => value.clamp(limits.range[0], limits.range[1]),
        1 => value.clamp(-speed, speed),
        _ => value.clamp(-acceleration, acceleration),
    };
    let most = [f64::INFINITY, speed, acceleration];
    let fits = |values: &[f64]| {
        (0..3).all(|order| {
            let near = if order == 0 { 1e-3 } else { NEAR * most[order] };
            terms(values, order).into_iter().all(|value| (value - bound(order, value)).abs() <= near)
        })
    };
    if values.len() < 3 || fits(values) {
        return values.to_vec();
    }
    // A limit counts by the time within which it bends a way: 0.1 seconds.
    let reach = (fps / 10.0).max(3.0);
    let scale = [1.0, reach.powi(2), reach.powi(4)];
    let mut weight = 1.0;
    let mut way = values.to_vec();
    let mut split: Vec<Vec<f64>> = (0..3).map(|order| terms(&way, order)).collect();
    let mut prices: Vec<Vec<f64>> = split.iter().map(|values| vec![0.0; values.len()]).collect();
    let mut system = System::new(values.len(), scale.map(|scale| scale * weight));
    for round in 1..=MOST_ROUNDS {
        // The way that is nearest to the given one and to what the limits let through.
        let mut wish = values.to_vec();
        for order in 0..3 {
            let part = split[order]
                .iter()
                .zip(&prices[order])
                .map(|(split, price)| scale[order] * weight * (split - price));
            add_back(&mut wish, &part.collect::<Vec<_>>(), order);
        }
        way = system.solve(wish);
        let (mut apart, mut moved) = (0.0_f64, 0.0_f64);
        for order in 0..3 {
            for ((value, split), price) in
                terms(&way, order).into_iter().zip(&mut split[order]).zip(&mut prices[order])
            {
                let before = *split;
                *split = bound(order, value + *price);
                *price += value - *split;
                let root = scale[order].sqrt();
                apart = apart.max(root * (value - *split).abs());
                moved = moved.max(root * (*split - before).abs());
            }
        }
        if round % 10 == 0 && fits(&way) && moved * weight < 0.01 {
            break;
        }
        if round % ROUNDS_A_WEIGHT == 0 && (apart > 5.0 * moved || moved > 5.0 * apart) {
            let change = (apart / moved.max(1e-12)).sqrt().clamp(0.1, 10.0);
            weight *= change;
            prices.iter_mut().flatten().for_each(|price| *price /= change);
            system = System::new(values.len(), scale.map(|scale| scale * weight));
        }
    }
    way.into_iter().map(|value| bound(0, value)).collect()
}

/// The values, their differences from frame to frame, or the differences of these.
pub fn differences(values: &[f64], order: usize) -> Vec<f64> {
    match order {
        0 => values.to_vec(),
        1 => values.windows(2).map(|pair| pair[1] - pair[0]).collect(),
        _ => values.windows(3).map(|three| three[2] - 2.0 * three[1] + three[0]).collect(),
    }
}

/// What is limited: the [`differences`], and of those of the second order two more, from rest and to rest.
fn terms(values: &[f64], order: usize) -> Vec<f64> {
    stencils(values.len(), order)
        .map(|(start, factors)| {
            factors.iter().zip(&values[start..]).map(|(factor, value)| factor * value).sum()
        })
        .collect()
}

/// For each of the [`terms`] of so many values the first of its values, and their factors.
fn stencils(length: usize, order: usize) -> impl Iterator<Item = (usize, &'static [f64])> {
    let factors: &[f64] = [&[1.0][..], &[-1.0, 1.0], &[1.0, -2.0, 1.0]][order];
    let ends: [(usize, &[f64]); 2] = [(0, &[-1.0, 1.0]), (length - 2, &[1.0, -1.0])];
    let ends = ends.into_iter().filter(move |_| order == 2);
    (0..length - order).map(move |start| (start, factors)).chain(ends)
}

/// The transpose of [`terms`]: adds what each wishes to its values.
fn add_back(values: &mut [f64], part: &[f64], order: usize) {
    for (part, (start, factors)) in part.iter().zip(stencils(values.len(), order)) {
        for (value, factor) in values[start..].iter_mut().zip(factors) {
            *value += factor * part;
        }
    }
}

/// Normal equations with two diagonals beside the main one, as their Cholesky factor.
struct System {
    /// For each row: the factor's entries two and one to the left, and the inverse of the one on the diagonal.
    rows: Vec<[f64; 3]>,
}

impl System {
    /// Of the identity and the weighted squares of the three orders of [`terms`].
    fn new(length: usize, weights: [f64; 3]) -> Self {
        // Entries two and one to the left of the diagonal, and on it.
        let mut matrix = vec![[0.0, 0.0, 1.0]; length];
        for (order, weight) in weights.into_iter().enumerate() {
            for (start, factors) in stencils(length, order) {
                for row in 0..factors.len() {
                    for column in 0..=row {
                        matrix[start + row][2 + column - row] += weight * factors[row] * factors[column];
                    }
                }
            }
        }
        let mut rows: Vec<[f64; 3]> = Vec::with_capacity(length);
        for (index, [far, near, own]) in matrix.into_iter().enumerate() {
            let before = |back: usize| index.checked_sub(back).map_or([0.0; 3], |index| rows[index]);
            let (one, two) = (before(1), before(2));
            let far = far * two[2];
            let near = (near - far * one[1]) * one[2];
            rows.push([far, near, 1.0 / (own - far * far - near * near).sqrt()]);
        }
        Self { rows }
    }

    fn solve(&self, mut wish: Vec<f64>) -> Vec<f64> {
        for index in 0..wish.len() {
            let [far, near, inverse] = self.rows[index];
            let mut value = wish[index];
            if index >= 1 {
                value -= near * wish[index - 1];
            }
            if index >= 2 {
                value -= far * wish[index - 2];
            }
            wish[index] = value * inverse;
        }
        for index in (0..wish.len()).rev() {
            let mut value = wish[index];
            if let Some(row) = self.rows.get(index + 1) {
                value -= row[1] * wish[index + 1];
            }
            if let Some(row) = self.rows.get(index + 2) {
                value -= row[0] * wish[index + 2];
            }
            wish[index] = value * self.rows[index][2];
        }
        wish
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { range: [-100.0, 100.0], speed: 250.0, acceleration: 5000.0 };

    #[test]
    fn the_factor_solves_its_equations() {
        let weights = [0.5, 20.0, 300.0];
        let truth: Vec<f64> = (0..20).map(|frame| f64::from(frame * frame % 7)).collect();
        let mut product = truth.clone();
        for (order, weight) in weights.into_iter().enumerate() {
            let part: Vec<f64> = terms(&truth, order).iter().map(|value| value * weight).collect();
            add_back(&mut product, &part, order);
        }
        let found = System::new(20, weights).solve(product);
        assert!(found.iter().zip(&truth).all(|(found, truth)| (found - truth).abs() < 1e-9), "{found:?}");
    }

    #[test]
    fn a_step_becomes_a_ramp_that_begins_before_it() {
        for fps in [30.0, 60.0, 120.0] {
            let frames = (2.0 * fps) as usize;
            let step: Vec<f64> =
                (0..frames).map(|frame| if frame < frames / 2 { -80.0 } else { 80.0 }).collect();
            let found = within(&step, fps, &LIMITS);
            let most =
                |order: usize| differences(&found, order).into_iter().map(f64::abs).fold(0.0, f64::max);
            assert!(most(1) * fps <= 250.0, "{} at {fps}", most(1) * fps);
            assert!(most(2) * fps * fps <= 5000.0 * 0.34, "{} at {fps}", most(2) * fps * fps);
            // As late as early, and where it is slow enough as it was.
            let middle = (found[frames / 2 - 1] + found[frames / 2]) / 2.0;
            assert!(middle.abs() < 1.0, "{middle}");
            assert!((found[0] + 80.0).abs() < 0.1 && (found[frames - 1] - 80.0).abs() < 0.1, "{found:?}");
        }
    }

    #[test]
    fn what_is_slow_stays_as_it_is() {
        let slow: Vec<f64> = (0..200).map(|frame| 10.0 * (f64::from(frame) / 30.0).sin()).collect();
        assert_eq!(within(&slow, 60.0, &LIMITS), slow);
    }

    /// A clip that is cut out of a movement: 200 degrees a second from its first frame to its last.
    #[test]
    fn a_clip_begins_and_ends_at_rest() {
        let sweep: Vec<f64> = (0..50).map(|frame| 200.0 / 60.0 * f64::from(frame) - 80.0).collect();
        let found = within(&sweep, 60.0, &LIMITS);
        let steps = differences(&found, 1);
        let most = 1.01 * ACCELERATION_PART * LIMITS.acceleration / 3600.0;
        assert!(steps[0] <= most && steps[48] <= most, "{steps:?}");
        assert!(differences(&found, 2).iter().all(|step| step.abs() <= most), "{steps:?}");
        // In its middle it is what it was.
        assert!((found[25] - sweep[25]).abs() < 0.05, "{} {}", found[25], sweep[25]);
    }
}

//! The way of a few joints through a clip, where each frame leaves a choice.
//!
//! A pose often has several values of a joint: whole turns more or less, the other solution of a chain. [`Track::best`]
//! takes for each frame one of the candidates, such that errors and steps together cost least over the whole clip. That
//! is dynamic programming (A. Viterbi, 1967): frames times candidates squared.

/// Most joints that are looked at together.
pub const MOST_JOINTS: usize = 3;

/// The values of up to [`MOST_JOINTS`] joints; what is not used is 0.
pub type Values = [f64; MOST_JOINTS];

/// Seconds squared: what a speed of 1 degree a second costs, beside an error of 1 degree.
///
/// One that moves by 3000 degrees a second squared is so off by 0.006 degrees, and one that is free to turn does not.
pub const STILLNESS: f64 = 2e-6;

/// What the joints may be in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Values within the joints' ranges.
    pub values: Values,
    /// Error that is left, in degrees squared.
    pub cost: f64,
}

/// How a way is judged.
#[derive(Clone, Copy, Debug)]
pub struct Track {
    /// Frames per second.
    pub fps: f64,
    /// Highest speeds, in degrees a second.
    pub max_speed: Values,
}

impl Track {
    /// The best way through the candidates of all frames, and what it costs.
    ///
    /// # Panics
    /// If a frame has no candidate.
    pub fn best(&self, frames: &[Vec<Candidate>]) -> (Vec<Values>, f64) {
        let Some((first, rest)) = frames.split_first() else { return (Vec::new(), 0.0) };
        let mut costs: Vec<f64> = first.iter().map(|candidate| candidate.cost).collect();
        let mut from: Vec<Vec<usize>> = Vec::with_capacity(rest.len());
        for (earlier, frame) in frames.iter().zip(rest) {
            let mut origins = Vec::with_capacity(frame.len());
            let mut next = Vec::with_capacity(frame.len());
            for candidate in frame {
                let total =
                    |origin: usize| costs[origin] + self.step(&earlier[origin].values, &candidate.values);
                let best = (0..earlier.len()).min_by(|&a, &b| total(a).total_cmp(&total(b)));
                let best = best.expect("a frame has a candidate");
                origins.push(best);
                next.push(total(best) + candidate.cost);
            }
            from.push(origins);
            costs = next;
        }
        let last = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b]));
        let mut at = last.expect("a frame has a candidate");
        let cost = costs[at];
        let mut way = vec![frames[rest.len()][at].values];
        for (origins, frame) in from.iter().zip(frames).rev() {
            at = origins[at];
            way.push(frame[at].values);
        }
        way.reverse();
        (way, cost)
    }

    /// What it costs to go from one frame's values to those of the next.
    ///
    /// A step that the joint cannot make within a frame costs what the joint is off while it is on its way: a third of
    /// the squared step for each of these frames.
    fn step(&self, from: &Values, to: &Values) -> f64 {
        let of_joint = |joint: usize| {
            let step = (to[joint] - from[joint]).abs();
            let most = self.max_speed[joint] / self.fps;
            let late = if step > most { step / most - 1.0 } else { 0.0 };
            step * step * (STILLNESS * self.fps * self.fps + late / 3.0)
        };
        (0..MOST_JOINTS).map(of_joint).sum()
    }
}

/// The values that differ from `value` by whole periods and are in the range or next to it, within the range, and each
/// with the square of how far it was out of range, times `weight`.
pub fn turned(value: f64, period: Option<f64>, [min, max]: [f64; 2], weight: f64) -> Vec<Candidate> {
    let candidate = |value: f64| {
        let within = value.clamp(min, max);
        Candidate { values: [within, 0.0, 0.0], cost: weight * (value - within).powi(2) }
    };
    let Some(period) = period else { return vec![candidate(value)] };
    // From the last one below the range to the first one above.
    let (first, last) =
        (((min - value) / period).ceil() as i64 - 1, ((max - value) / period).floor() as i64 + 1);
    (first..=last).map(|turns| candidate(turns as f64 * period + value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(values: impl Iterator<Item = f64>, range: [f64; 2]) -> Vec<f64> {
        let frames: Vec<_> = values.map(|value| turned(value, Some(360.0), range, 1.0)).collect();
        let way = Track { fps: 60.0, max_speed: [300.0; 3] }.best(&frames).0;
        way.into_iter().map(|values| values[0]).collect()
    }

    #[test]
    fn whole_turns_are_chosen_by_what_the_joint_can_reach() {
        for shift in [-720.0, 0.0, 360.0] {
            let swing = |frame: i32| 20.0 * (f64::from(frame) / 10.0).sin();
            let found = track((0..100).map(|frame| swing(frame) + shift), [-90.0, 90.0]);
            assert!(found.iter().zip(0..).all(|(found, frame)| (found - swing(frame)).abs() < 1e-9));
        }
        // Zero of the range far from zero.
        assert!(track((0..9).map(f64::from), [300.0, 400.0]).iter().all(|found| *found >= 360.0));
    }

    #[test]
    fn one_that_turns_on_and_on_winds_back_once_a_turn_and_then_is_where_the_pose_is() {
        // A turn in two seconds, three times, and then rest at 3 * 360 + 10.
        let angle = |frame: i32| if frame < 360 { f64::from(frame) * 3.0 } else { 1090.0 };
        let found = track((0..700).map(angle), [-180.0, 180.0]);
        assert!(found[400..].iter().all(|found| (found - 10.0).abs() < 1e-9), "{:?}", &found[400..]);
        let jumps = found.windows(2).filter(|pair| (pair[1] - pair[0]).abs() > 100.0).count();
        assert!((2..=3).contains(&jumps), "{jumps}");
        // Where it cannot go, it stays at the near end and does not hop from one end to the other.
        let found = track((0..120).map(|frame| 60.0 + f64::from(frame)), [-90.0, 90.0]);
        assert!(found[40..].iter().all(|found| *found == 90.0 || *found == -90.0));
        assert!(found.windows(2).filter(|pair| pair[0] > 0.0 && pair[1] < 0.0).count() <= 1);
    }
}

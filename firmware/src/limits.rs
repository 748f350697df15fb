//! What stands between a decoded pose and the bus: range and speed.

/// What a servo may be told, in goal units (for Dynamixel X, 4096 a turn).
///
/// `min ≤ max` and `max_step ≥ 1`, all within ±[`GOAL_LIMIT`](crate::map::GOAL_LIMIT); the joint map checks that.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Lowest goal.
    pub min: i32,
    /// Highest goal.
    pub max: i32,
    /// Largest change from one tick to the next.
    pub max_step: i32,
}

impl Limits {
    /// The goal to send for a wanted one, after `last` was sent: inside the range, and at most a step from `last`.
    ///
    /// `last` is inside the range, so the result is as well. Any `wanted` is allowed.
    pub const fn apply(&self, wanted: i32, last: i32) -> i32 {
        clamp(clamp(wanted, self.min, self.max), last - self.max_step, last + self.max_step)
    }
}

/// `Ord::clamp` without its panic, and const.
const fn clamp(value: i32, low: i32, high: i32) -> i32 {
    if value < low {
        low
    } else if value > high {
        high
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::GOAL_LIMIT;
    use proptest::prelude::*;

    #[test]
    fn range_and_step_both_hold() {
        let limits = Limits { min: 1000, max: 3000, max_step: 50 };
        assert_eq!(limits.apply(2048, 2040), 2048);
        assert_eq!(limits.apply(4000, 2048), 2098);
        assert_eq!(limits.apply(4000, 2990), 3000);
        assert_eq!(limits.apply(i32::MIN, 1010), 1000);
        assert_eq!(limits.apply(i32::MIN, 3000), 2950);
    }

    proptest! {
        #[test]
        fn no_goal_leaves_the_range_or_jumps(
            wanted: i32,
            ends in (-GOAL_LIMIT..=GOAL_LIMIT, -GOAL_LIMIT..=GOAL_LIMIT),
            last in -GOAL_LIMIT..=GOAL_LIMIT,
            max_step in 1..=GOAL_LIMIT,
        ) {
            let (min, max) = (ends.0.min(ends.1), ends.0.max(ends.1));
            let last = last.clamp(min, max);
            let goal = Limits { min, max, max_step }.apply(wanted, last);
            prop_assert!((min..=max).contains(&goal));
            prop_assert!((i64::from(goal) - i64::from(last)).abs() <= i64::from(max_step));
            // It goes towards what was wanted, never past it.
            let towards = i64::from(wanted.clamp(min, max)) - i64::from(last);
            let went = i64::from(goal) - i64::from(last);
            prop_assert!(went.signum() == towards.signum() && went.abs() <= towards.abs());
        }
    }
}

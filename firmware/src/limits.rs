//! What stands between a wanted pose and the bus: range, velocity and acceleration.
//!
//! Positions here are *fine*: in 1/1024 of a goal unit ([`FINE_BITS`]), so that a slow movement at a thousand ticks a
//! second still has steps. Velocities are fine positions a tick, accelerations fine positions a tick and tick.

/// Bits of a fine position below the goal unit.
pub const FINE_BITS: u32 = 10;

/// What a servo may be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Lowest and highest goal, fine.
    min: i32,
    max: i32,
    max_velocity: i32,
    max_acceleration: i32,
    /// From where to where the highest velocity can be braked inside the range.
    clear: (i32, i32),
}

impl Limits {
    /// Goals from `min` to `max` in goal units, within ±[`GOAL_LIMIT`](crate::map::GOAL_LIMIT); fine, the largest change of a goal
    /// from one tick to the next, and that of this change, from 1 to [`MAX_VELOCITY`]. The joint map checks that.
    pub const fn new(min: i32, max: i32, max_velocity: i32, max_acceleration: i32) -> Self {
        let (min, max) = (min << FINE_BITS, max << FINE_BITS);
        // At least 2, by the joint map.
        let double_change = match (max_acceleration.unsigned_abs() as u64).wrapping_mul(2) {
            0 => 2,
            change => change,
        };
        let way = brake_way(max_velocity, max_acceleration).div_ceil(double_change);
        let way = if way > i32::MAX as u64 { i32::MAX } else { way as i32 };
        let clear = (min.saturating_add(way), max.saturating_sub(way));
        Self { min, max, max_velocity, max_acceleration, clear }
    }

    /// Lowest goal, fine.
    pub const fn min(&self) -> i32 {
        self.min
    }

    /// Highest goal, fine.
    pub const fn max(&self) -> i32 {
        self.max
    }

    /// Largest change of a goal from one tick to the next, fine.
    pub const fn max_velocity(&self) -> i32 {
        self.max_velocity
    }
}

/// What braking from `velocity` takes at most, the tick at that speed included, times twice `change`: a parabola and
/// an eighth of `change`.
const fn brake_way(velocity: i32, change: i32) -> u64 {
    let (speed, change) = (velocity.unsigned_abs() as u64, change.unsigned_abs() as u64);
    speed.wrapping_mul(speed.wrapping_add(change)).wrapping_add(change.wrapping_mul(change) >> 2)
}

/// Largest velocity and acceleration that [`Limits`] can have: half of all goals there are.
pub const MAX_VELOCITY: i32 = 1 << 29;

/// Where a servo was told to be, and how fast it was told to move there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Limiter {
    position: i32,
    velocity: i32,
    wanted: i32,
}

impl Limiter {
    /// At rest at a goal, within ±[`GOAL_LIMIT`](crate::map::GOAL_LIMIT). It may be outside the servo's range, where
    /// someone moved the joint by hand: then it only moves inwards.
    pub const fn at(goal: i32) -> Self {
        let position = goal << FINE_BITS;
        Self { position, velocity: 0, wanted: position }
    }

    /// Goal to send, in goal units.
    pub const fn goal(&self) -> i32 {
        self.position.wrapping_add(1 << (FINE_BITS - 1)) >> FINE_BITS
    }

    /// The same, fine.
    pub const fn position(&self) -> i32 {
        self.position
    }

    /// Change of the goal in the last tick, fine.
    pub const fn velocity(&self) -> i32 {
        self.velocity
    }

    /// A tick towards `wanted` (fine, any value); `max_velocity` may be lowered from tick to tick.
    ///
    /// While range, velocity and acceleration allow it the goal is `wanted` itself. Where they do not, the goal
    /// catches up: relative to the movement of `wanted` it never goes faster than it can brake. From every state the
    /// servo can stop inside its range without more than `max_acceleration`.
    #[inline]
    pub fn follow(&mut self, limits: &Limits, wanted: i32) {
        // Most ticks: the goal was what was wanted, is so again, and the ends of the range are far. Then nothing below
        // changes it.
        let velocity = wanted.saturating_sub(self.position);
        let (max, change) = (limits.max_velocity, limits.max_acceleration);
        if self.position == self.wanted
            && (limits.clear.0..=limits.clear.1).contains(&self.position)
            && (max.wrapping_neg()..=max).contains(&velocity)
            && (change.wrapping_neg()..=change).contains(&velocity.wrapping_sub(self.velocity))
        {
            *self = Self { position: wanted, velocity, wanted };
            return;
        }
        self.catch_up(limits, wanted);
    }

    /// [`follow`](Self::follow), where a goal outside the range may be wanted on the way in: it goes in as slowly as `wanted` does,
    /// and never further out.
    pub fn follow_inwards(&mut self, limits: &Limits, wanted: i32) {
        let (min, max) = (limits.min.min(self.position), limits.max.max(self.position));
        if (min, max) == (limits.min, limits.max) {
            self.follow(limits, wanted);
        } else {
            self.catch_up(&Limits { min, max, ..*limits }, wanted);
        }
    }

    /// [`follow`](Self::follow) wherever a limit has a say.
    fn catch_up(&mut self, limits: &Limits, wanted: i32) {
        let wanted = clamp(wanted, limits.min, limits.max);
        // Where the goal would be if it moved as `wanted` does. One that jumps does not move.
        let moved =
            clamp(wanted.wrapping_sub(self.wanted), limits.max_velocity.wrapping_neg(), limits.max_velocity);
        let behind = wanted.saturating_sub(self.position).saturating_sub(moved);
        let change = limits.max_acceleration;
        let catch_up = if behind <= change && behind >= change.wrapping_neg() {
            behind
        } else {
            signed(braking(behind.unsigned_abs(), change), behind)
        };
        let (lowest, highest) = self.reach(limits);
        let velocity = clamp(moved.saturating_add(catch_up), lowest, highest);
        self.wanted = wanted;
        self.go(limits, velocity);
    }

    /// A tick of braking.
    pub fn stop(&mut self, limits: &Limits) {
        let (lowest, highest) = self.reach(limits);
        self.go(limits, clamp(0, lowest, highest));
        self.wanted = self.position;
    }

    /// The velocities of the next tick that velocity and acceleration allow.
    const fn reach(&self, limits: &Limits) -> (i32, i32) {
        let (max, change) = (limits.max_velocity, limits.max_acceleration);
        // After the limit was lowered it is reached by braking.
        let slower = self.velocity.wrapping_abs().wrapping_sub(change);
        let max = if slower > max { slower } else { max };
        let least = max.wrapping_neg();
        (
            clamp(self.velocity.wrapping_sub(change), least, max),
            clamp(self.velocity.wrapping_add(change), least, max),
        )
    }

    /// Moves by `velocity`, or by less where it could not stop before the end of the range.
    #[inline]
    fn go(&mut self, limits: &Limits, velocity: i32) {
        let room = if velocity < 0 {
            self.position.wrapping_sub(limits.min)
        } else {
            limits.max.wrapping_sub(self.position)
        };
        let room = if room < 0 { 0 } else { room.unsigned_abs() };
        let change = limits.max_acceleration;
        // Most of what comes here ends here, without a divide.
        let ample =
            brake_way(velocity, change) <= (u64::from(change.unsigned_abs()) * 2).wrapping_mul(room.into());
        let safe = if ample {
            velocity
        } else {
            let slower = braking(room, change);
            signed(slower.min(velocity.wrapping_abs()), velocity)
        };
        self.position = self.position.wrapping_add(safe);
        self.velocity = safe;
    }
}

/// The highest speed from which braking by `change` a tick takes at most `distance`, the tick at that speed included:
/// `s + (s − change) + (s − 2 change) + … ≤ distance`, as long as the terms are positive.
///
/// From there the speed of the next tick can be `s − change`, and the same holds for what is left of the distance.
fn braking(distance: u32, change: i32) -> i32 {
    // So that all of this fits 32 bits.
    let (distance, change) = (distance.min(i32::MAX as u32), change.unsigned_abs().max(1));
    // Ticks of braking by all of `change`: the most with n (n + 1) change / 2 ≤ distance.
    let quotient = distance.checked_div(change).unwrap_or(0);
    let root = quotient.wrapping_mul(2).isqrt();
    // n (n + 1) / 2.
    let sum = |n: u32| n.wrapping_mul(n.wrapping_add(1)) / 2;
    let whole = if sum(root) <= quotient { root } else { root.wrapping_sub(1) };
    let speed = distance.wrapping_add(change.wrapping_mul(sum(whole)));
    let speed = speed.checked_div(whole.wrapping_add(1)).unwrap_or(0);
    i32::try_from(speed).unwrap_or(i32::MAX)
}

/// `size` with the sign of `like`.
const fn signed(size: i32, like: i32) -> i32 {
    if like < 0 { size.wrapping_neg() } else { size }
}

/// `Ord::clamp` without its panic, and const.
pub(crate) const fn clamp(value: i32, low: i32, high: i32) -> i32 {
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

    const LIMITS: Limits = Limits::new(0, 4095, 20 << 10, 2 << 10);

    fn fine(goal: i32) -> i32 {
        goal << FINE_BITS
    }

    #[test]
    fn a_movement_within_the_limits_passes_through() {
        let mut limiter = Limiter::at(1000);
        // Accelerates by less than 2, up to 18.
        let mut wanted = fine(1000);
        for tick in 0..60 {
            wanted +=
                (f64::from(fine(9)) * (1.0 - (f64::from(tick) / 30.0 * core::f64::consts::PI).cos())) as i32;
            limiter.follow(&LIMITS, wanted);
            assert_eq!(limiter.position(), wanted);
        }
    }

    #[test]
    fn a_jump_is_approached_and_not_overshot() {
        let mut limiter = Limiter::at(1000);
        let mut goals = Vec::new();
        for _ in 0..200 {
            limiter.follow(&LIMITS, fine(2000));
            goals.push(limiter.goal());
        }
        assert!(goals.is_sorted() && goals.last() == Some(&2000));
        // A trapezium: 2, 4, … 18, then 20 for 41 ticks, then 18, 16, … 2.
        assert_eq!(goals.iter().position(|&goal| goal == 2000), Some(58));
    }

    #[test]
    fn a_moving_target_is_caught_up_with() {
        let mut limiter = Limiter::at(1000);
        let mut wanted = fine(1200);
        let mut met = None;
        for tick in 0..200 {
            wanted += fine(10);
            limiter.follow(&LIMITS, wanted);
            if met.is_none() && limiter.position() == wanted {
                met = Some(tick);
            }
            assert!(met.is_none_or(|_| limiter.position() == wanted), "lost at tick {tick}");
        }
        assert!(met.is_some_and(|tick| tick < 40), "{met:?}");
    }

    #[test]
    fn the_end_of_the_range_is_reached_without_a_knock() {
        let mut limiter = Limiter::at(4000);
        let mut last = 0;
        for _ in 0..100 {
            limiter.follow(&LIMITS, i32::MAX);
            assert!((limiter.velocity() - last).abs() <= LIMITS.max_acceleration);
            last = limiter.velocity();
        }
        assert_eq!((limiter.goal(), limiter.velocity()), (4095, 0));
    }

    #[test]
    fn a_joint_outside_its_range_moves_inwards() {
        let mut limiter = Limiter::at(5000);
        let mut last = 5000;
        while last > 4095 {
            limiter.follow(&LIMITS, i32::MAX);
            assert!(limiter.goal() <= last);
            last = limiter.goal();
        }
    }

    #[test]
    fn a_joint_outside_its_range_goes_in_as_slowly_as_it_is_wanted_to() {
        let mut limiter = Limiter::at(5000);
        let mut most = 0;
        for tick in 1..2000 {
            // Outwards first, which it does not go.
            let wanted = if tick < 100 { 5000 + tick } else { 5000 - (tick - 100) };
            limiter.follow_inwards(&LIMITS, wanted << FINE_BITS);
            assert!(limiter.goal() <= 5000 && limiter.velocity() <= 0);
            most = most.max(limiter.velocity().abs());
        }
        assert_eq!((limiter.goal(), most), (3101, 1 << FINE_BITS));
    }

    #[test]
    fn braking_is_the_highest_speed_that_stops_in_time() {
        for change in [1, 2, 3, 7, 1000, MAX_VELOCITY] {
            for distance in (0..2000).chain([1 << 20, (1 << 20) + 7]) {
                let way = |speed: i32| (0..).map(|n| speed - n * change).take_while(|&s| s > 0).sum::<i32>();
                let speed = braking(distance, change);
                assert!(way(speed) <= distance as i32, "{change} {distance} {speed}");
                assert!(way(speed + 1) > distance as i32, "{change} {distance} {speed}");
            }
        }
        assert!(braking(u32::MAX, 1) < 1 << 17 && braking(u32::MAX, MAX_VELOCITY) > 1 << 30);
    }

    fn any_limits() -> impl Strategy<Value = Limits> {
        let ends = -GOAL_LIMIT..=GOAL_LIMIT;
        let few = prop_oneof![1..=MAX_VELOCITY, 1..100_000];
        (ends.clone(), ends, 0u32..20, few.clone(), few).prop_map(
            |(one, other, narrow, velocity, acceleration)| {
                let (one, other) = (one >> narrow, other >> narrow);
                Limits::new(one.min(other), one.max(other), velocity, acceleration)
            },
        )
    }

    proptest! {
        #[test]
        fn no_goal_leaves_the_range_jumps_or_jerks(
            limits in any_limits(),
            start in -GOAL_LIMIT..=GOAL_LIMIT,
            wanted in prop::collection::vec((any::<i32>(), 0u8..8, 1i32..8), 1..200),
        ) {
            let ends = limits.min >> FINE_BITS..=limits.max >> FINE_BITS;
            let mut limiter = Limiter::at(clamp(start, *ends.start(), *ends.end()));
            for (wanted, how, slow) in wanted {
                let before = limiter;
                let lowered =
                    Limits::new(*ends.start(), *ends.end(), (limits.max_velocity / slow).max(1), limits.max_acceleration);
                match how {
                    0 => limiter.stop(&limits),
                    1 => limiter.follow(&lowered, wanted),
                    2 => limiter.follow(&limits, limiter.position.saturating_add(wanted >> 16)),
                    _ => limiter.follow(&limits, wanted),
                }
                prop_assert!((limits.min..=limits.max).contains(&limiter.position()));
                prop_assert!(limiter.velocity().abs() <= limits.max_velocity);
                let change = i64::from(limiter.velocity()) - i64::from(before.velocity());
                prop_assert!(change.abs() <= i64::from(limits.max_acceleration));
                prop_assert_eq!(limiter.position() - before.position(), limiter.velocity());
                prop_assert!(ends.contains(&limiter.goal()));
            }
        }

        /// Steps are small against the limits, so that both ways of `follow` are taken.
        #[test]
        fn the_short_way_ends_where_the_long_one_does(
            limits in any_limits(),
            steps in prop::collection::vec(-1.2f64..1.2, 1..100),
        ) {
            let mut short = Limiter::at((limits.min >> 1 >> FINE_BITS) + (limits.max >> 1 >> FINE_BITS));
            let (mut long, mut wanted, mut velocity) = (short, short.position(), 0i32);
            for step in steps {
                velocity = velocity.saturating_add((f64::from(limits.max_acceleration) * step) as i32);
                wanted = wanted.saturating_add(velocity);
                short.follow(&limits, wanted);
                long.catch_up(&limits, wanted);
                prop_assert_eq!(short, long);
            }
        }
    }
}

//! What is watched of a servo, to see whether it follows.

use crate::map::{BusKind, Joint};

/// Part of the allowed distance by which a servo comes nearer, or does not follow: an eighth.
const NEARER_BITS: u32 = 3;

/// What is watched of a servo.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Watched {
    /// Goal units that it may be off without coming nearer; 0: any.
    pub(super) most: i32,
    /// Goal units by which a shaft may give way as its torque comes on.
    pub(super) near: i32,
    /// Where its shaft was when it was seen too far off first, or came nearer last.
    was: i32,
    /// Ticks for which it has been too far off since; 0: it is not.
    pub(super) off: u32,
    /// What it read in the last tick, where that was far from its goal.
    pub(super) seen: Option<i32>,
}

impl Watched {
    /// A servo of this kind, that may be `tenths` of a degree off.
    pub(super) fn new(joint: &Joint, kind: Option<BusKind>, tenths: u16) -> Self {
        let turn = kind.map_or(0, BusKind::turn);
        // With gears it is the joint's degrees that count; a joint in cm has none, nor does this know each model's units.
        let own = u64::from(turn).wrapping_mul(tenths.into()) / 3600;
        let geared = u64::from(joint.scale.to_bits().unsigned_abs()).wrapping_mul(tenths.into()) / (10 << 16);
        let most = geared.max(own).min(own.saturating_mul(3));
        Self { most: i32::try_from(most).unwrap_or(i32::MAX), near: (turn / 144) as i32, ..Self::default() }
    }

    /// Forgets what it saw.
    pub(super) const fn forget(&mut self) {
        (self.off, self.seen) = (0, None);
    }

    /// Whether a servo that is told `goal` and stands at `here` does not follow, `ticks` after this was asked last, where it was too far
    /// off then or is so now.
    #[cold]
    #[inline(never)]
    pub(super) fn is_stuck(&mut self, goal: i32, here: i32, ticks: u32, patience: u32) -> bool {
        let way = goal.saturating_sub(here);
        let is_off = way.unsigned_abs() > self.most.unsigned_abs();
        if self.off == 0 && !is_off {
            return false;
        }
        let moved = here.saturating_sub(self.was);
        let nearer = if way < 0 { moved.saturating_neg() } else { moved };
        let least = (self.most >> NEARER_BITS).max(1);
        if self.off == 0 || nearer >= least {
            (self.was, self.off) = (here, is_off.into());
        } else if is_off {
            self.off = self.off.saturating_add(ticks);
        } else if moved.unsigned_abs() >= least.unsigned_abs() {
            // Where a goal comes to a shaft that stands, and leaves it again, the shaft still does not follow.
            self.off = 0;
        }
        self.off > patience
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ticks after which a servo is found not to follow; 10° of 4096 a turn, three servos, 100 ticks a second.
    fn stuck(goal: impl Fn(i32) -> i32, here: impl Fn(i32) -> i32) -> Option<i32> {
        let mut watched = Watched { most: 113, ..Watched::default() };
        (0..3000).step_by(3).find(|&tick| watched.is_stuck(goal(tick), here(tick), 3, 30))
    }

    #[test]
    fn a_shaft_that_stands_does_not_follow_and_one_that_lags_does() {
        let swing = |tick: i32, most: f64| (most * (f64::from(tick) / 20.0).sin()) as i32;
        // 0.3 s after the goal left the bound, and the tick in which it is seen.
        assert_eq!(stuck(|tick| tick, |_| 0), Some(114 + 30));
        assert_eq!(stuck(|tick| tick - 3000, |_| -3000), Some(114 + 30));
        assert_eq!(stuck(|_| 113, |_| 0), None, "within the bound for ever");
        // The goal swings about a shaft that stands; it is too far off for a third of the time.
        assert!(stuck(|tick| swing(tick, 228.0), |_| 0).is_some_and(|tick| tick < 130));
        // It runs the other way.
        assert!(stuck(|tick| tick, |tick| -tick).is_some());
        // As slow as 5° a second, a tenth of a second late, and both.
        assert_eq!(stuck(|_| 2000, |tick| tick * 57 / 100), None);
        assert_eq!(stuck(|tick| swing(tick, 400.0), |tick| swing(tick - 10, 400.0)), None);
        assert_eq!(stuck(|tick| tick * 3, |tick| tick), None);
    }
}

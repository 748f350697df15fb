//! Servos that are not where they are told to be: after their torque came on, and while they move.
//!
//! A servo may read another position once its torque is on: a Dynamixel X in position mode forgets the turns that its shaft was turned
//! while it was slack. So each is held against what it reads since, and its goal is brought there before anything moves. One that
//! stands outside its range, and whose shorter way back leads over the end of its turn, is not moved at all: it would go the long way.
//!
//! While servos move, one is looked at in each tick. One that is further from its goal than the map allows, and does not come nearer,
//! does not follow: something holds its shaft, or its own settings do not let it move. Its goal is then brought to where it is, so that
//! it does not push, and it is left alone until someone acknowledges.

use super::start::ARM_TICKS;
use super::state::State;
use super::state_machine::{Machine, to_goal_range};
use super::tick_output::Action;
use crate::collect::numbered;
use crate::fault::{Fault, Feedback};
use crate::library::Library;
use crate::limits::Limiter;
use crate::map::{BusKind, Joint};

/// Time in ms that a servo may be further from its goal than the map allows without coming nearer.
pub const FOLLOW_MILLIS: u16 = 300;

/// Time in ms after which servos that have not confirmed that they let go are told of. They are still asked to.
pub const LET_GO_MILLIS: u16 = 2000;

/// Part of the allowed distance by which a servo comes nearer, or does not follow: an eighth.
const NEARER_BITS: u32 = 3;

/// What is watched of a servo.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Watched {
    /// Goal units that it may be off without coming nearer; 0: any.
    most: i32,
    /// Goal units by which a shaft may give way as its torque comes on.
    near: i32,
    /// Where its shaft was when it was seen too far off first, or came nearer last.
    was: i32,
    /// Ticks for which it has been too far off since; 0: it is not.
    off: u32,
    /// What it read in the last tick, where that was far from its goal.
    seen: Option<i32>,
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
    fn is_stuck(&mut self, goal: i32, here: i32, ticks: u32, patience: u32) -> bool {
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

impl<L: Library, const N: usize> Machine<'_, L, N> {
    /// Looks at one servo, the next one in the next tick.
    #[inline]
    pub(super) fn watch_following(&mut self, feedback: &Feedback<'_>) {
        let index = self.watched;
        let servos = self.servos.len();
        self.watched = index.saturating_add(1);
        if self.watched >= servos {
            self.watched = 0;
        }
        let Some(servo) = self.servos.get_mut(index).filter(|servo| servo.armed && servo.watched.most > 0)
        else {
            return;
        };
        let Some(Some(reading)) = feedback.readings.get(index) else { return };
        let Some(goal) = self.goals.get(index).map(|goal| goal.position) else { return };
        // Most servos in most ticks.
        if servo.watched.off == 0 && goal.abs_diff(reading.position) <= servo.watched.most.unsigned_abs() {
            return;
        }
        let patience = self.map.settings().ticks(FOLLOW_MILLIS);
        if servo.watched.is_stuck(goal, reading.position, servos as u32, patience) {
            self.give_up(index, goal, reading.position);
        }
    }

    /// A servo does not follow.
    #[cold]
    #[inline(never)]
    fn give_up(&mut self, index: usize, goal: i32, position: i32) {
        if let Some(servo) = self.servos.get_mut(index) {
            servo.stand_at(position);
            servo.leave();
        }
        self.raise(Fault::NotFollowing { servo: index as u8, goal, position });
    }

    /// Whether a servo that stands there would go the long way round into its range.
    pub(super) fn is_beyond_turn(&self, index: usize, position: i32) -> bool {
        let Some(joint) = self.map.joints().get(index) else { return false };
        let kind = self.map.buses().get(usize::from(joint.bus)).map(|bus| bus.kind);
        // Others have a gap in their turn, which no servo is moved over.
        if !matches!(kind, Some(BusKind::Dynamixel | BusKind::Sts)) {
            return false;
        }
        let turn = kind.map_or(0, BusKind::turn) as i32;
        // What is beyond the turn when it is read counts on, and the numbers lead back.
        if !(0..turn).contains(&position) {
            return false;
        }
        let below = joint.min.saturating_sub(position);
        let above = position.saturating_sub(joint.max);
        // Over one end it is a turn less, to the other end of the range.
        if below > 0 {
            turn.saturating_add(above) < below
        } else {
            above > 0 && turn.saturating_add(below) < above
        }
    }

    /// Leaves a servo alone, slack, since it stands beyond its turn.
    #[cold]
    #[inline(never)]
    pub(super) fn leave_beyond_turn(&mut self, index: usize, position: i32) {
        if let Some(servo) = self.servos.get_mut(index) {
            servo.leave();
            servo.letting_go = true;
        }
        self.any_letting_go = true;
        self.fault = self.fault.or(Some(Fault::BeyondTurn { servo: index as u8, position }));
    }

    /// Holds servos whose torque is on against what they read since: a goal that is far from that is brought there. False while one
    /// is in doubt, since a single reading may be wrong; then nobody is told anything.
    pub(super) fn stand_where_read(&mut self, feedback: &Feedback<'_>) -> bool {
        let mut sure = true;
        for index in 0..self.servos.len() {
            let Some(Some(reading)) = feedback.readings.get(index) else { continue };
            let here = to_goal_range(reading.position);
            let Some(servo) = self.servos.get_mut(index).filter(|servo| servo.armed) else { continue };
            let is_near = |other: i32| here.abs_diff(other) <= servo.watched.near.unsigned_abs();
            if is_near(servo.limiter.goal()) {
                servo.watched.seen = None;
                continue;
            }
            let agrees = servo.watched.seen.is_some_and(is_near);
            let gives_up = !agrees && self.doubts >= ARM_TICKS;
            if !agrees && !gives_up {
                (servo.watched.seen, sure) = (Some(here), false);
                continue;
            }
            let goal = servo.limiter.goal();
            servo.stand_at(here);
            if gives_up {
                self.give_up(index, goal, here);
            } else if self.is_beyond_turn(index, here) {
                self.leave_beyond_turn(index, here);
            }
        }
        self.doubts = if sure { 0 } else { self.doubts.saturating_add(1) };
        sure
    }

    /// A servo that was turned on again goes on from where it is now.
    pub(super) fn take_where_it_is(&mut self, index: usize, feedback: &Feedback<'_>) {
        let Some(Some(reading)) = feedback.readings.get(index) else { return };
        let Some(servo) = self.servos.get_mut(index) else { return };
        let here = to_goal_range(reading.position);
        if here.abs_diff(servo.limiter.goal()) > servo.watched.near.unsigned_abs() {
            servo.stand_at(here);
            if self.is_beyond_turn(index, here) {
                self.leave_beyond_turn(index, here);
            }
        }
    }

    // ---- Letting go

    /// Lets all servos go.
    pub(super) fn begin_letting_go(&mut self) {
        self.enter(State::LettingGo);
        for servo in &mut self.servos {
            servo.limiter = Limiter::at(servo.limiter.goal());
            (servo.armed, servo.letting_go) = (false, true);
        }
        self.any_letting_go = true;
    }

    /// Servos that were to let go and have not confirmed it, as numbered in the map.
    pub fn may_hold(&self) -> impl Iterator<Item = usize> + '_ {
        numbered(&self.servos).filter(|(_, servo)| servo.letting_go).map(|(index, _)| index)
    }

    /// Whether no servo is still to let go, or they had the time to confirm that they did.
    pub(super) fn is_let_go(&self) -> bool {
        !self.any_letting_go || self.waited >= self.map.settings().ticks(LET_GO_MILLIS)
    }

    /// Where a servo is to let go: takes what servos have confirmed; the next one that is to let go. A servo that can be read confirms it by reading that its
    /// motor is off, another one by having been reached.
    pub(super) fn let_go(&mut self, feedback: &Feedback<'_>) -> Option<Action> {
        self.waited = self.waited.saturating_add(1);
        let done = feedback.action == Some(Ok(()));
        let mut next = None;
        let mut left = false;
        let asked = self.asked;
        let reached = |index: usize| match asked {
            Some(Action::TorqueOff) => done,
            Some(Action::LetGo { servo }) => done && servo == index,
            _ => false,
        };
        // The one after the one that was asked last comes first.
        let last = match asked {
            Some(Action::LetGo { servo }) => servo,
            _ => usize::MAX,
        };
        for (index, servo) in numbered(&mut self.servos) {
            let torque = feedback.readings.get(index).copied().flatten().map(|reading| reading.torque);
            servo.letting_go &= match torque {
                Some(Some(on)) => on,
                Some(None) => !reached(index),
                None => self.map.reads(index) || !reached(index),
            };
            if servo.letting_go {
                left = true;
                let is_later = next.is_none_or(|found| found <= last && index > last && last != usize::MAX);
                next = if is_later { Some(index) } else { next };
            }
        }
        self.any_letting_go = left;
        next.map(|servo| Action::LetGo { servo })
    }

    /// A tick of letting all go: at once, and then one by one until all have confirmed it.
    pub(super) fn let_all_go(&mut self, feedback: &Feedback<'_>) -> Option<Action> {
        let first = self.waited == 0;
        let next = self.let_go(feedback);
        if next.is_none() {
            self.enter(State::Limp);
            return None;
        }
        if first { Some(Action::TorqueOff) } else { next }
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

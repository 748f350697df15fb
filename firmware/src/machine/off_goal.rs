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
use crate::map::BusKind;

/// Time in ms that a servo may be further from its goal than the map allows without coming nearer.
pub const FOLLOW_MILLIS: u16 = 300;

/// Time in ms after which servos that have not confirmed that they let go are told of. They are still asked to.
pub const LET_GO_MILLIS: u16 = 2000;

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

//! Servos that are not heard, one by one: their line may be loose, and come back at any time.
//!
//! Between a servo's last reading and the first one that is missed, and between the goal and the reading with which it comes back,
//! goals may have got lost. So what is told to it is held against where it is as long as that is in doubt. None of this costs a
//! tick in which all are read.

use super::state_machine::{Machine, to_goal_range};
use crate::collect::numbered;
use crate::fault::{Feedback, UNHEARD_TICKS};
use crate::library::Library;
use crate::limits::{FINE_BITS, Limiter, clamp};

impl<L: Library, const N: usize> Machine<'_, L, N> {
    /// Before the tick is looked at: servos that were silent and are read again. One that has been silent for so long that it may
    /// be anywhere goes on from where it is, not from where it should be by now.
    pub(super) fn take_back_servos(&mut self, feedback: &Feedback<'_>) {
        if !self.detector.any_missed() {
            return;
        }
        // Where all are lost nobody has been told anything.
        let untold = self.detector.all_lost(|servo| self.map.reads(servo));
        for (index, (servo, reading)) in numbered(self.servos.iter_mut().zip(feedback.readings)) {
            let Some(reading) = reading.as_ref().filter(|_| self.detector.missed(index)) else { continue };
            servo.back = true;
            self.any_back = true;
            let here = to_goal_range(reading.position) << FINE_BITS;
            let near = u32::from(UNHEARD_TICKS).saturating_mul(servo.limits.max_velocity().unsigned_abs());
            let far = here.abs_diff(servo.limiter.position()) > near;
            if self.detector.lost(index) && (far || untold) {
                servo.limiter = Limiter::at(to_goal_range(reading.position));
                servo.from = servo.limiter.position();
            }
        }
    }

    /// After the tick has moved all goals: that of a servo which is not heard stays where it was, and that of one which is back is
    /// no further from it than it moves in [`UNHEARD_TICKS`].
    pub(super) fn keep_goals_near_servos(&mut self, feedback: &Feedback<'_>) {
        if !self.detector.any_missed() && !self.any_back {
            return;
        }
        self.any_back = false;
        let readings = self.servos.iter_mut().zip(feedback.readings);
        for (index, ((servo, reading), goal)) in numbered(readings.zip(&self.goals)) {
            let back = core::mem::take(&mut servo.back);
            if self.detector.unheard(index) {
                servo.limiter = Limiter::at(goal.position);
            } else if let (true, Some(reading)) = (back, reading) {
                let here = to_goal_range(reading.position);
                let near = (servo.limits.max_velocity() >> FINE_BITS).saturating_mul(UNHEARD_TICKS.into());
                let goal = servo.limiter.goal();
                let nearest = clamp(goal, here.saturating_sub(near), here.saturating_add(near));
                if nearest != goal {
                    servo.limiter = Limiter::at(nearest);
                }
            }
        }
    }
}

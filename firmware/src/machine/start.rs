//! From power on, or from an acknowledged fault: servos are found, read, and turned on where they are.

use super::state::State;
use super::state_machine::{Machine, to_goal_range};
use super::tick_output::Action;
use crate::fault::{Fault, Feedback};
use crate::library::Library;
use crate::limits::Limiter;
use crate::map::Policy;

/// Time in ms that servos have to come up before one counts as missing.
const FIND_MILLIS: u16 = 1500;

/// Ticks that a servo has to be turned on.
pub(super) const ARM_TICKS: u32 = 3;

impl<L: Library, const N: usize> Machine<'_, L, N> {
    /// Pings servo by servo. One with a hardware error is restarted, which is what clears it.
    pub(super) fn find(&mut self, feedback: &Feedback<'_>) -> Option<Action> {
        if let (Some(Action::Ping { servo }), Some(result)) = (self.asked, feedback.action) {
            match result {
                Ok(()) => self.servo = servo.saturating_add(1),
                Err(_) if self.waited < self.map.settings().ticks(FIND_MILLIS) => {}
                Err(_) => {
                    // The rest is looked for as well, so that it can be held.
                    self.fault = self.fault.or(Some(Fault::Silent { servo: servo as u8 }));
                    self.servo = servo.saturating_add(1);
                }
            }
        }
        self.waited = self.waited.saturating_add(1);
        if self.servo < self.servos.len() {
            return Some(Action::Ping { servo: self.servo });
        }
        self.enter(State::Reading);
        None
    }

    /// Waits for the positions of all servos that have them.
    pub(super) fn read(&mut self, feedback: &Feedback<'_>) -> Option<Action> {
        self.waited = self.waited.saturating_add(1);
        let faulty = |index: usize| {
            feedback.readings.get(index).copied().flatten().is_some_and(|reading| reading.hardware_error != 0)
        };
        let settings = self.map.settings();
        let patient = self.waited < settings.ticks(FIND_MILLIS);
        if let Some(servo) = (0..self.servos.len()).find(|&index| faulty(index))
            && patient
            && self.fault.is_none()
        {
            // Asked again only after it had the time to come back, which at a tick or two a second is one tick.
            let since_first = self.waited.saturating_sub(1);
            let is_due = since_first.is_multiple_of(settings.ticks(FIND_MILLIS / 3));
            return is_due.then_some(Action::Reboot { servo });
        }
        let missing = (0..self.servos.len()).find(|&index| !self.is_read(index, feedback));
        match missing {
            Some(_) if patient => return None,
            Some(servo) => self.fault = self.fault.or(Some(Fault::Silent { servo: servo as u8 })),
            None => {}
        }
        for servo in 0..self.servos.len() {
            if let Some(Some(reading)) = feedback.readings.get(servo)
                && self.is_beyond_turn(servo, reading.position)
            {
                self.leave_beyond_turn(servo, reading.position);
            }
        }
        if self.fault.is_some() && settings.policy == Policy::TorqueOff {
            self.begin_letting_go();
            return None;
        }
        self.settle(feedback);
        self.enter(State::Arming);
        // Servos whose watchdog has bitten refuse goals.
        (settings.servo_watchdog_millis > 0).then_some(Action::Watchdog { millis: 0 })
    }

    /// Whether a servo was just read, or cannot be.
    fn is_read(&self, servo: usize, feedback: &Feedback<'_>) -> bool {
        !self.map.reads(servo) || feedback.readings.get(servo).is_some_and(Option::is_some)
    }

    /// Takes servos that do not hold to be where they say they are.
    fn settle(&mut self, feedback: &Feedback<'_>) {
        for (servo, reading) in self.servos.iter_mut().zip(feedback.readings) {
            if let Some(reading) = reading {
                servo.armed &= reading.torque != Some(false);
                if !servo.armed {
                    servo.limiter = Limiter::at(to_goal_range(reading.position));
                }
            }
        }
    }

    /// Turns servo by servo on; those that are still off may be moved by hand. Those that are on are held against what they read
    /// since.
    pub(super) fn arm(&mut self, feedback: &Feedback<'_>) -> Option<Action> {
        if let (Some(Action::TorqueOn { servo }), Some(result)) = (self.asked, feedback.action) {
            match result {
                Ok(()) => {
                    if let Some(servo) = self.servos.get_mut(servo) {
                        servo.armed = true;
                    }
                    (self.servo, self.waited) = (servo.saturating_add(1), 0);
                }
                Err(_) if self.waited < ARM_TICKS => {}
                Err(error) => {
                    self.fault = self.fault.or(Some(Fault::Refused { servo: servo as u8, error }));
                    (self.servo, self.waited) = (servo.saturating_add(1), 0);
                }
            }
        }
        self.waited = self.waited.saturating_add(1);
        self.settle(feedback);
        if !self.stand_where_read(feedback) || self.state != State::Arming {
            return None;
        }
        // Of one that is not read nobody knows where on is.
        while self.servo < self.servos.len() {
            if self.servos.get(self.servo).is_some_and(|servo| servo.left) {
                (self.servo, self.waited) = (self.servo.saturating_add(1), 1);
                continue;
            }
            if self.is_read(self.servo, feedback) {
                return Some(Action::TorqueOn { servo: self.servo });
            }
            if self.waited < ARM_TICKS {
                return None;
            }
            self.fault = self.fault.or(Some(Fault::Silent { servo: self.servo as u8 }));
            (self.servo, self.waited) = (self.servo.saturating_add(1), 1);
        }
        // The last one is read once more as well.
        if self.waited < 2 {
            return None;
        }
        if self.fault.is_some() && self.map.settings().policy == Policy::TorqueOff {
            self.begin_letting_go();
            return None;
        }
        self.enter(if self.fault.is_some() { State::Stopping } else { State::Opening });
        let millis = self.map.settings().servo_watchdog_millis;
        self.rearm = millis > 0;
        None
    }
}

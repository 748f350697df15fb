//! Servos on a wire, and what happens to them apart from what is said on it.

use super::bus::ConfigError;
use super::servo::ServoConfig;
use serde::Deserialize;
use servo_wire::dynamixel::MAX_ID;
use std::collections::VecDeque;

/// What happens to servos from outside, apart from what is said on their bus.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(tag = "what", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Deed {
    /// Its supply breaks in: it forgets its RAM, lets go, and is gone for [`START_US`].
    Restart {
        /// Id of the servo.
        servo: u8,
    },
    /// It neither hears nor says anything.
    Silence {
        /// Id of the servo.
        servo: u8,
        /// For how long.
        seconds: f64,
    },
    /// Nothing goes over the bus.
    Cut {
        /// For how long.
        seconds: f64,
    },
    /// Somebody turns its shaft, which a servo whose torque is on does not let happen.
    Turn {
        /// Id of the servo.
        servo: u8,
        /// To this position, in its goal units.
        position: i32,
    },
}

/// Microseconds that a servo takes to start.
pub const START_US: u64 = 300_000;

impl Deed {
    /// The servo that it happens to, if it is not all.
    #[must_use]
    pub const fn servo(&self) -> Option<u8> {
        match *self {
            Self::Restart { servo } | Self::Silence { servo, .. } | Self::Turn { servo, .. } => Some(servo),
            Self::Cut { .. } => None,
        }
    }
}

/// What time and people do to a servo.
pub(super) trait Shaft {
    fn id(&self) -> u8;
    fn position(&self) -> i32;
    fn advance_to(&mut self, now_us: u64);
    fn reboot(&mut self);
    fn turn(&mut self, position: i32);
}

/// The servos of a wire.
pub(super) struct Crowd<S> {
    servos: Vec<S>,
    /// Servos that are not there, and until when.
    away: Vec<(u64, S)>,
    cut_until_us: u64,
    /// What is to happen, by its time.
    schedule: VecDeque<(u64, Deed)>,
}

impl<S: Shaft> Crowd<S> {
    pub const fn new(servos: Vec<S>) -> Self {
        Self { servos, away: Vec::new(), cut_until_us: 0, schedule: VecDeque::new() }
    }

    /// As [`Wire::schedule`](super::Wire::schedule).
    pub fn schedule(&mut self, at_us: u64, deed: Deed) -> Result<(), ConfigError> {
        if let Some(servo) = deed.servo()
            && self.position(servo).is_none()
        {
            return Err(ConfigError::Absent(servo));
        }
        let place = self.schedule.partition_point(|(at, _)| *at <= at_us);
        self.schedule.insert(place, (at_us, deed));
        Ok(())
    }

    /// Where a servo's shaft is, also while it says nothing.
    pub fn position(&self, id: u8) -> Option<i32> {
        let all = self.servos.iter().chain(self.away.iter().map(|(_, servo)| servo));
        all.into_iter().find(|servo| servo.id() == id).map(Shaft::position)
    }

    /// Lets time pass, and gives those whom something that is sent now reaches; nobody where the wire is cut.
    pub fn reached_at(&mut self, now_us: u64) -> Option<&mut Vec<S>> {
        self.advance_to(now_us);
        (now_us >= self.cut_until_us).then_some(&mut self.servos)
    }

    /// Lets time pass.
    pub fn advance_to(&mut self, now_us: u64) {
        while let Some((at_us, deed)) = self.schedule.pop_front_if(|(at, _)| *at <= now_us) {
            self.pass(at_us);
            self.happen(deed, at_us);
        }
        self.pass(now_us);
    }

    fn pass(&mut self, now_us: u64) {
        let away = self.away.iter_mut().map(|(_, servo)| servo);
        self.servos.iter_mut().chain(away).for_each(|servo| servo.advance_to(now_us));
        let back = self.away.extract_if(.., |(until, _)| *until <= now_us);
        self.servos.extend(back.map(|(_, servo)| servo));
    }

    fn happen(&mut self, deed: Deed, now_us: u64) {
        let away = self.away.iter_mut().map(|(_, servo)| servo);
        let mut servos = self.servos.iter_mut().chain(away);
        let mut with = |id: u8| servos.find(|servo| servo.id() == id);
        match deed {
            Deed::Restart { servo } => {
                with(servo).into_iter().for_each(Shaft::reboot);
                self.leave(servo, now_us + START_US);
            }
            Deed::Silence { servo, seconds } => self.leave(servo, now_us + micros(seconds)),
            Deed::Cut { seconds } => self.cut_until_us = now_us + micros(seconds),
            Deed::Turn { servo, position } => {
                with(servo).into_iter().for_each(|servo| servo.turn(position));
            }
        }
    }

    /// Takes a servo off the bus until then.
    fn leave(&mut self, id: u8, until_us: u64) {
        match self.servos.iter().position(|servo| servo.id() == id) {
            Some(index) => self.away.push((until_us, self.servos.remove(index))),
            None => self
                .away
                .iter_mut()
                .filter(|(_, servo)| servo.id() == id)
                .for_each(|(until, _)| *until = until_us.max(*until)),
        }
    }
}

/// Seconds in microseconds; negative ones are none.
fn micros(seconds: f64) -> u64 {
    (seconds * 1e6).round() as u64
}

/// Whether servos with positions from 0 to `most` can be as they are described.
pub(super) fn check(servos: &[ServoConfig], most: i32) -> Result<(), ConfigError> {
    let mut used = [false; MAX_ID as usize + 1];
    for &ServoConfig { id, min_position: min, max_position: max, .. } in servos {
        let used = used.get_mut(usize::from(id)).ok_or(ConfigError::Id(id))?;
        if std::mem::replace(used, true) {
            return Err(ConfigError::Duplicate(id));
        }
        if min < 0 || max > most || min > max {
            return Err(ConfigError::Limits { id, min, max, most });
        }
    }
    Ok(())
}

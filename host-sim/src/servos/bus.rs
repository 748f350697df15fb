//! Servos on one bus: bytes in, bytes out, and time.

use super::instructions::{self, Line};
use super::servo::{Servo, ServoConfig};
use firmware::dynamixel::{ErrorNumber, FrameError, Framer, MAX_ID};
use serde::Deserialize;
use std::collections::VecDeque;
use thiserror::Error;

/// Longest packet that the servos take; clients send at most 1 KiB.
const LONGEST_PACKET: usize = 2048;

/// What the servos are and how patient the line is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BusConfig {
    /// The servos; every id once.
    pub servos: Vec<ServoConfig>,
    /// Silence in microseconds after which half a packet is given up. The manual says 1500, the default; a bus that
    /// operating systems and networks lie in front of needs more.
    pub byte_gap_us: u64,
}

impl BusConfig {
    /// A bus with these servos, as they leave the factory apart from their ids.
    #[must_use]
    pub fn with_ids(ids: &[u8]) -> Self {
        Self { servos: ids.iter().map(|&id| ServoConfig::new(id)).collect(), byte_gap_us: 1500 }
    }
}

/// Why servos cannot be on a bus.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ConfigError {
    /// An id that no servo can have.
    #[error("servo id {0} is out of range, expected 0 to 252")]
    Id(u8),
    /// Two servos with one id, which would answer at once.
    #[error("servo id {0} is used twice")]
    Duplicate(u8),
    /// A servo that something should happen to, and that is not there.
    #[error("there is no servo {0} for something to happen to")]
    Absent(u8),
    /// Limits that leave no position, or none within one turn.
    #[error("servo {id} has the position limits {min} to {max}, expected a range within 0 to 4095")]
    Limits {
        /// Id of the servo.
        id: u8,
        /// Its lower limit.
        min: i32,
        /// Its upper limit.
        max: i32,
    },
}

/// What the tap of a bus sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A servo took a goal position.
    Goal {
        /// The time given to [`Bus::receive`].
        time_us: u64,
        /// Id of the servo.
        id: u8,
        /// Goal position, 4096 a turn.
        position: i32,
    },
    /// A servo refused an instruction; after a sync write nobody else learns of it.
    Refused {
        /// The time given to [`Bus::receive`].
        time_us: u64,
        /// Id of the servo.
        id: u8,
        /// Why.
        error: ErrorNumber,
    },
}

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
        /// To this position, 4096 a turn.
        position: i32,
    },
}

/// Microseconds that a servo takes to start.
pub const START_US: u64 = 300_000;

/// Virtual servos on a bus. Baud rate and return delay time can be set but have no effect: a simulated line has no bit
/// rate, and answers are there at once.
pub struct Bus {
    framer: Framer<LONGEST_PACKET>,
    servos: Vec<Servo>,
    /// Servos that are not there, and until when.
    away: Vec<(u64, Servo)>,
    cut_until_us: u64,
    /// What is to happen, by its time.
    schedule: VecDeque<(u64, Deed)>,
    byte_gap_us: u64,
    heard_us: u64,
}

impl Bus {
    /// Servos whose power comes on at time 0, torque off.
    ///
    /// # Errors
    /// [`ConfigError`] for an id out of range or used twice and for impossible limits.
    pub fn new(config: &BusConfig) -> Result<Self, ConfigError> {
        let mut used = [false; MAX_ID as usize + 1];
        for &ServoConfig { id, min_position: min, max_position: max, .. } in &config.servos {
            let used = used.get_mut(usize::from(id)).ok_or(ConfigError::Id(id))?;
            if std::mem::replace(used, true) {
                return Err(ConfigError::Duplicate(id));
            }
            if min < 0 || max > 4095 || min > max {
                return Err(ConfigError::Limits { id, min, max });
            }
        }
        Ok(Self {
            framer: Framer::new(),
            servos: config.servos.iter().copied().map(Servo::new).collect(),
            away: Vec::new(),
            cut_until_us: 0,
            schedule: VecDeque::new(),
            byte_gap_us: config.byte_gap_us,
            heard_us: 0,
        })
    }

    /// Has something happen at `at_us`, or as soon as time passes where that is over.
    ///
    /// # Errors
    /// [`ConfigError::Absent`] for a servo that is not on this bus.
    pub fn schedule(&mut self, at_us: u64, deed: Deed) -> Result<(), ConfigError> {
        if let Deed::Restart { servo } | Deed::Silence { servo, .. } | Deed::Turn { servo, .. } = deed
            && self.position(servo).is_none()
        {
            return Err(ConfigError::Absent(servo));
        }
        let place = self.schedule.partition_point(|(at, _)| *at <= at_us);
        self.schedule.insert(place, (at_us, deed));
        Ok(())
    }

    /// Where a servo's shaft is, in its goal units, also while it says nothing.
    #[must_use]
    pub fn position(&self, id: u8) -> Option<i32> {
        let all = self.servos.iter().chain(self.away.iter().map(|(_, servo)| servo));
        all.into_iter().find(|servo| servo.id() == id).map(Servo::position)
    }

    /// Takes bytes that arrive at `now_us` (microseconds since power on, never going back) and returns what the servos
    /// send. `tap` is told of every goal position and every refusal, in order.
    ///
    /// A packet with a wrong checksum is answered with the CRC error if it names a servo's own id.
    pub fn receive(&mut self, bytes: &[u8], now_us: u64, tap: &mut dyn FnMut(Event)) -> Vec<u8> {
        self.advance_to(now_us);
        let mut out = Vec::new();
        if now_us < self.cut_until_us {
            return out;
        }
        let Self { framer, servos, .. } = self;
        let mut line = Line { now_us, tap, out: &mut out };
        if now_us.saturating_sub(self.heard_us) > self.byte_gap_us {
            while let Some(frame) = framer.flush() {
                take(servos, frame, &mut line);
            }
        }
        self.heard_us = now_us;
        let mut bytes = bytes;
        while let Some(frame) = framer.feed(&mut bytes) {
            take(servos, frame, &mut line);
        }
        out
    }

    /// Lets time pass: servos move, watchdogs run. Never needed before [`receive`](Self::receive), which does it.
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
                with(servo).into_iter().for_each(Servo::reboot);
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

fn take(
    servos: &mut [Servo],
    frame: Result<firmware::dynamixel::Packet<'_>, FrameError>,
    line: &mut Line<'_>,
) {
    match frame {
        Ok(packet) => instructions::execute(servos, &packet, line),
        Err(FrameError::Crc { id, .. }) => {
            let asked = servos.iter().find(|servo| servo.id() == id && servo.return_level() == 2);
            asked.into_iter().for_each(|servo| line.status(id, servo.alert(), &Err(ErrorNumber::Crc)));
        }
        Err(FrameError::TooShort { .. } | FrameError::TooLong { .. }) => {}
    }
}

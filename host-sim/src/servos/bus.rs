//! Servos on one bus: bytes in, bytes out, and time.

use super::crowd::{Crowd, Deed, check};
use super::instructions::{self, Line};
use super::servo::{Servo, ServoConfig};
use servo_wire::dynamixel::{ErrorNumber, FrameError, Framer};
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
    /// Limits that leave no position, or none that the servo has.
    #[error("servo {id} has the position limits {min} to {max}, expected a range within 0 to {most}")]
    Limits {
        /// Id of the servo.
        id: u8,
        /// Its lower limit.
        min: i32,
        /// Its upper limit.
        max: i32,
        /// The highest position that such a servo has.
        most: i32,
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
        /// Goal position, in its goal units: of a Dynamixel X 4096 a turn.
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

/// One end of a wire with virtual servos on it, whatever they speak.
pub trait Wire: Send {
    /// Takes bytes that arrive at `now_us` (microseconds since power on, never going back) and returns what is answered.
    /// `tap` is told of every goal position and every refusal, in order.
    fn receive(&mut self, bytes: &[u8], now_us: u64, tap: &mut dyn FnMut(Event)) -> Vec<u8>;

    /// Has something happen at `at_us`, or as soon as time passes where that is over.
    ///
    /// # Errors
    /// [`ConfigError::Absent`] for a servo that is not on this wire.
    fn schedule(&mut self, at_us: u64, deed: Deed) -> Result<(), ConfigError>;
}

/// Virtual Dynamixel X on a bus. Baud rate and return delay time can be set but have no effect: a simulated line has no bit
/// rate, and answers are there at once.
pub struct Bus {
    framer: Framer<LONGEST_PACKET>,
    crowd: Crowd<Servo>,
    byte_gap_us: u64,
    heard_us: u64,
}

impl Bus {
    /// Servos whose power comes on at time 0, torque off.
    ///
    /// # Errors
    /// [`ConfigError`] for an id out of range or used twice and for impossible limits.
    pub fn new(config: &BusConfig) -> Result<Self, ConfigError> {
        check(&config.servos, 4095)?;
        Ok(Self {
            framer: Framer::new(),
            crowd: Crowd::new(config.servos.iter().copied().map(Servo::new).collect()),
            byte_gap_us: config.byte_gap_us,
            heard_us: 0,
        })
    }

    /// Has something happen at `at_us`, or as soon as time passes where that is over.
    ///
    /// # Errors
    /// [`ConfigError::Absent`] for a servo that is not on this bus.
    pub fn schedule(&mut self, at_us: u64, deed: Deed) -> Result<(), ConfigError> {
        self.crowd.schedule(at_us, deed)
    }

    /// Where a servo's shaft is, in its goal units, also while it says nothing.
    #[must_use]
    pub fn position(&self, id: u8) -> Option<i32> {
        self.crowd.position(id)
    }

    /// Takes bytes that arrive at `now_us` (microseconds since power on, never going back) and returns what the servos
    /// send. `tap` is told of every goal position and every refusal, in order.
    ///
    /// A packet with a wrong checksum is answered with the CRC error if it names a servo's own id.
    pub fn receive(&mut self, bytes: &[u8], now_us: u64, tap: &mut dyn FnMut(Event)) -> Vec<u8> {
        let mut out = Vec::new();
        let Self { framer, crowd, .. } = self;
        let Some(servos) = crowd.reached_at(now_us) else { return out };
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
        self.crowd.advance_to(now_us);
    }
}

impl Wire for Bus {
    fn receive(&mut self, bytes: &[u8], now_us: u64, tap: &mut dyn FnMut(Event)) -> Vec<u8> {
        self.receive(bytes, now_us, tap)
    }

    fn schedule(&mut self, at_us: u64, deed: Deed) -> Result<(), ConfigError> {
        self.schedule(at_us, deed)
    }
}

fn take(
    servos: &mut [Servo],
    frame: Result<servo_wire::dynamixel::Packet<'_>, FrameError>,
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

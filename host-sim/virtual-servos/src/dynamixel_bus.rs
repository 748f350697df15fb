//! Dynamixel X on one bus: packets out of bytes, and time.

use crate::config::{ConfigError, ServoConfig, check};
use crate::dynamixel_servo::DynamixelServo;
use crate::group::ServoGroup;
use crate::instructions::{self, Answers};
use crate::virtual_bus::{Disturbance, Event, VirtualBus};
use servo_wire::dynamixel::{ErrorNumber, FrameError, Framer, Packet};

/// Longest packet that the servos take; clients send at most 1 KiB.
const LONGEST_PACKET: usize = 2048;

/// What the servos are and how patient the line is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DynamixelConfig {
    /// The servos; every id once.
    pub servos: Vec<ServoConfig>,
    /// Silence in microseconds after which half a packet is given up. The manual says 1500, the default; a bus that
    /// operating systems and networks lie in front of needs more.
    pub byte_gap_us: u64,
}

impl DynamixelConfig {
    /// A bus with these servos, as they leave the factory apart from their ids.
    #[must_use]
    pub fn with_ids(ids: &[u8]) -> Self {
        Self { servos: ids.iter().map(|&id| ServoConfig::new(id)).collect(), byte_gap_us: 1500 }
    }
}

/// Virtual Dynamixel X on a bus. Baud rate and return delay time can be set but have no effect: a simulated line has
/// no bit rate, and answers are there at once.
pub struct DynamixelServos {
    framer: Framer<LONGEST_PACKET>,
    group: ServoGroup<DynamixelServo>,
    byte_gap_us: u64,
    heard_us: u64,
}

impl DynamixelServos {
    /// Servos whose power comes on at time 0, torque off.
    ///
    /// # Errors
    /// [`ConfigError`] for an id out of range or used twice and for impossible limits.
    pub fn new(config: &DynamixelConfig) -> Result<Self, ConfigError> {
        check(&config.servos, 4095)?;
        Ok(Self {
            framer: Framer::new(),
            group: ServoGroup::new(config.servos.iter().copied().map(DynamixelServo::new).collect()),
            byte_gap_us: config.byte_gap_us,
            heard_us: 0,
        })
    }

    /// Where a servo's shaft is, in its goal units, also while it says nothing.
    #[must_use]
    pub fn position(&self, id: u8) -> Option<i32> {
        self.group.position(id)
    }

    /// Lets time pass: servos move, watchdogs run. Never needed before [`receive`](VirtualBus::receive), which does
    /// it.
    pub fn advance_to(&mut self, now_us: u64) {
        self.group.advance_to(now_us);
    }
}

impl VirtualBus for DynamixelServos {
    /// A packet with a wrong checksum is answered with the CRC error if it names a servo's own id.
    fn receive(&mut self, bytes: &[u8], now_us: u64, tap: &mut dyn FnMut(Event)) -> Vec<u8> {
        let mut out = Vec::new();
        let Self { framer, group, .. } = self;
        let Some(servos) = group.reached_at(now_us) else { return out };
        let mut answers = Answers { now_us, tap, out: &mut out };
        if now_us.saturating_sub(self.heard_us) > self.byte_gap_us {
            while let Some(frame) = framer.flush() {
                execute(servos, frame, &mut answers);
            }
        }
        self.heard_us = now_us;
        let mut bytes = bytes;
        while let Some(frame) = framer.feed(&mut bytes) {
            execute(servos, frame, &mut answers);
        }
        out
    }

    fn schedule(&mut self, at_us: u64, disturbance: Disturbance) -> Result<(), ConfigError> {
        self.group.schedule(at_us, disturbance)
    }
}

fn execute(servos: &mut [DynamixelServo], frame: Result<Packet<'_>, FrameError>, answers: &mut Answers<'_>) {
    match frame {
        Ok(packet) => instructions::execute(servos, &packet, answers),
        Err(FrameError::Crc { id, .. }) => {
            let asked = servos.iter().find(|servo| servo.id() == id && servo.return_level() == 2);
            asked.into_iter().for_each(|servo| answers.status(id, servo.alert(), &Err(ErrorNumber::Crc)));
        }
        Err(FrameError::TooShort { .. } | FrameError::TooLong { .. }) => {}
    }
}

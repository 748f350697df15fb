//! Servos on a bus, and what happens to them apart from what is said on it.

use crate::config::ConfigError;
use crate::virtual_bus::{Disturbance, START_US};
use std::collections::VecDeque;

/// What time and people do to a servo.
pub(crate) trait SimulatedServo {
    fn id(&self) -> u8;
    fn position(&self) -> i32;
    fn advance_to(&mut self, now_us: u64);
    fn reboot(&mut self);
    fn turn(&mut self, position: i32);
    fn set(&mut self, address: u16, value: i64);
}

/// The servos of a bus.
pub(crate) struct ServoGroup<S> {
    servos: Vec<S>,
    /// Servos that are not there, and until when.
    away: Vec<(u64, S)>,
    cut_until_us: u64,
    /// What is to happen, by its time.
    schedule: VecDeque<(u64, Disturbance)>,
}

impl<S: SimulatedServo> ServoGroup<S> {
    pub const fn new(servos: Vec<S>) -> Self {
        Self { servos, away: Vec::new(), cut_until_us: 0, schedule: VecDeque::new() }
    }

    /// As [`VirtualBus::schedule`](crate::virtual_bus::VirtualBus::schedule).
    pub fn schedule(&mut self, at_us: u64, disturbance: Disturbance) -> Result<(), ConfigError> {
        if let Some(servo) = disturbance.servo()
            && self.position(servo).is_none()
        {
            return Err(ConfigError::Absent(servo));
        }
        let place = self.schedule.partition_point(|(at, _)| *at <= at_us);
        self.schedule.insert(place, (at_us, disturbance));
        Ok(())
    }

    /// Where a servo's shaft is, also while it says nothing.
    pub fn position(&self, id: u8) -> Option<i32> {
        let all = self.servos.iter().chain(self.away.iter().map(|(_, servo)| servo));
        all.into_iter().find(|servo| servo.id() == id).map(SimulatedServo::position)
    }

    /// Lets time pass, and gives those whom something that is sent now reaches; nobody where the bus is cut.
    pub fn reached_at(&mut self, now_us: u64) -> Option<&mut Vec<S>> {
        self.advance_to(now_us);
        (now_us >= self.cut_until_us).then_some(&mut self.servos)
    }

    /// Lets time pass.
    pub fn advance_to(&mut self, now_us: u64) {
        while let Some((at_us, disturbance)) = self.schedule.pop_front_if(|(at, _)| *at <= now_us) {
            self.simulate_to(at_us);
            self.disturb(disturbance, at_us);
        }
        self.simulate_to(now_us);
    }

    fn simulate_to(&mut self, now_us: u64) {
        let away = self.away.iter_mut().map(|(_, servo)| servo);
        self.servos.iter_mut().chain(away).for_each(|servo| servo.advance_to(now_us));
        let back = self.away.extract_if(.., |(until, _)| *until <= now_us);
        self.servos.extend(back.map(|(_, servo)| servo));
    }

    fn disturb(&mut self, disturbance: Disturbance, now_us: u64) {
        let away = self.away.iter_mut().map(|(_, servo)| servo);
        let mut servos = self.servos.iter_mut().chain(away);
        let mut with = |id: u8| servos.find(|servo| servo.id() == id);
        match disturbance {
            Disturbance::Restart { servo } => {
                with(servo).into_iter().for_each(SimulatedServo::reboot);
                self.leave(servo, now_us + START_US);
            }
            Disturbance::Silence { servo, seconds } => self.leave(servo, now_us + micros(seconds)),
            Disturbance::Cut { seconds } => self.cut_until_us = now_us + micros(seconds),
            Disturbance::Turn { servo, position } => {
                with(servo).into_iter().for_each(|servo| servo.turn(position));
            }
            Disturbance::Set { servo, address, value } => {
                with(servo).into_iter().for_each(|servo| servo.set(address, value));
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

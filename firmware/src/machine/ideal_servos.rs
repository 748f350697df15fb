//! A machine without a bus: for measuring, and for looking at what it will do.

use super::state::State;
use super::state_machine::Machine;
use super::tick_output::{Action, TickOutput};
use crate::collect::collect;
use crate::fault::Feedback;
use crate::library::Library;
use heapless::Vec;
use servo_wire::bus::{Goal, Reading};

/// Servos that are at once where they are told to be, and never fail.
#[derive(Debug)]
pub struct IdealServos<const N: usize> {
    readings: Vec<Option<Reading>, N>,
    acted: bool,
}

impl<const N: usize> IdealServos<N> {
    /// Servos at the machine's home pose.
    pub fn new<L: Library>(machine: &Machine<'_, L, N>) -> Self {
        let at = |position| {
            Some(Reading {
                position,
                temperature: None,
                millivolts: None,
                load: None,
                hardware_error: 0,
                torque: Some(false),
            })
        };
        let readings = collect(machine.map().joints().iter().map(|joint| at(joint.home)));
        Self { readings, acted: false }
    }

    /// A tick; its goals.
    pub fn tick<'p, L: Library>(&mut self, machine: &'p mut Machine<'_, L, N>) -> &'p [Goal] {
        let action = self.acted.then_some(Ok(()));
        let feedback = Feedback { readings: &self.readings, bus: Ok(()), action, late: false };
        let TickOutput { goals, action } = machine.tick(&feedback);
        self.acted = action.is_some();
        for (goal, reading) in goals.iter().zip(&mut self.readings) {
            if let Some(reading) = reading {
                reading.position = goal.position;
            }
        }
        if let Some(Action::TorqueOn { servo }) = action
            && let Some(Some(reading)) = self.readings.get_mut(servo)
        {
            reading.torque = Some(true);
        }
        goals
    }

    /// Ticks until the first clip plays, at most `limit`; false where it then does not.
    pub fn until_it_plays<L: Library>(&mut self, machine: &mut Machine<'_, L, N>, limit: u32) -> bool {
        for _ in 0..limit {
            if machine.state() == State::Playing {
                return true;
            }
            self.tick(machine);
        }
        false
    }
}

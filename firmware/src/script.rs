//! Commands by the clock: what a show does at which tick.

use crate::machine::{Command, Machine, State};
use crate::stage::Library;
use crate::voice::PlayError;

/// Commands with their ticks, in order. Tick 0 is the first one in which servos are given goals: before, it depends on
/// the servos how long the puppet looks for them.
#[derive(Clone, Copy, Debug)]
pub struct Script<'s> {
    orders: &'s [(u32, Command)],
    /// The tick that comes, once goals have been sent.
    tick: Option<u32>,
}

impl<'s> Script<'s> {
    /// Before the first tick.
    pub const fn new(orders: &'s [(u32, Command)]) -> Self {
        Self { orders, tick: None }
    }

    /// The tick that comes; `None` before tick 0 is over.
    pub const fn tick(&self) -> Option<u32> {
        self.tick
    }

    /// Before each tick: gives the machine what is due, and `refused` what it does not take. False once all was given and
    /// the puppet is at rest.
    pub fn control<L: Library, const N: usize>(
        &mut self,
        machine: &mut Machine<'_, L, N>,
        mut refused: impl FnMut(Command, PlayError),
    ) -> bool {
        self.tick = match self.tick {
            Some(tick) => Some(tick.saturating_add(1)),
            None if matches!(machine.state(), State::Finding | State::Reading) => None,
            None => Some(1),
        };
        while let (Some(tick), Some(((due, command), rest))) = (self.tick, self.orders.split_first())
            && *due <= tick
        {
            self.orders = rest;
            if let Err(error) = machine.command(*command) {
                refused(*command, error);
            }
        }
        !(self.orders.is_empty() && machine.at_rest())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::world::{Clips, map};
    use crate::machine::{Rehearsal, Show, Start};
    use crate::map::Settings;
    use crate::stage::QUEUE;

    #[test]
    fn commands_are_given_at_their_ticks_and_the_end_comes_after_them() {
        let map = map(Settings::new(100));
        let show = Show { playlist: &[1], ..Show::default() };
        let mut machine = Machine::new(&map, Clips::default(), show, Start::Power);
        let mut servos = Rehearsal::new(&machine);
        let full = (0..=QUEUE as u32).map(|_| (120, Command::Queue { clip: 1, repeats: false }));
        let orders: Vec<_> = [(50, Command::Pause), (110, Command::Resume)]
            .into_iter()
            .chain(full)
            .chain([(130, Command::Home), (900, Command::Trigger)])
            .collect();
        let mut script = Script::new(&orders);
        let (mut refusals, mut goals) = (Vec::new(), 0);
        while script.control(&mut machine, |command, error| refusals.push((command, error))) {
            assert!(goals < 2000, "it never ends");
            // What comes after the tick with the first goals is tick 1.
            assert_eq!(script.tick(), (goals > 0).then_some(goals));
            goals += u32::from(!servos.tick(&mut machine).is_empty());
        }
        assert_eq!(refusals, [(Command::Queue { clip: 1, repeats: false }, PlayError::QueueFull)]);
        assert!(machine.at_rest() && script.tick() == Some(900), "{:?}", script.tick());
    }
}

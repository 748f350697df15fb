//! Commands by the clock: what a show does at which tick.

use crate::library::{LIVE, Library};
use crate::machine::{Command, Machine, State};
use crate::play_error::PlayError;
use crate::sender::Sender;

/// What happens at a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The machine is told something.
    Command(Command),
    /// A clip is streamed, and plays as soon as enough of it is there.
    Stream {
        /// Its number among the sender's clips.
        clip: u16,
    },
    /// What is sent is lost.
    Gap {
        /// For so many ticks.
        ticks: u32,
    },
}

/// Orders with their ticks, in order. Tick 0 is the first one in which servos are given goals: before, it depends on
/// the servos how long the puppet looks for them.
#[derive(Clone, Copy)]
pub struct Script<'s, 'l> {
    orders: &'s [(u32, Order)],
    sender: Sender<'s, 'l>,
    /// The tick that comes, once goals have been sent.
    tick: Option<u32>,
}

impl<'s, 'l> Script<'s, 'l> {
    /// Before the first tick. The machine's library has the sender's stream.
    pub const fn new(orders: &'s [(u32, Order)], sender: Sender<'s, 'l>) -> Self {
        Self { orders, sender, tick: None }
    }

    /// What sends streams.
    pub const fn sender(&self) -> &Sender<'s, 'l> {
        &self.sender
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
        self.sender.look();
        while let (Some(tick), Some(((due, order), rest))) = (self.tick, self.orders.split_first())
            && *due <= tick
        {
            self.orders = rest;
            let (command, taken) = match *order {
                Order::Command(command) => (command, machine.command(command)),
                Order::Stream { clip } => {
                    (Command::Play { clip: LIVE, repeats: false }, self.sender.stream(clip))
                }
                Order::Gap { ticks } => {
                    self.sender.lose(ticks);
                    continue;
                }
            };
            if let Err(error) = taken {
                refused(command, error);
            }
        }
        if let Some(tick) = self.tick {
            self.sender.tick(tick, machine, &mut refused);
        }
        !(self.orders.is_empty() && machine.at_rest() && !self.sender.waits())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::test_puppet::{FormulaClips, map};
    use crate::machine::{IdealServos, Show, Start};
    use crate::map::Settings;
    use crate::mixer::QUEUE;
    use crate::sender::{STREAM, StreamMemory};
    use crate::stream::Live;

    #[test]
    fn commands_are_given_at_their_ticks_and_the_end_comes_after_them() {
        let map = map(Settings::new(100));
        let show = Show { playlist: &[1], ..Show::default() };
        let mut machine = Machine::new(&map, FormulaClips::default(), show, Start::Power);
        let mut servos = IdealServos::new(&machine);
        let full = (0..=QUEUE as u32).map(|_| (120, Command::Queue { clip: 1, repeats: false }));
        let orders: Vec<_> = [(50, Command::Pause), (110, Command::Resume)]
            .into_iter()
            .chain(full)
            .chain([(130, Command::Home), (900, Command::Trigger)])
            .map(|(tick, command)| (tick, Order::Command(command)))
            .collect();
        let mut memory = StreamMemory::new();
        let live = Live::new(memory.lend().0, STREAM);
        let mut script = Script::new(&orders, Sender::new(&[], &live));
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

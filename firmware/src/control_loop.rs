//! Carries out a machine's plans on a servo bus, tick by tick.

use crate::collect::collect;
use crate::fault::Feedback;
use crate::library::Library;
use crate::machine::{Action, Machine, State};
use heapless::Vec;
use servo_wire::bus::{Reading, ServoBus};

/// What surrounds a puppet: its clock, those who command it, and the controller's watchdog.
#[allow(async_fn_in_trait, reason = "one task drives the puppet; nothing needs these futures to be Send")]
pub trait Surroundings<L: Library, const N: usize> {
    /// Returns when tick `tick` is due, at [`JointMap::tick_micros`](crate::map::JointMap::tick_micros) after tick 0;
    /// true where the tick after it was due already.
    async fn wait(&mut self, tick: u32) -> bool;

    /// Before each tick: gives the machine its commands, and takes what there is to report. False ends the drive.
    fn control(&mut self, machine: &mut Machine<'_, L, N>, feedback: &Feedback<'_>) -> bool;

    /// After each tick in which the machine has decided and the bus has come back, however both went: feeds
    /// the controller's watchdog.
    fn feed(&mut self);
}

/// Drives a puppet until [`Surroundings::control`] ends it; returns the number of ticks.
///
/// A tick is: goals to all servos, the output's action, readings of all servos. So a servo that is turned on has a goal. `bus` has the joints of the map in their
/// order, and returns within times that it states, so that nothing here can hang.
pub async fn control_loop<L, B, S, const N: usize>(
    machine: &mut Machine<'_, L, N>,
    bus: &mut B,
    surroundings: &mut S,
) -> u32
where
    L: Library,
    B: ServoBus,
    S: Surroundings<L, N>,
{
    let ids: Vec<u8, N> = collect(machine.map().joints().iter().map(|joint| joint.id));
    let mut readings: Vec<Option<Reading>, N> = collect(ids.iter().map(|_| None));
    let (mut sent, mut acted, mut tick) = (Ok(()), None, 0);
    loop {
        let late = surroundings.wait(tick).await;
        let feedback = Feedback { readings: &readings, bus: sent, action: acted, late };
        if !surroundings.control(machine, &feedback) {
            return tick;
        }
        let output = machine.tick(&feedback);
        sent = if output.goals.is_empty() { Ok(()) } else { bus.write_goals(output.goals).await };
        acted = match output.action {
            Some(action) => Some(act(bus, &ids, action).await),
            None => None,
        };
        if machine.state() == State::Finding {
            readings.fill(None);
        } else {
            let read = bus.read_all(&ids, &mut readings).await;
            sent = sent.and(read);
        }
        surroundings.feed();
        tick = tick.wrapping_add(1);
    }
}

async fn act<B: ServoBus>(bus: &mut B, ids: &[u8], action: Action) -> Result<(), servo_wire::bus::BusError> {
    match action {
        Action::Ping { servo } => bus.ping(ids, servo).await,
        Action::TorqueOn { servo } => bus.set_torque(ids, servo, true).await,
        Action::TorqueOff => {
            let mut all = Ok(());
            for servo in 0..ids.len() {
                // Those that can be reached are let go, whatever the others do.
                all = bus.set_torque(ids, servo, false).await.and(all);
            }
            all
        }
        Action::LetGo { servo } => bus.set_torque(ids, servo, false).await,
        Action::Reboot { servo } => bus.reboot(ids, servo).await,
        Action::Watchdog { millis } => match bus.set_watchdog(ids, millis).await {
            // Hobby servos have none.
            Err(servo_wire::bus::BusError::Unsupported) => Ok(()),
            result => result,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::test_puppet::{FormulaClips, SERVOS, map};
    use crate::machine::{Show, Start};
    use crate::map::Settings;
    use core::future::Future;
    use core::pin::pin;
    use core::task::{Context, Poll, Waker};
    use servo_wire::bus::{BusError, Goal};

    fn ready<T>(future: impl Future<Output = T>) -> T {
        match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(value) => value,
            Poll::Pending => panic!("nothing here waits"),
        }
    }

    /// What the bus was asked, in order.
    #[derive(Debug, PartialEq, Eq)]
    enum Asked {
        Ping(usize),
        Torque(usize, bool),
        Goals(Vec<i32, 4>),
        Read,
        Reboot(usize),
        Watchdog(u16),
    }

    #[derive(Default)]
    struct Bench {
        asked: std::vec::Vec<Asked>,
        position: [i32; SERVOS],
        torque: [bool; SERVOS],
    }

    impl ServoBus for Bench {
        fn reads(&self, _: usize) -> bool {
            true
        }
        async fn ping(&mut self, _: &[u8], index: usize) -> Result<(), BusError> {
            self.asked.push(Asked::Ping(index));
            Ok(())
        }
        async fn set_torque(&mut self, _: &[u8], index: usize, on: bool) -> Result<(), BusError> {
            self.asked.push(Asked::Torque(index, on));
            self.torque[index] = on;
            // One servo never lets go.
            if index == 0 && !on { Err(BusError::NoReply) } else { Ok(()) }
        }
        async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
            assert!(goals.iter().map(|goal| goal.id).eq(1..=SERVOS as u8));
            self.asked.push(Asked::Goals(goals.iter().map(|goal| goal.position).collect()));
            for (index, goal) in goals.iter().enumerate() {
                if self.torque[index] {
                    self.position[index] = goal.position;
                }
            }
            Ok(())
        }
        async fn read_all(&mut self, ids: &[u8], readings: &mut [Option<Reading>]) -> Result<(), BusError> {
            assert_eq!(ids.len(), readings.len());
            self.asked.push(Asked::Read);
            for (index, reading) in readings.iter_mut().enumerate() {
                *reading = Some(Reading {
                    position: self.position[index],
                    temperature: None,
                    millivolts: None,
                    load: None,
                    hardware_error: 0,
                    torque: Some(self.torque[index]),
                });
            }
            Ok(())
        }
        async fn reboot(&mut self, _: &[u8], index: usize) -> Result<(), BusError> {
            self.asked.push(Asked::Reboot(index));
            Ok(())
        }
        async fn set_watchdog(&mut self, _: &[u8], millis: u16) -> Result<(), BusError> {
            self.asked.push(Asked::Watchdog(millis));
            Err(BusError::Unsupported)
        }
    }

    struct Script {
        until: u32,
        fed: u32,
        ticks: u32,
    }

    impl Surroundings<FormulaClips, 4> for Script {
        async fn wait(&mut self, tick: u32) -> bool {
            assert_eq!(tick, self.ticks);
            false
        }
        fn control(&mut self, machine: &mut Machine<'_, FormulaClips, 4>, feedback: &Feedback<'_>) -> bool {
            assert_eq!(feedback.readings.len(), SERVOS);
            self.ticks += 1;
            self.ticks <= self.until && !machine.at_rest()
        }
        fn feed(&mut self) {
            self.fed += 1;
        }
    }

    #[test]
    fn servos_are_found_read_and_turned_on_where_they_are() {
        let map = map(Settings::new(100));
        let show = Show { playlist: &[1], ..Show::default() };
        let mut machine = Machine::new(&map, FormulaClips::default(), show, Start::Power);
        let mut bus = Bench { position: [2100, 1900, 2000], ..Bench::default() };
        let mut script = Script { until: 2000, fed: 0, ticks: 0 };
        let ticks = ready(control_loop(&mut machine, &mut bus, &mut script));
        assert_eq!((script.fed, script.ticks), (ticks, ticks + 1));
        assert_eq!(machine.state(), State::Resting);
        assert_eq!(bus.position, [2000; SERVOS]);
        let goals = || Asked::Goals([2100, 1900, 2000].into_iter().collect());
        let expected = [
            Asked::Ping(0),
            Asked::Ping(1),
            Asked::Ping(2),
            Asked::Read,
            goals(),
            Asked::Watchdog(0),
            Asked::Read,
            goals(),
            Asked::Torque(0, true),
            Asked::Read,
            goals(),
            Asked::Torque(1, true),
            Asked::Read,
            goals(),
            Asked::Torque(2, true),
            Asked::Read,
        ];
        assert_eq!(bus.asked[..expected.len()], expected);
        // A bus without watchdogs is asked once, not for ever.
        let asked = bus.asked.iter().filter(|asked| **asked == Asked::Watchdog(200)).count();
        assert_eq!(asked, 1);
    }

    #[test]
    fn those_that_can_be_let_go_are() {
        let mut bus = Bench { torque: [true; SERVOS], ..Bench::default() };
        assert_eq!(ready(act(&mut bus, &[1, 2, 3], Action::TorqueOff)), Err(BusError::NoReply));
        assert_eq!(bus.torque, [false; SERVOS]);
    }
}

//! Carries out a machine's plans on a servo bus, tick by tick.

use crate::bus::{Reading, ServoBus};
use crate::fault::Feedback;
use crate::machine::{Action, Machine, State};
use crate::stage::Library;
use heapless::Vec;

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
/// A tick is: goals to all servos, the plan's action, readings of all servos. So a servo that is turned on has a goal. `bus` has the joints of the map in their
/// order, and returns within times that it states, so that nothing here can hang.
pub async fn drive<L, B, S, const N: usize>(
    machine: &mut Machine<'_, L, N>,
    bus: &mut B,
    surroundings: &mut S,
) -> u32
where
    L: Library,
    B: ServoBus,
    S: Surroundings<L, N>,
{
    let ids: Vec<u8, N> = machine.map().joints().iter().map(|joint| joint.id).collect();
    let mut readings: Vec<Option<Reading>, N> = ids.iter().map(|_| None).collect();
    let (mut sent, mut acted, mut tick) = (Ok(()), None, 0);
    loop {
        let late = surroundings.wait(tick).await;
        let feedback = Feedback { readings: &readings, bus: sent, action: acted, late };
        if !surroundings.control(machine, &feedback) {
            return tick;
        }
        let plan = machine.tick(&feedback);
        sent = if plan.goals.is_empty() { Ok(()) } else { bus.write_goals(plan.goals).await };
        acted = match plan.action {
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

async fn act<B: ServoBus>(bus: &mut B, ids: &[u8], action: Action) -> Result<(), crate::bus::BusError> {
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
        Action::Reboot { servo } => bus.reboot(ids, servo).await,
        Action::Watchdog { millis } => match bus.set_watchdog(ids, millis).await {
            // Hobby servos have none.
            Err(crate::bus::BusError::Unsupported) => Ok(()),
            result => result,
        },
    }
}

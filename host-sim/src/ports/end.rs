//! What is done with servos at the end of a run: they are let go, or hold with their watchdogs disarmed.

use super::clock::Clock;
use super::serial::block_on;
use crate::puppet::joint_names::JointNames;
use servo_wire::bus::{BusError, ServoBus};
use std::time::Duration;

/// How often a servo is asked to let go, and how long after it was asked the last time: as long as a machine has patience.
const LET_GO_TRIES: u32 = firmware::machine::LET_GO_MILLIS as u32 / 100;
const LET_GO_EVERY: Duration = Duration::from_millis(100);

/// How often a servo is asked to disarm its watchdog.
const DISARM_TRIES: usize = 3;

/// Servos that may hold, by their place, and why.
pub(super) type Kept = Vec<(usize, BusError)>;

/// Turns torque off until each servo has confirmed it: one that can be read by reading so, another one by having been reached.
pub(super) fn let_go(bus: &mut impl ServoBus, ids: &[u8], clock: &impl Clock) -> Kept {
    let mut kept: Kept = (0..ids.len()).map(|index| (index, BusError::NoReply)).collect();
    for _ in 0..LET_GO_TRIES {
        for (index, why) in &mut kept {
            let off = block_on(bus.set_torque(ids, *index, false));
            // Where it answers, and reads that it holds, there is no other reason.
            *why = off.err().unwrap_or(BusError::Corrupt);
        }
        let mut readings = vec![None; ids.len()];
        // Why it is not read is told by each servo.
        let _ = block_on(bus.read_all(ids, &mut readings));
        kept.retain(|(index, why)| match readings[*index].map(|reading| reading.torque) {
            Some(Some(holds)) => holds,
            Some(None) => *why != BusError::Corrupt,
            None => bus.reads(*index) || *why != BusError::Corrupt,
        });
        if kept.iter().all(|(_, why)| *why == BusError::Unsupported) {
            break;
        }
        block_on(clock.until(clock.now() + LET_GO_EVERY));
    }
    kept
}

/// What letting go came to, as a sentence.
pub(super) fn told(kept: &Kept, servos: usize, names: &JointNames) -> String {
    let each = kept.iter().map(|(index, why)| match (names.servo(*index), why) {
        (servo, BusError::Unsupported) => format!("{servo} cannot be let go"),
        (servo, BusError::Corrupt) => {
            format!("{servo} may still hold: it has not confirmed that its torque is off")
        }
        (servo, why) => format!("{servo} may still hold: {why}"),
    });
    let each: Vec<String> = each.collect();
    match each.as_slice() {
        [] => "torque is off".to_owned(),
        each => format!("torque is off, but for {} of {servos} servos: {}", each.len(), each.join(", ")),
    }
}

/// Disarms the watchdogs of servos that hold or were let go, so that the next player's goals are taken. Gives a sentence about those
/// whose watchdogs may still be armed: those of `kept`, which are left so, and those that do not answer.
pub(super) fn disarm(
    bus: &mut impl ServoBus,
    ids: &[u8],
    kept: &[usize],
    names: &JointNames,
) -> Option<String> {
    let mut silent = Vec::new();
    let mut armed = Vec::new();
    for index in 0..ids.len() {
        let mut disarm = || match block_on(bus.disarm_watchdog(ids, index)) {
            Ok(()) | Err(BusError::Unsupported) => None,
            Err(error) => Some(error),
        };
        if kept.contains(&index) {
            armed.push(index);
        } else if (0..DISARM_TRIES).all(|_| disarm().is_some()) {
            silent.push(index);
        }
    }
    let stopped = "stops its motor by itself, holds, and turns goals down until a player sets its watchdog";
    let mut told = Vec::new();
    if !armed.is_empty() {
        told.push(format!(
            "the watchdog stays armed of {}: a servo that has one {stopped}",
            names.servos(armed)
        ));
    }
    if !silent.is_empty() {
        told.push(format!(
            "the watchdog may still be armed of {}, which did not confirm that it is not: a servo whose watchdog is armed {stopped}",
            names.servos(silent)
        ));
    }
    (!told.is_empty()).then(|| told.join("; "))
}

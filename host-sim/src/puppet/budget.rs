//! What a tick costs on the wires: bytes, time, and the tick rate that leaves.

use firmware::map::BusKind;
use puppet_file::{Map, Puppet};
use serde::Serialize;
use servo_wire::blender::FRAME_LEN;
use servo_wire::dynamixel::packet::OVERHEAD as OVERHEAD_2;
use servo_wire::feetech::{self, Series};
use servo_wire::protocol1::packet::OVERHEAD as OVERHEAD_1;
use servo_wire::{dynamixel, protocol1};

/// A tick on one bus. Bytes are those without stuffing, which adds one wherever goals or ids hold `FF FF FD`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BusTime {
    /// The bus's name in puppet.toml.
    pub name: String,
    /// What it speaks.
    #[serde(skip)]
    pub kind: BusKind,
    /// Bits per second; of hobby servos the pulses per second.
    pub baud: u32,
    /// Servos on it.
    pub servos: usize,
    /// Bytes that give the servos their goals.
    pub goal_bytes: usize,
    /// Bytes that ask them where they are.
    pub question_bytes: usize,
    /// Bytes that they answer.
    pub answer_bytes: usize,
    /// How often the wire waits for an answer to begin.
    pub waits: usize,
    /// Microseconds of a tick; 0 for hobby servos, whose wire is no part of a tick.
    pub micros: f64,
}

/// The buses of a puppet, and what a tick takes on each with this return delay time.
pub fn bus_times(puppet: &Puppet, map: &Map, return_delay_us: f64) -> Vec<BusTime> {
    let names = puppet.bus_names();
    let times = map.buses().iter().zip(names).enumerate().map(|(index, (spec, name))| {
        let servos = map.joints().iter().filter(|joint| usize::from(joint.bus) == index).count();
        let [goal_bytes, question_bytes, answer_bytes, waits] = bytes(spec.kind, servos);
        let bytes = goal_bytes + question_bytes + answer_bytes;
        let micros = bytes as f64 * 1e7 / f64::from(spec.baud) + waits as f64 * return_delay_us;
        let (kind, baud) = (spec.kind, spec.rate());
        BusTime { name, kind, baud, servos, goal_bytes, question_bytes, answer_bytes, waits, micros }
    });
    times.collect()
}

/// Bytes of goals, questions and answers, and how many answers begin by themselves.
fn bytes(kind: BusKind, servos: usize) -> [usize; 4] {
    if servos == 0 {
        return [0; 4];
    }
    // All protocols of Feetech and the first of ROBOTIS write two bytes of goal a servo.
    let goals_1 = OVERHEAD_1 + 2 + 3 * servos;
    let rest = |all: usize, goals: usize, questions: usize| all - goals - questions;
    let one_by_one = servos * (OVERHEAD_1 + 2);
    match kind {
        BusKind::Dynamixel => {
            let (goals, question) = (OVERHEAD_2 + 4 + 5 * servos, OVERHEAD_2 + 4 + servos);
            [goals, question, rest(dynamixel::bus::tick_bytes(servos), goals, question), 1]
        }
        BusKind::Dynamixel1 => {
            [goals_1, one_by_one, rest(protocol1::bus::tick_bytes(servos), goals_1, one_by_one), servos]
        }
        BusKind::Sts => {
            let question = OVERHEAD_1 + 2 + servos;
            [goals_1, question, rest(feetech::tick_bytes(Series::Sts, servos), goals_1, question), servos]
        }
        BusKind::Scs => {
            [goals_1, one_by_one, rest(feetech::tick_bytes(Series::Scs, servos), goals_1, one_by_one), servos]
        }
        BusKind::Blender => [FRAME_LEN * servos, 0, 0, 0],
        BusKind::Pwm | BusKind::Pca9685 => [0; 4],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_servos_take_what_docs_buses_says() {
        let sum = |kind| bytes(kind, 20).iter().take(3).sum::<usize>();
        assert_eq!(bytes(BusKind::Dynamixel, 20), [114, 34, 328, 1]);
        assert_eq!(sum(BusKind::Dynamixel), 476);
        assert_eq!(sum(BusKind::Dynamixel1), 748);
        assert_eq!(sum(BusKind::Sts), 736);
        assert_eq!(sum(BusKind::Scs), 868);
        assert_eq!(bytes(BusKind::Dynamixel, 0), [0; 4]);
    }
}

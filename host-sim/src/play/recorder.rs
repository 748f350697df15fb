//! Virtual servos on a line, and what they are told.

use super::recording::{Recording, Taken, seconds};
use anyhow::{Result, bail};
use firmware::map::{BusKind, Joint};
use puppet_file::Map;
use servo_wire::dynamixel::table::GOAL_POSITION;
use servo_wire::dynamixel::{Framer, Instruction, Packet};
use servo_wire::pca9685::OSCILLATOR_HZ;
use virtual_servos::config::{ConfigError, ServoConfig};
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::hobby::Pins;
use virtual_servos::virtual_bus::{Disturbance, Event, VirtualBus};

/// Longest packet of a player with 32 servos.
const LONGEST: usize = 640;

/// Virtual servos on a line where each packet of goal positions is one tick, whenever it arrives. What is answered comes at
/// the end of the tick.
pub(crate) struct Recorder<'m> {
    map: &'m Map,
    servos: DynamixelServos,
    framer: Framer<LONGEST>,
    /// The bytes of the packet that is not yet whole.
    packet: Vec<u8>,
    recording: Recording,
    /// What went wrong first.
    fault: Option<String>,
    /// Whether servos may refuse, and miss goals.
    disturbed: bool,
    /// Whether the last packet was a read of one servo that nobody answered.
    unanswered: bool,
    /// Goals that servos on the line took.
    taken: usize,
    /// Servos on the line.
    on_line: usize,
    /// Number of the bus that is the line.
    line: u8,
    /// Servos on pins: kind and number of their bus, and their ids.
    on_pins: Vec<(BusKind, u8, u8)>,
    /// Ticks after which pins were looked at last.
    looked: u32,
}

impl<'m> Recorder<'m> {
    /// A servo for every joint, at the joint's zero.
    ///
    /// # Errors
    /// A sentence for a puppet that has other servos than Dynamixel X on one bus.
    pub(crate) fn new(map: &'m Map) -> Result<Self> {
        let recorder = Self::with_pins(map)?;
        if !recorder.on_pins.is_empty() || map.buses().len() != 1 {
            bail!("the virtual servos are Dynamixel X on one bus, and this puppet has others");
        }
        Ok(recorder)
    }

    /// As [`new`](Self::new), and hobby servos on a board's pins.
    ///
    /// # Errors
    /// A sentence for a puppet that has others.
    pub(crate) fn with_pins(map: &'m Map) -> Result<Self> {
        let kind = |joint: &Joint| map.buses().get(usize::from(joint.bus)).map(|bus| bus.kind);
        if !has_servos_for(map) {
            bail!(
                "the virtual servos are Dynamixel X on one bus and hobby servos on one board's pins, and this puppet has \
                 others: `bunraku servos` serves them on ports"
            );
        }
        let joints = || map.joints().iter();
        let servos = joints()
            .filter(|joint| kind(joint) == Some(BusKind::Dynamixel))
            .map(|joint| ServoConfig { position: joint.home, ..ServoConfig::new(joint.id) });
        let config = DynamixelConfig { servos: servos.collect(), ..DynamixelConfig::with_ids(&[]) };
        let on_pins = joints().filter_map(|joint| Some((kind(joint)?, joint.bus, joint.id)));
        let line =
            map.buses().iter().position(|bus| bus.kind == BusKind::Dynamixel).unwrap_or_default() as u8;
        Ok(Self {
            map,
            servos: DynamixelServos::new(&config)?,
            framer: Framer::new(),
            packet: Vec::new(),
            recording: Recording::default(),
            fault: None,
            disturbed: false,
            unanswered: false,
            taken: 0,
            on_line: config.servos.len(),
            line,
            on_pins: on_pins.filter(|(kind, ..)| *kind != BusKind::Dynamixel).collect(),
            looked: 0,
        })
    }

    /// Takes down what servos on pins are told at the end of a tick. A puppet with no others has its first tick where one of them
    /// is told something.
    pub(crate) fn end_tick(&mut self, pins: &Pins) {
        let Self { map, recording, on_pins, looked, on_line, .. } = self;
        let oscillator_hz = map.oscillator_hz().unwrap_or(OSCILLATOR_HZ);
        let pulse_us = |kind: BusKind, id: u8| match kind {
            BusKind::Pwm => pins.pwm_us(id),
            BusKind::Pca9685 => pins.pca9685_us(id, oscillator_hz),
            _ => None,
        };
        let pulses = on_pins.iter().filter_map(|&(kind, bus, id)| Some((bus, id, pulse_us(kind, id)?)));
        let pulses: Vec<(u8, u8, i32)> = pulses.collect();
        if *on_line == 0 && (recording.ticks > 0 || !pulses.is_empty()) {
            recording.ticks += 1;
        }
        if *looked == recording.ticks {
            return;
        }
        *looked = recording.ticks;
        let time_us = map.tick_micros(recording.ticks - 1);
        recording.goals.extend(pulses.into_iter().map(|(bus, id, position)| Taken {
            time_us,
            bus,
            id,
            position,
        }));
    }

    /// Has something happen to the servos at a tick; what they refuse and miss is no failure of the recording then.
    pub(crate) fn schedule(&mut self, tick: u32, disturbance: Disturbance) -> Result<(), ConfigError> {
        self.disturbed = true;
        self.servos.schedule(self.map.tick_micros(tick), disturbance)
    }

    /// Lets servos refuse and miss goals, and packets be garbled.
    pub(crate) const fn bear_all(&mut self) {
        self.disturbed = true;
    }

    /// Takes what came of a packet; what is then not whole will not be.
    pub(crate) fn receive_packet(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut answers = self.receive(bytes);
        if !self.packet.is_empty() {
            self.framer.clear();
            answers.extend(self.pass_on());
        }
        answers
    }

    /// Ticks so far.
    pub(crate) const fn ticks(&self) -> u32 {
        self.recording.ticks
    }

    /// Takes bytes off the line and gives what the servos answer.
    pub(crate) fn receive(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut answers = Vec::new();
        for byte in bytes {
            self.packet.push(*byte);
            let (goals, read) = match self.framer.feed(&mut std::slice::from_ref(byte)) {
                None => continue,
                Some(Ok(packet)) => (is_tick(&packet), packet.instruction == Instruction::Read as u8),
                Some(Err(_)) if self.disturbed => (false, false),
                Some(Err(error)) => {
                    self.fault.get_or_insert_with(|| format!("noise on the servo bus: {error}"));
                    (false, false)
                }
            };
            // While no servo answers, none is told its goal, and one of them is asked each tick.
            let silent = read && self.unanswered;
            if goals || silent {
                self.look();
            }
            self.recording.ticks += u32::from(silent);
            let answer = self.pass_on();
            self.unanswered = read && answer.is_empty();
            answers.extend(answer);
            self.recording.ticks += u32::from(goals);
        }
        answers
    }

    /// Notes where the servos are.
    fn look(&mut self) {
        let Self { map, servos, recording, .. } = self;
        servos.advance_to(map.tick_micros(recording.ticks));
        let present = map.joints().iter().map(|joint| servos.position(joint.id).unwrap_or(joint.home));
        recording.present.push(present.collect());
    }

    /// Gives the servos the packet.
    fn pass_on(&mut self) -> Vec<u8> {
        let Self { map, servos, packet, recording, fault, disturbed, taken, line: bus, .. } = self;
        let time_us = map.tick_micros(recording.ticks);
        let mut tap = |event| match event {
            Event::Goal { id, position, .. } => {
                *taken += 1;
                recording.goals.push(Taken { time_us, bus: *bus, id, position });
            }
            Event::Refused { .. } if *disturbed => recording.refused += 1,
            Event::Refused { id, error, .. } => {
                fault.get_or_insert_with(|| {
                    format!("servo {id} refused what it was told at {} s: {error:?}", seconds(time_us))
                });
            }
        };
        let answers = servos.receive(packet, time_us, &mut tap);
        packet.clear();
        answers
    }

    /// What was recorded, if it arrived whole.
    pub(crate) fn finish(self) -> Result<Recording> {
        let (recording, sound) = self.end();
        sound.map(|()| recording)
    }

    /// What was recorded, and whether it arrived whole.
    pub(crate) fn end(self) -> (Recording, Result<()>) {
        let sound = self.check();
        (self.recording, sound)
    }

    fn check(&self) -> Result<()> {
        if let Some(fault) = &self.fault {
            bail!("{fault}");
        }
        if !self.packet.is_empty() {
            bail!("the last packet on the servo bus was cut after {} bytes", self.packet.len());
        }
        let (ticks, goals) = (self.recording.ticks, self.taken);
        let expected = ticks as usize * self.on_line;
        if !self.disturbed && goals != expected {
            bail!("the servos took {goals} goals in {ticks} ticks, expected {expected}");
        }
        Ok(())
    }
}

/// Whether a recorder has the servos of a puppet: Dynamixel X on one bus, and hobby servos on one board's pins.
pub fn has_servos_for(map: &Map) -> bool {
    map.buses().iter().enumerate().all(|(index, bus)| {
        let here = matches!(bus.kind, BusKind::Dynamixel | BusKind::Pwm | BusKind::Pca9685);
        here && map.buses().iter().take(index).all(|other| other.kind != bus.kind)
    })
}

fn is_tick(packet: &Packet<'_>) -> bool {
    packet.instruction == Instruction::SyncWrite as u8
        && packet.parameters.starts_with(&GOAL_POSITION.address.to_le_bytes())
}

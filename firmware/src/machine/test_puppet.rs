//! A puppet for tests: clips from formulas, and servos that can be harmed, which look at what they are told.

use super::*;
use crate::fault::{Feedback, UNHEARD_TICKS};
use crate::frames::Frames;
use crate::library::Library;
use crate::map::{BusKind, BusSpec, Idle, Joint, JointMap, Settings};
use crate::play_error::PlayError;
use decoder_core::{Error, Field, I16F16};
use servo_wire::bus::{BusError, Reading};
use std::collections::HashMap;

pub(crate) const SERVOS: usize = 3;
pub(crate) const HZ: u16 = 100;

/// Clips of one channel a servo, from formulas.
#[derive(Default)]
pub(crate) struct FormulaClips {
    pub(crate) open: usize,
    pub(crate) damaged_at: Option<u32>,
}

pub(crate) struct FormulaFrames {
    pub(crate) clip: u16,
    pub(crate) next: u32,
    pub(crate) frame: [I16F16; SERVOS],
    pub(crate) damaged_at: Option<u32>,
}

pub(crate) const DAMAGED: Error = Error::Checksum { field: Field::CodeTables, at: 0, expected: 1, found: 2 };

pub(crate) const FRAMES: u32 = 240;

pub(crate) fn value(clip: u16, frame: u32, channel: usize) -> I16F16 {
    let phase = f64::from(frame) / 60.0 + channel as f64 + f64::from(clip);
    I16F16::from_num(20.0 * f64::from(clip) + 30.0 * phase.sin())
}

impl Frames for FormulaFrames {
    fn channels(&self) -> usize {
        SERVOS
    }
    fn frames(&self) -> u32 {
        FRAMES
    }
    fn rate_centihertz(&self) -> u16 {
        6_000
    }
    fn position(&self) -> u32 {
        self.next
    }
    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        if self.damaged_at == Some(self.next) {
            return Err(DAMAGED);
        }
        if self.next >= FRAMES {
            return Ok(None);
        }
        for channel in 0..SERVOS {
            self.frame[channel] = value(self.clip, self.next, channel);
        }
        self.next += 1;
        Ok(Some(&self.frame))
    }
    fn approach(&mut self, frame: u32) {
        if self.next > frame {
            self.next = 0;
        }
    }
}

impl Library for FormulaClips {
    type Frames = FormulaFrames;

    fn open(&mut self, clip: u16) -> Result<FormulaFrames, PlayError> {
        if clip > 3 {
            return Err(PlayError::NoClip { clip });
        }
        self.open += 1;
        assert!(self.open <= 2, "memory for two decoders is enough");
        Ok(FormulaFrames { clip, next: 0, frame: [I16F16::ZERO; SERVOS], damaged_at: self.damaged_at })
    }

    fn has(&self, clip: u16) -> bool {
        clip <= 3
    }

    fn close(&mut self, _: FormulaFrames) {
        self.open -= 1;
    }
}

pub(crate) fn joint(id: u8) -> Joint {
    Joint {
        channel: u16::from(id) - 1,
        bus: 0,
        id,
        zero: 2048,
        home: 2000,
        scale: I16F16::lit("11.378"),
        min: 500,
        max: 3500,
        max_velocity: 60 << 10,
        max_acceleration: 6 << 10,
        idle: Idle { breathing: 10, sway: 5, gaze: 20 },
    }
}

pub(crate) fn map(settings: Settings) -> JointMap<4> {
    let buses = [BusSpec { kind: BusKind::Dynamixel, baud: 1_000_000 }].into_iter().collect();
    JointMap::new(settings, buses, (1..=SERVOS as u8).map(joint).collect()).unwrap()
}

/// A servo that is where it was told to be at once, if its torque is on.
#[derive(Clone, Copy)]
pub(crate) struct TestServo {
    pub(crate) position: i32,
    pub(crate) torque: bool,
    pub(crate) silent: bool,
    pub(crate) hardware_error: u8,
    pub(crate) temperature: u8,
}

/// What a motor does with its goal.
pub(crate) type Odd = fn(&mut TestServo, i32);

pub(crate) struct TestPuppet<'m> {
    pub(crate) machine: Machine<'m, FormulaClips, 4>,
    pub(crate) motors: [TestServo; SERVOS],
    pub(crate) bus: Result<(), BusError>,
    pub(crate) late: bool,
    pub(crate) action: Option<Result<(), BusError>>,
    pub(crate) actions: Vec<Action>,
    /// What the last tick read.
    pub(crate) readings: [Option<Reading>; SERVOS],
    /// What each motor was told last, and how far that was from what it was told before.
    pub(crate) told: HashMap<usize, i32>,
    pub(crate) velocity: [Option<i32>; SERVOS],
    /// Motors that the last tick reached.
    pub(crate) reached: [bool; SERVOS],
    /// The longest way that a motor was told to go at once.
    pub(crate) longest: i32,
    pub(crate) tick: u32,
    pub(crate) watched: Option<u16>,
    /// A motor that does something else with its goal than to go there at once.
    pub(crate) odd: Option<(usize, Odd)>,
    /// Whether motors forget their turns as their torque comes on, as in position mode.
    pub(crate) wraps: bool,
}

impl<'m> TestPuppet<'m> {
    pub(crate) fn new(map: &'m JointMap<4>, show: Show<'m>, positions: [i32; SERVOS]) -> Self {
        let motor = |position| TestServo {
            position,
            torque: false,
            silent: false,
            hardware_error: 0,
            temperature: 30,
        };
        Self {
            machine: Machine::new(map, FormulaClips::default(), show, Start::Power),
            motors: positions.map(motor),
            bus: Ok(()),
            late: false,
            action: None,
            actions: Vec::new(),
            readings: [None; SERVOS],
            told: HashMap::new(),
            velocity: [None; SERVOS],
            reached: [false; SERVOS],
            longest: 0,
            tick: 0,
            watched: None,
            odd: None,
            wraps: false,
        }
    }

    /// Reads the motors.
    pub(crate) fn read(&mut self) {
        let bus = self.bus.is_ok();
        self.readings = self.motors.map(|motor| {
            (!motor.silent && bus).then_some(Reading {
                position: motor.position,
                temperature: Some(motor.temperature),
                millivolts: Some(12_000),
                load: None,
                hardware_error: motor.hardware_error,
                torque: Some(motor.torque),
            })
        });
    }

    /// A tick, with what must hold in each. As on a bus, motors are read after they were told: what happens between two ticks
    /// happens between a reading and the next goal.
    pub(crate) fn tick(&mut self) {
        let readings = self.readings;
        let feedback =
            Feedback { readings: &readings, bus: self.bus, action: self.action.take(), late: self.late };
        let output = self.machine.tick(&feedback);
        let (action, goals) = (output.action, output.goals.to_vec());
        for (index, goal) in goals.iter().enumerate() {
            let joint = joint(goal.id);
            let motor = &mut self.motors[index];
            let reaches = motor.torque && !motor.silent && self.bus.is_ok();
            let reached = std::mem::replace(&mut self.reached[index], reaches);
            let (step, way) = (self.told.insert(index, goal.position), goal.position - motor.position);
            let step = step.map(|last| goal.position - last);
            let before = std::mem::replace(&mut self.velocity[index], step);
            if !reaches {
                continue;
            }
            if let Some((_, act)) = self.odd.filter(|(odd, _)| *odd == index) {
                act(&mut self.motors[index], goal.position);
                continue;
            }
            let motor = &mut self.motors[index];
            let at = format!("servo {index} at {}: {goal:?} in tick {}", motor.position, self.tick);
            // One that was not reached is told what it would have been told a tick or two after it was.
            let most = if reached { 1 } else { i32::from(UNHEARD_TICKS) };
            assert!(way.abs() <= most * 60 + 1, "{at}, {most} ticks' movement at most");
            if let (true, Some(step), Some(before)) = (reached, step, before) {
                assert!((step - before).abs() <= 8, "{at}, {step} from the last, after {before}");
            }
            let inwards = motor.position < joint.min && way >= 0 || motor.position > joint.max && way <= 0;
            assert!(way.abs() <= 7 || inwards || (joint.min..=joint.max).contains(&goal.position), "{at}");
            self.longest = self.longest.max(way.abs());
            motor.position = goal.position;
        }
        if goals.is_empty() {
            self.told.clear();
            self.velocity = [None; SERVOS];
            self.reached = [false; SERVOS];
        }
        self.action = action.map(|action| self.act(action));
        self.actions.extend(action);
        self.read();
        self.tick += 1;
    }

    pub(crate) fn act(&mut self, action: Action) -> Result<(), BusError> {
        self.bus?;
        let reach = |motor: &TestServo| if motor.silent { Err(BusError::NoReply) } else { Ok(()) };
        match action {
            Action::Ping { servo } => reach(&self.motors[servo]),
            Action::TorqueOn { servo } => {
                let motor = &mut self.motors[servo];
                reach(motor)?;
                if motor.hardware_error != 0 {
                    return Err(BusError::Refused(7));
                }
                let told = self.told[&servo];
                assert!((told - motor.position).abs() <= 7, "{told} is told where {} is", motor.position);
                motor.torque = true;
                if self.wraps {
                    motor.position = motor.position.rem_euclid(4096);
                }
                Ok(())
            }
            Action::TorqueOff => {
                let reached = self.motors.iter_mut().filter(|motor| !motor.silent);
                reached.for_each(|motor| motor.torque = false);
                self.motors.iter().try_for_each(reach)
            }
            Action::LetGo { servo } => {
                let motor = &mut self.motors[servo];
                reach(motor)?;
                motor.torque = false;
                Ok(())
            }
            Action::Reboot { servo } => {
                let motor = &mut self.motors[servo];
                reach(motor)?;
                (motor.torque, motor.hardware_error) = (false, 0);
                Ok(())
            }
            Action::Watchdog { millis } => {
                self.watched = Some(millis);
                Ok(())
            }
        }
    }

    /// Ticks until `done`; how many it took.
    pub(crate) fn until(&mut self, limit: u32, done: impl Fn(&Self) -> bool) -> u32 {
        let start = self.tick;
        while !done(self) {
            assert!(self.tick - start < limit, "still {:?} after {limit} ticks", self.machine.state());
            self.tick();
        }
        self.tick - start
    }

    pub(crate) fn until_state(&mut self, limit: u32, state: State) -> u32 {
        self.until(limit, |puppet| puppet.machine.state() == state)
    }

    pub(crate) fn positions(&self) -> [i32; SERVOS] {
        self.motors.map(|motor| motor.position)
    }
}

pub(crate) const ONE: &[u16] = &[1];

pub(crate) fn show() -> Show<'static> {
    Show { playlist: ONE, ..Show::default() }
}

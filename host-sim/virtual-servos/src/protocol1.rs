//! Virtual servos with the frame of protocol 1.0: Dynamixel AX and MX, Feetech STS and SCS.
//!
//! They move as fast as they can, unless their mode or a torque limit of 0 lets them not move, and never fail by themselves. A goal without torque is kept until torque comes on,
//! so that a player which turns a servo on without telling it where it is sees it jump.

use crate::config::{ConfigError, ServoConfig, check};
use crate::group::{ServoGroup, SimulatedServo};
use crate::motion::Motion;
use crate::protocol1_models::{Model, Protocol1Family};
use crate::virtual_bus::{Disturbance, Event, VirtualBus};
use servo_wire::dynamixel::ErrorNumber;
use servo_wire::protocol1::packet::{BROADCAST_ID, Framer, Instruction, OVERHEAD, Packet, write};

/// Longest packet there is.
const LONGEST: usize = 259;

/// Microseconds in a step of the motion.
const STEP_US: u64 = 1000;

/// Error bits of a Dynamixel: the instruction is none, a parameter is out of range, the goal is beyond the angle
/// limits.
const BAD_INSTRUCTION: u8 = 1 << 6;
const BAD_RANGE: u8 = 1 << 3;
const BAD_ANGLE: u8 = 1 << 1;

struct Protocol1Servo {
    model: &'static Model,
    memory: Vec<u8>,
    /// What its EEPROM has without power.
    stored: Vec<u8>,
    motion: Motion,
    /// What Reg Write left for Action: address and bytes.
    registered: Option<(u8, Vec<u8>)>,
    now_us: u64,
}

impl Protocol1Servo {
    fn new(model: &'static Model, config: ServoConfig, number: u16) -> Self {
        let motion = Motion::new(f64::from(config.position));
        let mut servo =
            Self { model, memory: factory(model), stored: Vec::new(), motion, registered: None, now_us: 0 };
        servo.set(model.model_at, number.to_le_bytes());
        servo.memory[usize::from(model.id_at)] = config.id;
        for (at, limit) in [(0, config.min_position), (2, config.max_position)] {
            servo.set(model.limits_at + at, model.bytes(limit as u16));
        }
        servo.set(model.goal_at, model.bytes(config.position as u16));
        servo.stored = servo.memory[..model.ram].to_vec();
        servo.publish();
        servo
    }

    fn set(&mut self, at: u8, [first, second]: [u8; 2]) {
        let at = usize::from(at);
        (self.memory[at], self.memory[at + 1]) = (first, second);
    }

    fn word(&self, at: u8) -> i32 {
        let at = usize::from(at);
        self.model.value([self.memory[at], self.memory[at + 1]]).into()
    }

    fn torque(&self) -> bool {
        self.memory[usize::from(self.model.torque_at)] != 0
    }

    /// The lowest and the highest position that it takes.
    fn limits(&self) -> (i32, i32) {
        (self.word(self.model.limits_at), self.word(self.model.limits_at + 2))
    }

    /// Whether a goal moves it: by its mode, and by the torque that it is allowed.
    fn obeys_positions(&self) -> bool {
        let takes_positions = match self.model.mode_at {
            Some(at) => self.memory[usize::from(at)] == 0,
            None => self.limits() != (0, 0),
        };
        takes_positions && self.word(self.model.torque_limit_at) != 0
    }

    fn reads_answered(&self) -> bool {
        self.model.feetech || self.memory[usize::from(self.model.level_at)] > 0
    }

    fn answers_all(&self) -> bool {
        self.memory[usize::from(self.model.level_at)] >= self.model.level_all
    }

    fn read(&self, at: u8, len: u8) -> Result<&[u8], u8> {
        self.memory.get(usize::from(at)..).and_then(|bytes| bytes.get(..usize::from(len))).ok_or(BAD_RANGE)
    }

    /// Writes and returns the goal position, if there is one in it.
    fn write(&mut self, at: u8, bytes: &[u8]) -> Result<Option<i32>, u8> {
        let end = usize::from(at) + bytes.len();
        let writable = |at: usize| {
            let is_in = |from: u8, len: u8| (usize::from(from)..usize::from(from + len)).contains(&at);
            self.model.registers.iter().any(|register| register.writable && is_in(register.at, register.len))
        };
        if bytes.is_empty() || !(usize::from(at)..end).all(writable) {
            return Err(BAD_RANGE);
        }
        let keeps = self.model.lock_at.is_none_or(|lock| self.memory[usize::from(lock)] == 0);
        let before = self.memory.clone();
        self.memory[usize::from(at)..end].copy_from_slice(bytes);
        let goal_at = self.model.goal_at;
        let goal = (at <= goal_at && end >= usize::from(goal_at) + 2).then(|| self.word(goal_at));
        let Some(goal) = goal else {
            for at in (usize::from(at)..end.min(self.model.ram)).filter(|_| keeps) {
                self.stored[at] = self.memory[at];
            }
            self.drive();
            return Ok(None);
        };
        // Limits of 0 and 0 are none: the servo turns round and round.
        let limits = Some(self.limits()).filter(|limits| *limits != (0, 0));
        if let (false, Some((lowest, highest))) = (self.model.feetech, limits)
            && !(lowest..=highest).contains(&goal)
        {
            self.memory = before;
            return Err(BAD_ANGLE);
        }
        let goal = limits.map_or(goal, |(lowest, highest)| goal.min(highest).max(lowest));
        self.set(goal_at, self.model.bytes(goal as u16));
        self.drive();
        Ok(Some(goal))
    }

    /// Sets off for the goal, or lets go.
    fn drive(&mut self) {
        if self.torque() && self.obeys_positions() {
            let goal = f64::from(self.word(self.model.goal_at));
            self.motion.go_to(goal, self.model.speed, f64::INFINITY, true);
        } else {
            self.motion.release();
        }
        self.publish();
    }

    fn publish(&mut self) {
        let position = self.motion.position.round() as u16;
        self.set(self.model.present_at, self.model.bytes(position));
        self.memory[usize::from(self.model.moving_at)] = u8::from(!self.motion.at_rest());
    }
}

/// The table as it leaves the factory.
fn factory(model: &Model) -> Vec<u8> {
    let mut memory = vec![0; model.len];
    for register in model.registers {
        let at = usize::from(register.at);
        match register.len {
            2 => memory[at..at + 2].copy_from_slice(&model.bytes(register.value)),
            _ => memory[at] = register.value as u8,
        }
    }
    memory
}

impl SimulatedServo for Protocol1Servo {
    fn id(&self) -> u8 {
        self.memory[usize::from(self.model.id_at)]
    }

    fn position(&self) -> i32 {
        self.motion.position.round() as i32
    }

    fn advance_to(&mut self, now_us: u64) {
        while self.now_us + STEP_US <= now_us {
            if self.motion.at_rest() {
                self.now_us += (now_us - self.now_us) / STEP_US * STEP_US;
                break;
            }
            self.motion.step();
            self.now_us += STEP_US;
        }
        self.publish();
    }

    fn reboot(&mut self) {
        let ram = self.model.ram;
        self.memory[..ram].copy_from_slice(&self.stored);
        self.memory[ram..].copy_from_slice(&factory(self.model)[ram..]);
        self.motion.release();
        self.registered = None;
        self.set(self.model.goal_at, self.model.bytes(self.motion.position.round() as u16));
        self.publish();
    }

    fn turn(&mut self, position: i32) {
        if !self.torque() {
            self.motion.position = f64::from(position);
            self.publish();
        }
    }

    fn set(&mut self, address: u16, value: i64) {
        let Ok(at) = u8::try_from(address) else { return };
        let known = self.model.registers.iter().find(|register| register.at == at);
        let limit = [self.model.limits_at, self.model.limits_at + 2].contains(&at);
        if at == self.model.model_at || limit || known.is_some_and(|register| register.len == 2) {
            // Model numbers have their low byte first, whatever the rest has.
            let low_first = at == self.model.model_at;
            let bytes = if low_first { (value as u16).to_le_bytes() } else { self.model.bytes(value as u16) };
            self.set(at, bytes);
        } else if let Some(byte) = self.memory.get_mut(usize::from(at)) {
            *byte = value as u8;
        }
        let ram = self.model.ram;
        self.stored.copy_from_slice(&self.memory[..ram]);
        self.drive();
    }
}

/// Virtual servos of one family on a bus.
///
/// As with [`DynamixelServos`](crate::dynamixel_bus::DynamixelServos), rates and delays have no effect.
pub struct Protocol1Servos {
    /// The family's usual model, whose byte order and instructions all of the family have.
    model: &'static Model,
    framer: Framer<LONGEST>,
    group: ServoGroup<Protocol1Servo>,
    byte_gap_us: u64,
    heard_us: u64,
}

impl Protocol1Servos {
    /// Servos whose power comes on at time 0, torque off; each with its model number, if it is not the usual one.
    ///
    /// `byte_gap_us`: silence in microseconds after which half a packet is given up.
    ///
    /// # Errors
    /// [`ConfigError`] for an id out of range or used twice and for impossible limits.
    pub fn new(
        family: Protocol1Family,
        servos: &[(ServoConfig, Option<u16>)],
        byte_gap_us: u64,
    ) -> Result<Self, ConfigError> {
        let mut all = Vec::new();
        for &(config, number) in servos {
            let model = Model::of(family, number);
            check(&[config], model.most)?;
            all.push(Protocol1Servo::new(model, config, number.unwrap_or(model.number)));
        }
        check(&servos.iter().map(|(config, _)| *config).collect::<Vec<_>>(), i32::MAX)?;
        let model = Model::of(family, None);
        Ok(Self { model, framer: Framer::new(), group: ServoGroup::new(all), byte_gap_us, heard_us: 0 })
    }
}

impl VirtualBus for Protocol1Servos {
    fn receive(&mut self, bytes: &[u8], now_us: u64, tap: &mut dyn FnMut(Event)) -> Vec<u8> {
        let Self { model, framer, group, .. } = self;
        let Some(servos) = group.reached_at(now_us) else { return Vec::new() };
        let mut instructions = Instructions { model, now_us, tap, out: Vec::new() };
        if now_us.saturating_sub(self.heard_us) > self.byte_gap_us {
            while let Some(packet) = framer.flush() {
                instructions.execute(servos, &packet);
            }
        }
        self.heard_us = now_us;
        let mut bytes = bytes;
        while let Some(packet) = framer.feed(&mut bytes) {
            instructions.execute(servos, &packet);
        }
        instructions.out
    }

    fn schedule(&mut self, at_us: u64, disturbance: Disturbance) -> Result<(), ConfigError> {
        self.group.schedule(at_us, disturbance)
    }
}

/// Carries out instructions on servos.
struct Instructions<'a> {
    model: &'static Model,
    now_us: u64,
    tap: &'a mut dyn FnMut(Event),
    out: Vec<u8>,
}

impl Instructions<'_> {
    /// Carries out a packet.
    fn execute(&mut self, servos: &mut [Protocol1Servo], packet: &Packet<'_>) {
        let Packet { id, code, parameters } = *packet;
        const SYNC_READ: u8 = Instruction::SyncRead as u8;
        const SYNC_WRITE: u8 = Instruction::SyncWrite as u8;
        match (id, code, parameters) {
            (BROADCAST_ID, SYNC_WRITE, &[at, len, ref values @ ..]) => {
                for value in values.chunks_exact(1 + usize::from(len)) {
                    if let Some(servo) = servos.iter_mut().find(|servo| servo.id() == value[0]) {
                        // Nobody answers.
                        let _ = self.write(servo, at, &value[1..]);
                    }
                }
            }
            (BROADCAST_ID, SYNC_READ, &[at, len, ref ids @ ..]) if self.model.sync_read => {
                for id in ids {
                    let servo = servos.iter().find(|servo| servo.id() == *id);
                    if let Some((servo, Ok(bytes))) = servo.map(|servo| (servo, servo.read(at, len))) {
                        self.answer(servo.id(), 0, bytes);
                    }
                }
            }
            (BROADCAST_ID, ..) => {
                for servo in servos {
                    let _ = self.carry_out(servo, code, parameters);
                }
            }
            _ => {
                let Some(servo) = servos.iter_mut().find(|servo| servo.id() == id) else { return };
                let ping = code == Instruction::Ping as u8;
                let read = code == Instruction::Read as u8 && servo.reads_answered();
                let answers = ping || read || servo.answers_all();
                let silent = self.model.feetech && code == Instruction::Reboot as u8;
                let done = self.carry_out(servo, code, parameters);
                if !answers || silent {
                    return;
                }
                match done {
                    Ok(bytes) => self.answer(id, 0, &bytes),
                    Err(_) if self.model.feetech => self.answer(id, 0, &[]),
                    Err(error) => self.answer(id, error, &[]),
                }
            }
        }
    }

    /// What one servo does; its answer's parameters, or its error bits.
    fn carry_out(&mut self, servo: &mut Protocol1Servo, code: u8, parameters: &[u8]) -> Result<Vec<u8>, u8> {
        let is = |instruction: Instruction| code == instruction as u8;
        match parameters {
            [] if is(Instruction::Ping) => Ok(Vec::new()),
            &[at, len] if is(Instruction::Read) => Ok(servo.read(at, len)?.to_vec()),
            [at, bytes @ ..] if is(Instruction::Write) => self.write(servo, *at, bytes),
            [at, bytes @ ..] if is(Instruction::RegWrite) => {
                servo.registered = Some((*at, bytes.to_vec()));
                Ok(Vec::new())
            }
            [] if is(Instruction::Action) => {
                let (at, bytes) = servo.registered.take().ok_or(BAD_INSTRUCTION)?;
                self.write(servo, at, &bytes)
            }
            [] if is(Instruction::Reboot) && self.model.feetech => {
                servo.reboot();
                Ok(Vec::new())
            }
            _ => Err(BAD_INSTRUCTION),
        }
    }

    fn write(&mut self, servo: &mut Protocol1Servo, at: u8, bytes: &[u8]) -> Result<Vec<u8>, u8> {
        let (id, time_us) = (servo.id(), self.now_us);
        match servo.write(at, bytes) {
            Ok(Some(position)) => (self.tap)(Event::Goal { time_us, id, position }),
            Ok(None) => {}
            Err(error) => {
                let number = if error == BAD_ANGLE { ErrorNumber::DataLimit } else { ErrorNumber::Access };
                (self.tap)(Event::Refused { time_us, id, error: number });
                return Err(error);
            }
        }
        Ok(Vec::new())
    }

    fn answer(&mut self, id: u8, error: u8, parameters: &[u8]) {
        let mut buffer = [0; LONGEST];
        debug_assert!(OVERHEAD + parameters.len() <= LONGEST, "a table is shorter");
        self.out.extend(write(&mut buffer, id, error, &[parameters]).unwrap_or_default());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(id: u8, code: u8, parameters: &[u8]) -> Vec<u8> {
        write(&mut [0; LONGEST], id, code, &[parameters]).unwrap().to_vec()
    }

    fn bus(family: Protocol1Family, ids: &[u8], position: i32) -> Protocol1Servos {
        let most = family.max_position(None);
        let servo = |&id: &u8| {
            (ServoConfig { position, min_position: 100, max_position: most, ..ServoConfig::new(id) }, None)
        };
        Protocol1Servos::new(family, &ids.iter().map(servo).collect::<Vec<_>>(), 1500).unwrap()
    }

    /// The answers' error bytes and parameters.
    fn ask(bus: &mut Protocol1Servos, now_us: u64, bytes: &[u8]) -> Vec<(u8, u8, Vec<u8>)> {
        let answer = bus.receive(bytes, now_us, &mut |_| {});
        let (mut framer, mut rest, mut packets) = (Framer::<LONGEST>::new(), &answer[..], Vec::new());
        while let Some(packet) = framer.feed(&mut rest) {
            packets.push((packet.id, packet.code, packet.parameters.to_vec()));
        }
        packets
    }

    /// The e-Manual's examples: ping, read the temperature, and what answers them.
    #[test]
    fn an_ax_answers_as_in_the_manual() {
        let mut bus = bus(Protocol1Family::AxMx, &[1], 512);
        let quiet = &mut |_| {};
        assert_eq!(
            bus.receive(&[0xFF, 0xFF, 0x01, 0x02, 0x01, 0xFB], 0, quiet),
            [0xFF, 0xFF, 0x01, 0x02, 0x00, 0xFC]
        );
        assert_eq!(
            bus.receive(&[0xFF, 0xFF, 0x01, 0x04, 0x02, 0x2B, 0x01, 0xCC], 0, quiet),
            [0xFF, 0xFF, 0x01, 0x03, 0x00, 30, 0xDD]
        );
        // Goals beyond the limits, and what nobody may write, are refused.
        assert_eq!(ask(&mut bus, 0, &packet(1, 3, &[30, 50, 0])), [(1, BAD_ANGLE, vec![])]);
        assert_eq!(ask(&mut bus, 0, &packet(1, 3, &[36, 50, 0])), [(1, BAD_RANGE, vec![])]);
        assert_eq!(ask(&mut bus, 0, &packet(1, 8, &[])), [(1, BAD_INSTRUCTION, vec![])]);
        assert_eq!(ask(&mut bus, 0, &packet(2, 1, &[])), []);
    }

    #[test]
    fn each_series_moves_where_it_is_told_once_it_holds() {
        for family in [Protocol1Family::AxMx, Protocol1Family::Sts, Protocol1Family::Scs] {
            let mut bus = bus(family, &[7, 9], 600);
            let model = bus.model;
            let mut taken = Vec::new();
            let goal = |value: u16| {
                let [first, second] = model.bytes(value);
                packet(BROADCAST_ID, 0x83, &[model.goal_at, 2, 7, first, second, 9, first, second])
            };
            let mut tap = |event| taken.push(event);
            assert!(bus.receive(&goal(700), 0, &mut tap).is_empty());
            assert_eq!([7, 9].map(|id| Event::Goal { time_us: 0, id, position: 700 }).to_vec(), taken);
            let present = |bus: &mut Protocol1Servos, now_us| {
                let answers = ask(bus, now_us, &packet(7, 2, &[model.present_at, 2]));
                let (7, 0, bytes) = &answers[0] else { panic!("{answers:?}") };
                model.value([bytes[0], bytes[1]])
            };
            assert_eq!(present(&mut bus, 900_000), 600);
            assert_eq!(ask(&mut bus, 900_000, &packet(7, 3, &[model.torque_at, 1])), [(7, 0, vec![])]);
            let early = present(&mut bus, 910_000);
            assert!(600 < early && early < 700, "{early}");
            assert_eq!(present(&mut bus, 2_000_000), 700);
            assert_eq!(bus.group.position(9), Some(600), "{family:?}");
            // After its supply broke in it is away, then there and slack.
            bus.schedule(2_000_000, Disturbance::Restart { servo: 7 }).unwrap();
            assert_eq!(ask(&mut bus, 2_100_000, &packet(7, 1, &[])), []);
            let torque = ask(&mut bus, 2_400_000, &packet(7, 2, &[model.torque_at, 1]));
            assert_eq!(torque, [(7, 0, vec![0])]);
        }
    }

    #[test]
    fn only_sts_are_read_together_and_feetech_clamps() {
        let question = packet(BROADCAST_ID, 0x82, &[56, 2, 9, 8, 7]);
        let mut sts = bus(Protocol1Family::Sts, &[7, 9], 600);
        assert_eq!(ask(&mut sts, 0, &question), [(9, 0, vec![88, 2]), (7, 0, vec![88, 2])]);
        assert_eq!(ask(&mut bus(Protocol1Family::Scs, &[7, 9], 600), 0, &question), []);
        let mut taken = Vec::new();
        sts.receive(&packet(7, 3, &[42, 5, 0]), 0, &mut |event| taken.push(event));
        assert_eq!(taken, [Event::Goal { time_us: 0, id: 7, position: 100 }]);
    }

    #[test]
    fn what_a_locked_servo_is_written_is_forgotten_without_power() {
        for (family, lock) in [
            (Protocol1Family::Sts, Some(55)),
            (Protocol1Family::Scs, Some(48)),
            (Protocol1Family::AxMx, None),
        ] {
            for unlocks in [false, true] {
                let mut bus = bus(family, &[7], 600);
                let mut write = |id: u8, at: u8, value: u8| {
                    assert_eq!(ask(&mut bus, 0, &packet(id, 3, &[at, value])), [(id, 0, vec![])]);
                };
                if let Some(lock) = lock.filter(|_| unlocks) {
                    write(7, lock, 0);
                }
                write(7, Model::of(family, None).id_at, 9);
                bus.schedule(0, Disturbance::Restart { servo: 9 }).unwrap();
                let kept = unlocks || lock.is_none();
                let ids = [(7, !kept), (9, kept)];
                for (id, there) in ids {
                    assert_eq!(
                        !ask(&mut bus, 1_000_000, &packet(id, 1, &[])).is_empty(),
                        there,
                        "{family:?} {id}"
                    );
                }
            }
        }
    }

    #[test]
    fn half_a_packet_does_not_swallow_the_next() {
        let mut bus = bus(Protocol1Family::Scs, &[7], 600);
        assert_eq!(ask(&mut bus, 0, &[0xFF, 0xFF, 7, 250, 3]), []);
        assert_eq!(ask(&mut bus, 5_000, &packet(7, 1, &[])), [(7, 0, vec![])]);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let servo = |id, max_position| (ServoConfig { max_position, ..ServoConfig::new(id) }, None);
        let error =
            |servos: &[_]| Protocol1Servos::new(Protocol1Family::Scs, servos, 0).err().map(|e| e.to_string());
        assert!(error(&[servo(1, 1023)]).is_none());
        assert!(error(&[servo(1, 1024)]).unwrap().contains("within 0 to 1023"));
        assert!(error(&[servo(1, 1023), servo(1, 1023)]).unwrap().contains("twice"));
    }
}

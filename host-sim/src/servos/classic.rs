//! Virtual servos with the frame of protocol 1.0: Dynamixel AX and MX, Feetech STS and SCS.
//!
//! They move as fast as they can and never fail by themselves. A goal without torque is kept until torque comes on, so that a
//! player which turns a servo on without telling it where it is sees it jump.

use super::bus::{ConfigError, Event, Wire};
use super::crowd::{Crowd, Deed, Shaft, check};
use super::motion::Motion;
use super::series::Series;
use super::servo::ServoConfig;
use firmware::map::BusKind;
use servo_wire::dynamixel::ErrorNumber;
use servo_wire::protocol1::packet::{BROADCAST_ID, Framer, Instruction, OVERHEAD, Packet, write};

/// Longest packet there is.
const LONGEST: usize = 259;

/// Microseconds in a step of the motion.
const STEP_US: u64 = 1000;

/// Error bits of a Dynamixel: the instruction is none, a parameter is out of range, the goal is beyond the angle limits.
const BAD_INSTRUCTION: u8 = 1 << 6;
const BAD_RANGE: u8 = 1 << 3;
const BAD_ANGLE: u8 = 1 << 1;

struct Servo {
    series: &'static Series,
    memory: Vec<u8>,
    motion: Motion,
    /// What Reg Write left for Action: address and bytes.
    registered: Option<(u8, Vec<u8>)>,
    now_us: u64,
}

impl Servo {
    fn new(series: &'static Series, config: ServoConfig, model: u16) -> Self {
        let motion = Motion::new(f64::from(config.position));
        let mut servo = Self { series, memory: factory(series), motion, registered: None, now_us: 0 };
        servo.set(series.model_at, model.to_le_bytes());
        servo.memory[usize::from(series.id_at)] = config.id;
        for (at, limit) in [(0, config.min_position), (2, config.max_position)] {
            servo.set(series.limits_at + at, series.bytes(limit as u16));
        }
        servo.set(series.goal_at, series.bytes(config.position as u16));
        servo.publish();
        servo
    }

    fn set(&mut self, at: u8, [first, second]: [u8; 2]) {
        let at = usize::from(at);
        (self.memory[at], self.memory[at + 1]) = (first, second);
    }

    fn word(&self, at: u8) -> i32 {
        let at = usize::from(at);
        self.series.value([self.memory[at], self.memory[at + 1]]).into()
    }

    fn torque(&self) -> bool {
        self.memory[usize::from(self.series.torque_at)] != 0
    }

    fn answers_all(&self) -> bool {
        self.memory[usize::from(self.series.level_at)] >= self.series.level_all
    }

    fn read(&self, at: u8, len: u8) -> Result<&[u8], u8> {
        self.memory.get(usize::from(at)..).and_then(|bytes| bytes.get(..usize::from(len))).ok_or(BAD_RANGE)
    }

    /// Writes and returns the goal position, if there is one in it.
    fn write(&mut self, at: u8, bytes: &[u8]) -> Result<Option<i32>, u8> {
        let end = usize::from(at) + bytes.len();
        let writable = |at: usize| {
            let is_in = |from: u8, len: u8| (usize::from(from)..usize::from(from + len)).contains(&at);
            self.series.registers.iter().any(|register| register.writable && is_in(register.at, register.len))
        };
        if bytes.is_empty() || !(usize::from(at)..end).all(writable) {
            return Err(BAD_RANGE);
        }
        let before = self.memory.clone();
        self.memory[usize::from(at)..end].copy_from_slice(bytes);
        let goal_at = self.series.goal_at;
        let goal = (at <= goal_at && end >= usize::from(goal_at) + 2).then(|| self.word(goal_at));
        let Some(goal) = goal else {
            self.drive();
            return Ok(None);
        };
        let limits = (self.word(self.series.limits_at), self.word(self.series.limits_at + 2));
        if !self.series.feetech && !(limits.0..=limits.1).contains(&goal) {
            self.memory = before;
            return Err(BAD_ANGLE);
        }
        let goal = goal.min(limits.1).max(limits.0);
        self.set(goal_at, self.series.bytes(goal as u16));
        self.drive();
        Ok(Some(goal))
    }

    /// Sets off for the goal, or lets go.
    fn drive(&mut self) {
        if self.torque() {
            let goal = f64::from(self.word(self.series.goal_at));
            self.motion.go_to(goal, self.series.speed, f64::INFINITY, true);
        } else {
            self.motion.release();
        }
        self.publish();
    }

    fn publish(&mut self) {
        let position = self.motion.position.round() as u16;
        self.set(self.series.present_at, self.series.bytes(position));
        self.memory[usize::from(self.series.moving_at)] = u8::from(!self.motion.at_rest());
    }
}

/// The table as it leaves the factory.
fn factory(series: &Series) -> Vec<u8> {
    let mut memory = vec![0; series.len];
    for register in series.registers {
        let at = usize::from(register.at);
        match register.len {
            2 => memory[at..at + 2].copy_from_slice(&series.bytes(register.value)),
            _ => memory[at] = register.value as u8,
        }
    }
    memory
}

impl Shaft for Servo {
    fn id(&self) -> u8 {
        self.memory[usize::from(self.series.id_at)]
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
        let ram = self.series.ram;
        self.memory[ram..].copy_from_slice(&factory(self.series)[ram..]);
        self.motion.release();
        self.registered = None;
        self.set(self.series.goal_at, self.series.bytes(self.motion.position.round() as u16));
        self.publish();
    }

    fn turn(&mut self, position: i32) {
        if !self.torque() {
            self.motion.position = f64::from(position);
            self.publish();
        }
    }
}

/// Virtual servos of one series on a bus. As on [`Bus`](super::Bus), rates and delays have no effect.
pub struct ClassicBus {
    series: &'static Series,
    framer: Framer<LONGEST>,
    crowd: Crowd<Servo>,
    byte_gap_us: u64,
    heard_us: u64,
}

impl ClassicBus {
    /// Servos whose power comes on at time 0, torque off; each with its model number, if it is not the usual one. None where
    /// servos of this kind of bus speak something else.
    ///
    /// # Errors
    /// [`ConfigError`] for an id out of range or used twice and for impossible limits.
    pub fn new(
        kind: BusKind,
        servos: &[(ServoConfig, Option<u16>)],
        byte_gap_us: u64,
    ) -> Result<Option<Self>, ConfigError> {
        let Some(series) = Series::of(kind, None) else { return Ok(None) };
        let mut all = Vec::new();
        for &(config, model) in servos {
            let series = Series::of(kind, model).unwrap_or(series);
            check(&[config], series.most)?;
            all.push(Servo::new(series, config, model.unwrap_or(series.model)));
        }
        check(&servos.iter().map(|(config, _)| *config).collect::<Vec<_>>(), i32::MAX)?;
        Ok(Some(Self { series, framer: Framer::new(), crowd: Crowd::new(all), byte_gap_us, heard_us: 0 }))
    }

    /// Positions of such servos are 0 to this; none where servos of this kind of bus speak something else.
    pub(super) fn most(kind: BusKind, model: Option<u16>) -> Option<i32> {
        Series::of(kind, model).map(|series| series.most)
    }
}

impl Wire for ClassicBus {
    fn receive(&mut self, bytes: &[u8], now_us: u64, tap: &mut dyn FnMut(Event)) -> Vec<u8> {
        let Self { series, framer, crowd, .. } = self;
        let Some(servos) = crowd.reached_at(now_us) else { return Vec::new() };
        let mut line = Line { series, now_us, tap, out: Vec::new() };
        if now_us.saturating_sub(self.heard_us) > self.byte_gap_us {
            while let Some(packet) = framer.flush() {
                line.execute(servos, &packet);
            }
        }
        self.heard_us = now_us;
        let mut bytes = bytes;
        while let Some(packet) = framer.feed(&mut bytes) {
            line.execute(servos, &packet);
        }
        line.out
    }

    fn schedule(&mut self, at_us: u64, deed: Deed) -> Result<(), ConfigError> {
        self.crowd.schedule(at_us, deed)
    }
}

struct Line<'a> {
    series: &'static Series,
    now_us: u64,
    tap: &'a mut dyn FnMut(Event),
    out: Vec<u8>,
}

impl Line<'_> {
    /// Carries out a packet.
    fn execute(&mut self, servos: &mut [Servo], packet: &Packet<'_>) {
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
            (BROADCAST_ID, SYNC_READ, &[at, len, ref ids @ ..]) if self.series.sync_read => {
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
                let read = [Instruction::Ping as u8, Instruction::Read as u8].contains(&code);
                let answers = read || servo.answers_all();
                let silent = self.series.feetech && code == Instruction::Reboot as u8;
                let done = self.carry_out(servo, code, parameters);
                if !answers || silent {
                    return;
                }
                match done {
                    Ok(bytes) => self.answer(id, 0, &bytes),
                    Err(_) if self.series.feetech => self.answer(id, 0, &[]),
                    Err(error) => self.answer(id, error, &[]),
                }
            }
        }
    }

    /// What one servo does; its answer's parameters, or its error bits.
    fn carry_out(&mut self, servo: &mut Servo, code: u8, parameters: &[u8]) -> Result<Vec<u8>, u8> {
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
            [] if is(Instruction::Reboot) && self.series.feetech => {
                servo.reboot();
                Ok(Vec::new())
            }
            _ => Err(BAD_INSTRUCTION),
        }
    }

    fn write(&mut self, servo: &mut Servo, at: u8, bytes: &[u8]) -> Result<Vec<u8>, u8> {
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

    fn bus(kind: BusKind, ids: &[u8], position: i32) -> ClassicBus {
        let most = ClassicBus::most(kind, None).unwrap();
        let servo = |&id: &u8| {
            (ServoConfig { position, min_position: 100, max_position: most, ..ServoConfig::new(id) }, None)
        };
        ClassicBus::new(kind, &ids.iter().map(servo).collect::<Vec<_>>(), 1500).unwrap().unwrap()
    }

    /// The answers' error bytes and parameters.
    fn ask(bus: &mut ClassicBus, now_us: u64, bytes: &[u8]) -> Vec<(u8, u8, Vec<u8>)> {
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
        let mut bus = bus(BusKind::Dynamixel1, &[1], 512);
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
        for kind in [BusKind::Dynamixel1, BusKind::Sts, BusKind::Scs] {
            let mut bus = bus(kind, &[7, 9], 600);
            let series = bus.series;
            let mut taken = Vec::new();
            let goal = |value: u16| {
                let [first, second] = series.bytes(value);
                packet(BROADCAST_ID, 0x83, &[series.goal_at, 2, 7, first, second, 9, first, second])
            };
            let mut tap = |event| taken.push(event);
            assert!(bus.receive(&goal(700), 0, &mut tap).is_empty());
            assert_eq!([7, 9].map(|id| Event::Goal { time_us: 0, id, position: 700 }).to_vec(), taken);
            let present = |bus: &mut ClassicBus, now_us| {
                let answers = ask(bus, now_us, &packet(7, 2, &[series.present_at, 2]));
                let (7, 0, bytes) = &answers[0] else { panic!("{answers:?}") };
                series.value([bytes[0], bytes[1]])
            };
            assert_eq!(present(&mut bus, 900_000), 600);
            assert_eq!(ask(&mut bus, 900_000, &packet(7, 3, &[series.torque_at, 1])), [(7, 0, vec![])]);
            let early = present(&mut bus, 910_000);
            assert!(600 < early && early < 700, "{early}");
            assert_eq!(present(&mut bus, 2_000_000), 700);
            assert_eq!(bus.crowd.position(9), Some(600), "{kind:?}");
            // After its supply broke in it is away, then there and slack.
            bus.schedule(2_000_000, Deed::Restart { servo: 7 }).unwrap();
            assert_eq!(ask(&mut bus, 2_100_000, &packet(7, 1, &[])), []);
            let torque = ask(&mut bus, 2_400_000, &packet(7, 2, &[series.torque_at, 1]));
            assert_eq!(torque, [(7, 0, vec![0])]);
        }
    }

    #[test]
    fn only_sts_are_read_together_and_feetech_clamps() {
        let question = packet(BROADCAST_ID, 0x82, &[56, 2, 9, 8, 7]);
        let mut sts = bus(BusKind::Sts, &[7, 9], 600);
        assert_eq!(ask(&mut sts, 0, &question), [(9, 0, vec![88, 2]), (7, 0, vec![88, 2])]);
        assert_eq!(ask(&mut bus(BusKind::Scs, &[7, 9], 600), 0, &question), []);
        let mut taken = Vec::new();
        sts.receive(&packet(7, 3, &[42, 5, 0]), 0, &mut |event| taken.push(event));
        assert_eq!(taken, [Event::Goal { time_us: 0, id: 7, position: 100 }]);
    }

    #[test]
    fn half_a_packet_does_not_swallow_the_next() {
        let mut bus = bus(BusKind::Scs, &[7], 600);
        assert_eq!(ask(&mut bus, 0, &[0xFF, 0xFF, 7, 250, 3]), []);
        assert_eq!(ask(&mut bus, 5_000, &packet(7, 1, &[])), [(7, 0, vec![])]);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let servo = |id, max_position| (ServoConfig { max_position, ..ServoConfig::new(id) }, None);
        let error = |servos: &[_]| ClassicBus::new(BusKind::Scs, servos, 0).err().map(|e| e.to_string());
        assert!(error(&[servo(1, 1023)]).is_none());
        assert!(error(&[servo(1, 1024)]).unwrap().contains("within 0 to 1023"));
        assert!(error(&[servo(1, 1023), servo(1, 1023)]).unwrap().contains("twice"));
        assert!(ClassicBus::new(BusKind::Pwm, &[], 0).unwrap().is_none());
    }
}

//! The whole way, with a fault at every packet of a session: machine, drive, client, port, wire, and the virtual servos of
//! `bunraku servos`. From finding the servos to rest, with an acknowledgement where a fault was latched.
#![allow(clippy::unwrap_used)]

use crate::servos2;
use crate::wire::{Fault as Struck, Servos, Wire};
use decoder_core::{Error, I16F16};
use embedded_hal_async::delay::DelayNs;
use firmware::control_loop::{Surroundings, control_loop};
use firmware::decoder_list::SingleClip;
use firmware::fault::{Fault, Feedback, UNHEARD_TICKS};
use firmware::frames::Frames;
use firmware::library::Library;
use firmware::limits::FINE_BITS;
use firmware::machine::{Command, Machine, Show, Start, State};
use firmware::map::{BusKind, BusSpec, Idle, Joint, JointMap, Policy, Settings};
use servo_wire::dynamixel::{DynamixelBus, DynamixelClient};
use servo_wire::port::{LineConfig, Port};
use std::collections::BTreeMap;
use virtual_servos::config::ServoConfig;
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::virtual_bus::{Disturbance, Event, VirtualBus};

const BAUD: u32 = 1_000_000;
const HZ: u16 = 100;
const TICK_US: u64 = 10_000;
const IDS: [u8; 3] = [1, 2, 7];
const HOME: i32 = 2048;
/// Goal units a tick.
const SPEED: i32 = 12;

/// Ticks after which a session has no end, and for how long a latched fault is looked at before it is acknowledged.
const MOST_TICKS: u32 = 1500;
const LOOKED_AT: u32 = 15;

/// In how many milliseconds from where a fault can be noticed a defined state is to be reached.
const DEFINED_MS: u64 = 100;

fn map(policy: Policy) -> JointMap<4> {
    let joint = |id: u8| Joint {
        channel: 0,
        bus: 0,
        id,
        zero: HOME,
        home: HOME,
        scale: I16F16::lit("11.378"),
        min: HOME - 400,
        max: HOME + 300,
        max_velocity: SPEED << FINE_BITS,
        max_acceleration: 4 << FINE_BITS,
        idle: Idle::default(),
    };
    let settings = Settings { policy, ease_millis: 80, ease_velocity: 256, ..Settings::new(HZ) };
    let buses = [BusSpec { kind: BusKind::Dynamixel, baud: BAUD }].into_iter().collect();
    JointMap::new(settings, buses, IDS.map(joint).into_iter().collect()).unwrap()
}

/// Half a swing in fifteen frames of one channel; it begins away from home.
struct Swing(u32, [I16F16; 1]);

impl Frames for Swing {
    fn channels(&self) -> usize {
        1
    }
    fn frames(&self) -> u32 {
        15
    }
    fn rate_centihertz(&self) -> u16 {
        100 * HZ
    }
    fn position(&self) -> u32 {
        self.0
    }
    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        if self.0 >= self.frames() {
            return Ok(None);
        }
        self.1 = [I16F16::from_num(6.0 - 5.0 * (f64::from(self.0) / 5.0).cos())];
        self.0 += 1;
        Ok(Some(&self.1))
    }
    fn approach(&mut self, frame: u32) {
        self.0 = frame;
    }
}

/// The virtual servos on the wire, and what is wrong with what they are told.
struct Virtual {
    bus: DynamixelServos,
    /// Tick that is on, and the one in which each servo took a goal last, with that.
    tick: u32,
    told: [Option<(u32, i32)>; IDS.len()],
    /// How many ticks late the wire may be.
    late: u32,
    wrong: Option<String>,
}

impl Virtual {
    fn new(fault: Option<(usize, Struck)>) -> Self {
        let servos =
            IDS.map(|id| ServoConfig { position: HOME - 20 * i32::from(id), ..ServoConfig::new(id) });
        // What comes after the next tick's goals is older than those.
        let late = matches!(fault, Some((_, Struck::Delay(micros))) if micros > TICK_US).into();
        let config = DynamixelConfig { servos: servos.to_vec(), ..DynamixelConfig::with_ids(&[]) };
        Self {
            bus: DynamixelServos::new(&config).unwrap(),
            tick: 0,
            told: [None; IDS.len()],
            late,
            wrong: None,
        }
    }
}

impl Servos for Virtual {
    fn hear(&mut self, bytes: &[u8], now_ns: u64) -> Vec<(u64, Vec<u8>)> {
        let now_us = now_ns / 1000;
        self.bus.advance_to(now_us);
        let present = IDS.map(|id| self.bus.position(id).unwrap());
        let Self { bus, tick, told, late, wrong } = self;
        let mut tap = |event| {
            let Event::Goal { id, position: goal, .. } = event else { return };
            let index = IDS.iter().position(|there| *there == id).unwrap();
            let last = told[index].replace((*tick, goal));
            let ticks = last.map_or(1, |(last, _)| (*tick - last).max(1)) + *late;
            // What a servo is told is never further than the limits let it move since it was told last: from there, or, where it
            // was lost, from where it is. And it is never further from there than the limits let it move in two ticks.
            let from_last = last.map_or(i32::MAX, |(_, last)| (goal - last).abs());
            let from_here = (goal - present[index]).abs();
            let inside = (HOME - 400..=HOME + 300).contains(&goal);
            let jumps = from_last.min(from_here) > SPEED * ticks as i32 + 1;
            if !inside || jumps || from_here > SPEED * (i32::from(UNHEARD_TICKS) + *late as i32) + 1 {
                let at = present[index];
                wrong.get_or_insert(format!(
                    "servo {id} at {at} is sent to {goal} in tick {tick}, {ticks} after the last"
                ));
            }
        };
        let answers = bus.receive(bytes, now_us, &mut tap);
        packets(&answers).into_iter().map(|packet| (0, packet)).collect()
    }

    fn seal(&self, packet: &mut [u8]) {
        servos2::seal(packet);
    }

    fn places(&self) -> (usize, usize) {
        (4, 5)
    }

    fn loosen(&mut self, servo: usize, micros: u64, now_ns: u64) {
        let silence = Disturbance::Silence { servo: IDS[servo], seconds: micros as f64 * 1e-6 };
        self.bus.schedule(now_ns / 1000, silence).unwrap();
    }

    fn refuse(&self, bytes: &[u8], number: u8) -> Vec<u8> {
        if bytes[4] != 0xFE {
            return servos2::packet(bytes[4], &[0x55, number]);
        }
        // In a joint answer the first part refuses: error, id, 12 bytes and a checksum are a part.
        let mut joint = bytes.to_vec();
        joint[8] = number;
        for end in (24..=joint.len()).step_by(16) {
            let sum = servos2::crc(&joint[..end - 2]);
            joint[end - 2..end].copy_from_slice(&sum.to_le_bytes());
        }
        joint
    }
}

/// Packets one by one. A joint answer in which a servo is missing ends early.
fn packets(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut rest = bytes;
    let mut packets = Vec::new();
    while let Some(&[low, high]) = rest.get(5..7) {
        let len = 7 + usize::from(u16::from_le_bytes([low, high]));
        let (packet, later) = rest.split_at(len.min(rest.len()));
        packets.push(packet.to_vec());
        rest = later;
    }
    packets
}

/// A fault that was latched.
#[derive(Clone, Copy, Debug)]
struct Latched {
    fault: Fault,
    /// The state that it struck in.
    during: State,
    at_us: u64,
    settled_us: Option<u64>,
}

/// What became of a session.
#[derive(Debug)]
struct Outcome {
    ticks: u32,
    packets: Vec<(bool, Vec<u8>)>,
    latched: Vec<Latched>,
    struck: Option<(u64, State)>,
}

struct Evening<'m> {
    wire: Wire<Virtual>,
    map: &'m JointMap<4>,
    ticks: u32,
    /// The state in the tick before.
    last: State,
    struck: Option<(u64, State)>,
    latched: Vec<Latched>,
    looked_at: u32,
    rested: u32,
}

impl<L: Library> Surroundings<L, 4> for Evening<'_> {
    async fn wait(&mut self, tick: u32) -> bool {
        let (now, due) = (self.wire.now_us(), self.map.tick_micros(tick));
        self.wire.delay_us(due.saturating_sub(now) as u32).await;
        self.wire.servos(|servos| servos.tick = tick);
        self.ticks = tick;
        now > due + TICK_US
    }

    fn control(&mut self, machine: &mut Machine<'_, L, 4>, _: &Feedback<'_>) -> bool {
        let now = self.wire.now_us();
        if self.struck.is_none() {
            self.struck = self.wire.struck_us().map(|at| (at, self.last));
        }
        let state = machine.state();
        let during = std::mem::replace(&mut self.last, state);
        if let Some(fault) = machine.fault() {
            if self.looked_at == 0 {
                self.latched.push(Latched { fault, during, at_us: now, settled_us: None });
                self.looked_at = 1;
            }
            // On its way home, at the pace of easing, it may be acknowledged too; and where a servo that is not heard has still to
            // confirm that it let go, as all others have by then.
            let settled = [State::Holding, State::Returning, State::Resting, State::Limp, State::LettingGo];
            if let (Some(latched), true) = (self.latched.last_mut(), settled.contains(&state)) {
                latched.settled_us.get_or_insert(now);
                self.looked_at += 1;
            }
            if self.looked_at > LOOKED_AT {
                machine.command(Command::Acknowledge).unwrap();
            }
            // A puppet that moves stops first.
            if machine.fault().is_none() {
                self.looked_at = 0;
            }
            return self.ticks < MOST_TICKS;
        }
        self.looked_at = 0;
        // What happens at the very end is still noticed.
        self.rested = if machine.at_rest() { self.rested + 1 } else { 0 };
        self.ticks < MOST_TICKS && self.rested <= LOOKED_AT
    }

    fn feed(&mut self) {}
}

/// Plays the session with a fault at one packet.
fn play(policy: Policy, fault: Option<(usize, Struck)>) -> Result<Outcome, String> {
    let map = map(policy);
    let wire = Wire::new(Virtual::new(fault), BAUD.into());
    let wire = match fault {
        Some((at, fault)) => wire.with_fault(at, fault),
        None => wire,
    };
    let port = Port::new(wire.clone(), wire.clone(), wire.clone(), LineConfig::uart(BAUD));
    let mut bus = DynamixelBus::<_, _, _>::new(DynamixelClient::new(port));
    let library = SingleClip::new(Swing(0, [I16F16::ZERO]), None);
    let mut machine = Machine::new(&map, library, Show { playlist: &[0], ..Show::default() }, Start::Power);
    let mut evening = Evening {
        wire: wire.clone(),
        map: &map,
        ticks: 0,
        last: State::Finding,
        struck: None,
        latched: Vec::new(),
        looked_at: 0,
        rested: 0,
    };
    wire.run(control_loop(&mut machine, &mut bus, &mut evening));
    if let Some(wrong) = wire.servos(|servos| servos.wrong.take()) {
        return Err(wrong);
    }
    let Evening { ticks, struck, latched, .. } = evening;
    if ticks >= MOST_TICKS || machine.fault().is_some() || machine.state() != State::Resting {
        return Err(format!(
            "after {ticks} ticks it is {:?} with {:?}, after {latched:?}",
            machine.state(),
            machine.fault()
        ));
    }
    // What was lost on the way is told again: all end at home.
    let ends = IDS.map(|id| wire.servos(|servos| servos.bus.position(id).unwrap()));
    if ends.iter().any(|end| (end - HOME).abs() > SPEED) {
        return Err(format!("the servos end at {ends:?}"));
    }
    Ok(Outcome { ticks, packets: wire.packets(), latched, struck })
}

/// Whether all cases are asked for, not only those that CI has time for.
fn all_asked_for() -> bool {
    std::env::var_os("BUNRAKU_ALL_FAULTS").is_some()
}

/// All faults of a packet of this length. Of its bits and of the times that a line is loose a few, spread over the packets,
/// unless all are asked for.
fn faults(from_servo: bool, len: usize, at: usize) -> Vec<Struck> {
    let all_bits = all_asked_for();
    let mut all = vec![Struck::Drop, Struck::Duplicate, Struck::Noise];
    all.extend([400, 6000].map(Struck::Again));
    all.extend([200, 3000, 12_000].map(Struck::Delay));
    all.extend([1, len as isize / 2, -1].map(Struck::Truncate));
    let step = if all_bits { 1 } else { 8 * len / 5 };
    all.extend((at % step..8 * len).step_by(step).map(Struck::Flip));
    all.extend((at % len..len).step_by(if all_bits { 1 } else { len.div_ceil(2) }).map(Struck::Lose));
    all.extend([1, 2, 33, 254].map(Struck::WrongId));
    all.extend([0, 2, len as u8, 255].map(Struck::BadLength));
    all.extend([-2, -1, 1].map(Struck::Resized));
    // Short of what counts as a fault, and long enough for the servos' own watchdogs.
    all.extend([1000, 25_000, 90_000, 300_000].map(Struck::StuckLow));
    all.extend([1000, 90_000].map(Struck::Broken));
    let loose = [10_000, 20_000, 30_000, 45_000, 60_000, 90_000, 300_000];
    let servos = (0..IDS.len()).filter(|servo| all_bits || servo % IDS.len() == at % IDS.len());
    all.extend(servos.flat_map(|servo| loose.map(|micros| Struck::Loose(servo, micros))));
    if from_servo {
        all.extend([1, 2, 4, 7, 128, 135].map(Struck::Refused));
    } else {
        all.push(Struck::Echo);
    }
    all
}

/// Whether a latched fault came to a defined state in time. While servos are still looked for, read or turned on, one at a
/// time and with patience, there is nothing that could move.
fn in_time(latched: &Latched, struck: Option<(u64, State)>) -> Result<(), String> {
    let Some(settled) = latched.settled_us else { return Err(format!("{latched:?} never settled")) };
    let before = [State::Finding, State::Reading, State::Arming];
    let (from, during) = struck.unwrap_or((latched.at_us, latched.during));
    let from =
        if before.contains(&during) || before.contains(&latched.during) { latched.at_us } else { from };
    let took = settled.saturating_sub(from) / 1000;
    if took > DEFINED_MS {
        Err(format!("{:?} during {:?} settled after {took} ms", latched.fault, latched.during))
    } else {
        Ok(())
    }
}

/// All faults at each packet, or at one of so many unless all are asked for.
fn matrix(policy: Policy, one_of: usize) -> usize {
    let one_of = if all_asked_for() { 1 } else { one_of };
    let clean = play(policy, None).unwrap();
    assert!(clean.latched.is_empty());
    let (mut cases, mut latched, mut slowest) = (BTreeMap::<String, usize>::new(), 0, 0);
    let mut wrong = Vec::new();
    for (at, (from_servo, packet)) in clean.packets.iter().enumerate().step_by(one_of) {
        for fault in faults(*from_servo, packet.len(), at) {
            let context = || {
                format!(
                    "{policy:?}: {fault:?} at packet {at} (of {}, from a servo: {from_servo})",
                    packet.len()
                )
            };
            let tried = play(policy, Some((at, fault))).and_then(|outcome| {
                outcome.latched.iter().try_for_each(|fault| in_time(fault, outcome.struck))?;
                Ok(outcome)
            });
            let outcome = match tried {
                Ok(outcome) => outcome,
                Err(error) => {
                    wrong.push(format!("{}: {error}", context()));
                    continue;
                }
            };
            latched += usize::from(!outcome.latched.is_empty());
            slowest = slowest.max(outcome.ticks);
            let name = format!("{fault:?}");
            *cases.entry(name.split('(').next().unwrap_or_default().to_owned()).or_default() += 1;
        }
    }
    assert!(wrong.is_empty(), "{} cases went wrong:\n{}", wrong.len(), wrong.join("\n"));
    let sum = cases.values().sum();
    println!(
        "{policy:?}: {sum} cases at {} packets, of which {latched} latched a fault; at most {slowest} ticks: {cases:?}",
        clean.packets.len()
    );
    sum
}

#[test]
fn every_fault_of_a_session_ends_at_rest_or_in_a_defined_state() {
    assert!(matrix(Policy::Hold, 1) > 10_000);
}

#[test]
fn so_it_does_where_a_fault_sends_the_puppet_home() {
    assert!(matrix(Policy::EaseHome, 4) > 2500);
}

#[test]
fn so_it_does_where_a_fault_lets_the_servos_go() {
    assert!(matrix(Policy::TorqueOff, 4) > 2500);
}

/// While a puppet moves, one packet that is lost or garbled, whichever it is, changes no goal of the rest of the session: noise
/// does not make it stutter. Only a length that is garbled to a great one may, for which servos wait while the rest of the
/// tick passes: then all have missed goals.
#[test]
fn one_lost_or_garbled_packet_changes_no_goal() {
    let goals = |outcome: &Outcome| -> Vec<Vec<u8>> {
        let sent = outcome.packets.iter().filter(|(from_servo, packet)| !from_servo && packet[7] == 0x83);
        sent.map(|(_, packet)| packet.clone()).collect()
    };
    let clean = play(Policy::Hold, None).unwrap();
    let expected = goals(&clean);
    let moves = expected.windows(2).position(|pair| pair[0] != pair[1]).unwrap();
    let start = clean.packets.iter().position(|(_, packet)| *packet == expected[moves + 1]).unwrap();
    let (mut cases, mut changed) = (0, 0);
    for at in start..clean.packets.len() {
        let faults = [
            Struck::Drop,
            Struck::Duplicate,
            Struck::Noise,
            Struck::Truncate(1),
            Struck::Truncate(-1),
            Struck::Flip(7 * at),
            Struck::Lose(at),
            Struck::WrongId(33),
            Struck::BadLength(2),
        ];
        for fault in faults {
            let outcome = play(Policy::Hold, Some((at, fault))).unwrap();
            let told = goals(&outcome);
            let length =
                matches!(fault, Struck::Flip(bit) if (5..7).contains(&(bit / 8 % clean.packets[at].1.len())));
            assert!(told == expected || length, "{fault:?} at packet {at}: {:?}", outcome.latched);
            (cases, changed) = (cases + 1, changed + usize::from(told != expected));
        }
    }
    println!("{cases} cases from packet {start} on, of which {changed} changed a goal");
    assert!(cases > 1500 && changed < cases / 100);
}

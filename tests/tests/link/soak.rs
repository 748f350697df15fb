//! A device for hours of simulated time: live streams, a monitor, and servos that fail. `BUNRAKU_SOAK_HOURS=10` plays ten hours, CI
//! a quarter of one.

use crate::fuzz::{DecoderList, shelf};
use decoder_core::mclip::{CodecId, PREFIX_BYTES, Prefix};
use embedded_hal_async::delay::DelayNs;
use encoder::mclip::{Encoder, Encoding, Quality};
use firmware::clips::LIVE;
use firmware::control_loop::{Surroundings, control_loop};
use firmware::device::{Device, Identity};
use firmware::fault::{Feedback, UNHEARD_TICKS};
use firmware::link::frame::{Deframer, OVERHEAD, wire_len, write};
use firmware::link::message::{ANSWER_BYTES, Answer, Event, REQUEST_BYTES, Request, Response, VERSION};
use firmware::link::session::Session;
use firmware::link::wire::decode_all;
use firmware::machine::{Command, Machine, Show, Start};
use firmware::map::MAX_SERVOS;
use mocap::sample;
use puppet_file::Map;
use servo_wire::dynamixel::{DynamixelBus, DynamixelClient};
use servo_wire::port::{Automatic, LineConfig, Port};
use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use virtual_servos::config::ServoConfig;
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::uart::InProcessUart;
use virtual_servos::virtual_bus::{Disturbance, Event as ServoEvent, VirtualBus};

const BAUD: u32 = 1_000_000;

/// Seconds from one failure to the next.
const EVERY: u64 = 97;

/// What is left of memory's noise, in KiB: pages that the allocator keeps.
const NOISE_KIB: u64 = 1024;

/// Time on the line, in nanoseconds, which goes on by what is sent, and by what is waited for in vain.
struct LineTime<'c>(&'c Cell<u64>);

impl DelayNs for LineTime<'_> {
    async fn delay_ns(&mut self, ns: u32) {
        self.0.set(self.0.get() + u64::from(ns));
    }
}

/// A host that monitors, streams a clip again and again, and acknowledges.
struct Host<'c> {
    clip: &'c [u8],
    header: usize,
    at: usize,
    number: u16,
    /// Requests since the stream began, and what the last answer said of room.
    step: u32,
    free: u16,
    /// Ticks for which a fault has been latched.
    latched: u32,
    faults: BTreeMap<String, u32>,
    last: Option<String>,
    streams: u32,
    telemetry: u64,
}

impl Host<'_> {
    fn request(&mut self, tick: u32) -> Option<Request<'_>> {
        let session = 7;
        match tick {
            0 => return Some(Request::Hello { version: VERSION, session }),
            1 => return Some(Request::Telemetry { millis: 100 }),
            _ => {}
        }
        if self.latched > 0 {
            self.latched += 1;
            (self.step, self.at) = (0, 0);
            return self.latched.is_multiple_of(50).then_some(Request::Command(Command::Acknowledge));
        }
        self.step += 1;
        match self.step {
            1 => Some(Request::Stream { bytes: self.header as u32 }),
            2 => {
                self.at = self.header;
                Some(Request::Header { offset: 0, bytes: &self.clip[..self.header] })
            }
            6 => Some(Request::Command(Command::Play { clip: LIVE, repeats: false })),
            _ if self.at >= self.clip.len() => {
                // Played to its end, and a while of nothing.
                if self.step > 900 {
                    (self.step, self.streams) = (0, self.streams + 1);
                }
                self.step.is_multiple_of(25).then_some(Request::Alive)
            }
            _ if self.free == 0 && self.step > 8 => Some(Request::Packet { bytes: &[] }),
            _ => {
                let start = self.at;
                let len = usize::from(u16::from_le_bytes([self.clip[start], self.clip[start + 1]]));
                self.at = (start + 12 + len).min(self.clip.len());
                Some(Request::Packet { bytes: &self.clip[start..self.at] })
            }
        }
    }

    fn hear(&mut self, answer: &Answer) {
        match answer {
            Answer::Response(Response::Stream(streaming)) => self.free = streaming.progress.free_blocks,
            Answer::Event(Event::Telemetry(telemetry)) => {
                self.telemetry += 1;
                let fault = telemetry.fault.map(|fault| format!("{fault:?}"));
                if fault.is_none() {
                    self.latched = 0;
                } else {
                    self.latched = self.latched.max(1);
                }
                if let Some(name) = fault.as_ref().filter(|_| fault != self.last) {
                    let kind = name.split([' ', '{']).next().unwrap_or_default().to_owned();
                    *self.faults.entry(kind).or_default() += 1;
                }
                self.last = fault;
            }
            _ => {}
        }
    }
}

struct Soak<'a> {
    map: &'a Map,
    line: &'a Cell<u64>,
    tick: &'a Cell<u32>,
    ticks: u32,
    device: Device,
    session: Session,
    host: Host<'a>,
    reply: Deframer<{ ANSWER_BYTES + OVERHEAD }>,
    late: u32,
    longest_us: u64,
    playing: u32,
    memory: Vec<u64>,
}

impl Surroundings<DecoderList, MAX_SERVOS> for Soak<'_> {
    async fn wait(&mut self, tick: u32) -> bool {
        let due = |tick| self.map.tick_micros(tick) * 1000;
        let now = self.line.get();
        if tick > 0 {
            self.longest_us = self.longest_us.max(now.saturating_sub(due(tick - 1)) / 1000);
        }
        self.tick.set(tick);
        self.line.set(now.max(due(tick)));
        let late = now >= due(tick.wrapping_add(1));
        self.late += u32::from(late);
        late
    }

    fn control(
        &mut self,
        machine: &mut Machine<'_, DecoderList, MAX_SERVOS>,
        feedback: &Feedback<'_>,
    ) -> bool {
        let tick = self.tick.get();
        self.device.tick(machine, feedback, (self.map.tick_micros(tick) / 1000) as u32, 100);
        let mut line = [0; wire_len(REQUEST_BYTES)];
        let number = self.host.number;
        if let Some(request) = self.host.request(tick) {
            let mut bytes: &[u8] = write(number, &request, &mut line).unwrap();
            while !bytes.is_empty() {
                self.device.serve(&mut self.session, &mut bytes, machine, feedback);
            }
            self.host.number = number.wrapping_add(1);
        } else {
            self.device.serve(&mut self.session, &mut [].as_slice(), machine, feedback);
        }
        let outgoing = self.session.outgoing().to_vec();
        self.session.sent(outgoing.len());
        let mut outgoing = outgoing.as_slice();
        while let Some(frame) = self.reply.feed(&mut outgoing) {
            self.host.hear(&decode_all(frame.unwrap().message).unwrap());
        }
        self.playing += u32::from(machine.mixer().position().is_some_and(|(clip, ..)| clip == LIVE));
        if tick.is_multiple_of(u32::from(self.map.tick_hz()) * 60) {
            self.memory.push(resident_kib());
        }
        tick < self.ticks
    }

    fn feed(&mut self) {}
}

/// KiB of this process that are in memory; 0 where nobody says.
fn resident_kib() -> u64 {
    let pages = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    pages.split(' ').nth(1).and_then(|pages| pages.parse::<u64>().ok()).unwrap_or(0) * 4
}

#[test]
fn hours_of_streams_monitoring_and_faults() {
    let hours = std::env::var("BUNRAKU_SOAK_HOURS").map_or(0.25, |hours| hours.parse().expect("a number"));
    let sample = sample::clip();
    let encoder = Encoder::new(&sample.skeleton, &sample.motion).unwrap();
    let clip = encoder.encode(&Encoding::new(CodecId::Dpcm), Quality::Bits(4)).unwrap();
    let map = crate::virtual_device::map("sample.toml", &sample.skeleton);
    let hz = u32::from(map.tick_hz());
    let ticks = (hours * 3600.0) as u32 * hz;

    let joints = map.joints();
    let servos =
        joints.iter().map(|joint| ServoConfig { position: joint.home, ..ServoConfig::new(joint.id) });
    let config = DynamixelConfig { servos: servos.collect(), ..DynamixelConfig::with_ids(&[]) };
    let mut servos = DynamixelServos::new(&config).unwrap();
    let mut failures = 0u64;
    for at in (20..u64::from(ticks / hz)).step_by(EVERY as usize) {
        let servo = joints[failures as usize / 5 % joints.len()].id;
        let disturbance = match failures % 5 {
            0 => Disturbance::Silence { servo, seconds: 0.3 },
            1 => Disturbance::Restart { servo },
            2 => Disturbance::Cut { seconds: 0.2 },
            3 => Disturbance::Stick { servo, seconds: 20.0 },
            _ => Disturbance::Silence { servo, seconds: 0.03 },
        };
        servos.schedule(at * 1_000_000, disturbance).unwrap();
        failures += 1;
    }
    let (line, tick) = (Cell::new(0u64), Cell::new(0u32));
    let told = RefCell::new(BTreeMap::<u8, (u32, i32)>::new());
    let (goals, outside) = (Cell::new(0u64), RefCell::new(Vec::<String>::new()));
    let hear = |bytes: &[u8]| {
        let byte_ns = 10_000_000_000 / u64::from(BAUD);
        line.set(line.get() + bytes.len() as u64 * byte_ns);
        let now_us = line.get() / 1000;
        servos.advance_to(now_us);
        let present: BTreeMap<u8, i32> =
            joints.iter().map(|joint| (joint.id, servos.position(joint.id).unwrap())).collect();
        let answers = servos.receive(bytes, now_us, &mut |event| {
            let ServoEvent::Goal { id, position: goal, .. } = event else { return };
            goals.set(goals.get() + 1);
            let joint = joints.iter().find(|joint| joint.id == id).unwrap();
            let speed = joint.max_velocity / 1024 + 1;
            let last = told.borrow_mut().insert(id, (tick.get(), goal));
            let passed = last.map_or(1, |(last, _)| (tick.get() - last).max(1)) as i32;
            let from_last = last.map_or(i32::MAX, |(_, last)| (goal - last).abs());
            let from_here = (goal - present[&id]).abs();
            let inside = (joint.min..=joint.max).contains(&goal);
            if !inside || from_last.min(from_here) > speed * passed.min(i32::from(UNHEARD_TICKS)) {
                let at = tick.get();
                outside
                    .borrow_mut()
                    .push(format!("servo {id} at {} is sent to {goal} in tick {at}", present[&id]));
            }
        });
        line.set(line.get() + answers.len() as u64 * byte_ns);
        answers
    };
    let port = Port::new(InProcessUart::new(hear), Automatic, LineTime(&line), LineConfig::uart(BAUD));
    let mut bus = DynamixelBus::<_, _, _>::new(DynamixelClient::new(port));
    let mut machine = Machine::<_, MAX_SERVOS>::new(&map, shelf(), Show::default(), Start::Power);
    let identity = Identity {
        name: "soak".try_into().unwrap(),
        clock_hz: 1_000_000,
        data_bytes: 512,
        flash_stalls: false,
    };
    let header = Prefix::read(&clip[..PREFIX_BYTES]).unwrap().header_bytes;
    let mut soak = Soak {
        map: &map,
        line: &line,
        tick: &tick,
        ticks,
        device: Device::new(identity),
        session: Session::new(),
        host: Host {
            clip: &clip,
            header,
            at: 0,
            number: 0,
            step: 0,
            free: 0,
            latched: 0,
            faults: BTreeMap::new(),
            last: None,
            streams: 0,
            telemetry: 0,
        },
        reply: Deframer::new(),
        late: 0,
        longest_us: 0,
        playing: 0,
        memory: Vec::new(),
    };
    embassy_futures::block_on(control_loop(&mut machine, &mut bus, &mut soak));
    let Soak { host, late, longest_us, playing, memory, .. } = soak;
    // The first minutes fill what is filled once.
    let settled = memory.get(memory.len().min(6) - 1).copied().unwrap_or(0);
    let last = memory.last().copied().unwrap_or(0);
    println!(
        "{hours} h: {ticks} ticks, {late} late, a tick takes {longest_us} µs on the line at most; {} goals, {} outside limits; \
         {failures} failures, faults {:?}; {} streams, {playing} ticks of them; {} reports; {settled} KiB after minutes, {last} in \
         the end",
        goals.get(),
        outside.borrow().len(),
        host.faults,
        host.streams,
        host.telemetry
    );
    assert!(outside.borrow().is_empty(), "{:?}", &outside.borrow()[..outside.borrow().len().min(5)]);
    assert_eq!(late, 0, "late ticks");
    assert!(last <= settled + NOISE_KIB, "memory grows from {settled} to {last} KiB");
    assert!(
        playing > ticks / 3 && host.telemetry > u64::from(ticks / hz) * 5,
        "{playing} {}",
        host.telemetry
    );
    assert!(["Silent", "Bus", "NotFollowing"].iter().all(|kind| host.faults.contains_key(*kind)));
}

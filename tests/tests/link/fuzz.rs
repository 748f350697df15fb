//! A device behind a line that brings anything: requests in any order, damaged, doubled, cut, and noise.
//! `BUNRAKU_FUZZ=50` takes fifty times as many frames as CI does.

use bunraku_fuzz::Random;
use bunraku_fuzz::mutate::mutate;
use decoder_core::mclip::{CodecId, Needs};
use decoder_core::{I16F16, Limits};
use encoder::mclip::{Encoder, Encoding, Quality};
use firmware::clips::{Clips, DecoderMemory, LIVE, Mailbox, Worker, decode};
use firmware::clock::Speed;
use firmware::device::{Device, Identity};
use firmware::fault::Feedback;
use firmware::link::frame::{Deframer, OVERHEAD, crc32, wire_len, write};
use firmware::link::message::{ANSWER_BYTES, Answer, REQUEST_BYTES, Request, Response, VERSION};
use firmware::link::session::Session;
use firmware::link::wire::decode_all;
use firmware::machine::{Command, Machine, Show, Start};
use firmware::map::MAX_SERVOS;
use firmware::store::{Layout, Store};
use firmware::stream::{Live, Memory, PlayerMemory, Settings};
use host_sim::flash::Flash;
use mocap::sample;
use servo_wire::bus::Reading;

/// Frames in CI.
const FRAMES: usize = 20_000;

const SECTOR: usize = 1024;
const CHANNELS: usize = 64;
const WORDS: usize = 4096;

fn forever<T>(memory: T) -> &'static mut T {
    Box::leak(Box::new(memory))
}

pub type DecoderList = Clips<'static, 'static, Flash<SECTOR>>;

pub fn shelf() -> DecoderList {
    let pose = || &mut forever([I16F16::ZERO; CHANNELS])[..];
    let poses = [pose(), pose(), pose(), pose()];
    let player = PlayerMemory { header: forever([0; 4096]), block: forever([0; 1040]), poses };
    let limits = Limits { channels: CHANNELS as u16, frames: 100_000 };
    let settings = Settings { ahead_millis: 100, lost_millis: 300, limits };
    let live: &'static Live<'static> =
        forever(Live::new(Memory { buffer: forever([0; 6000]), player }, settings));
    let worker = || {
        let mailbox: &'static Mailbox<'static> = forever(Mailbox::new());
        let task = forever(Box::pin(decode(
            mailbox,
            forever(DecoderMemory::<CHANNELS, { 4 * CHANNELS }, WORDS, 16>::new()),
            live,
        )));
        Worker::new(task.as_mut(), mailbox, forever([I16F16::ZERO; CHANNELS]))
    };
    let layout = Layout { directory: [0, SECTOR as u32], clips: 2 * SECTOR as u32..64 * SECTOR as u32 };
    let capacity = Needs { channels: CHANNELS, words: 4 * CHANNELS, halves: WORDS };
    let store = Store::mount(Flash::new(64), layout, capacity).unwrap();
    Clips::new(&[], Some(store), live, [worker(), worker()])
}

/// What a host is about.
#[derive(Clone, Copy, PartialEq)]
enum Aim {
    Upload,
    Stream,
    Anything,
}

/// A host that mostly does what makes sense.
struct Host {
    random: Random,
    clips: Vec<Vec<u8>>,
    number: u16,
    aim: Aim,
    /// Requests since it began with that.
    step: usize,
    /// The clip that is uploaded or streamed, its number, and the next byte.
    clip: usize,
    place: u16,
    next: usize,
}

impl Host {
    fn new(clips: &[Vec<u8>]) -> Self {
        let clips = clips.to_vec();
        Self {
            random: Random::new(5),
            clips,
            number: 0,
            aim: Aim::Anything,
            step: 0,
            clip: 0,
            place: 0,
            next: 0,
        }
    }

    fn hear(&mut self, answer: &Answer) {
        if let (Answer::Response(Response::Upload { next }), Aim::Upload) = (answer, self.aim) {
            self.next = *next as usize;
        }
    }

    fn request(&mut self) -> Request<'_> {
        if self.random.below(80) == 0 {
            self.aim = [Aim::Upload, Aim::Stream, Aim::Anything][self.random.below(3)];
            (self.step, self.next) = (0, 0);
            (self.clip, self.place) = (self.random.below(self.clips.len()), self.random.below(5) as u16);
        }
        self.step += 1;
        let (bytes, random) = (&self.clips[self.clip], &mut self.random);
        let sense = random.below(10) > 0;
        let header = header(bytes);
        match (self.aim, self.step) {
            (Aim::Upload, 1) => Request::Begin {
                clip: self.place,
                name: "fuzz",
                bytes: bytes.len() as u32,
                crc: crc32([&bytes[..]]) ^ u32::from(!sense),
            },
            (Aim::Upload, _) if sense && self.next >= bytes.len() => Request::Commit,
            (Aim::Upload, _) if sense => {
                let end = (self.next + 512).min(bytes.len());
                Request::Data { offset: self.next as u32, bytes: &bytes[self.next..end] }
            }
            (Aim::Stream, 1) => Request::Stream { bytes: header as u32 },
            (Aim::Stream, 2) => Request::Header { offset: 0, bytes: &bytes[..header.min(1000)] },
            (Aim::Stream, 6) => Request::Command(Command::Play { clip: LIVE, repeats: false }),
            (Aim::Stream, _) if sense => {
                let start = self.next.max(header);
                let len =
                    bytes.get(start..start + 2).map_or(0, |n| usize::from(u16::from_le_bytes([n[0], n[1]])));
                let end = (start + 12 + len).min(bytes.len());
                // Some never come, some come twice.
                self.next = [end, end, end, start][random.below(4)];
                let gone = random.below(6) == 0;
                Request::Packet { bytes: if gone { &[] } else { &bytes[start.min(end)..end] } }
            }
            _ => anything(random, bytes),
        }
    }

    /// A frame of it, or what a bad line makes of that.
    fn frame(&mut self) -> Vec<u8> {
        let number = self.number;
        let mut buffer = [0; wire_len(REQUEST_BYTES)];
        let mut frame = write(number, &self.request(), &mut buffer).unwrap().to_vec();
        match self.random.below(12) {
            0 => mutate(&mut frame, &[0, 1, 2, 3], &mut self.random),
            1 => frame.extend(frame.clone()),
            2 => frame.truncate(self.random.below(frame.len())),
            3 => frame = (0..self.random.below(80)).map(|_| self.random.below(256) as u8).collect(),
            // Any message with a right checksum.
            4 => {
                let len = 1 + self.random.below(6);
                let mut raw: Vec<u8> = (0..len).map(|_| self.random.below(20) as u8).collect();
                raw.splice(0..0, [number as u8 & 0x7f]);
                raw.extend(crc32([&raw[..]]).to_le_bytes());
                frame = firmware_cobs(&raw);
            }
            _ => {}
        }
        self.number = number.wrapping_add(match self.random.below(400) {
            0 => 40_000,
            1..50 => 0,
            50..100 => 2,
            _ => 1,
        });
        frame
    }
}

/// COBS by hand, of at most 253 bytes.
fn firmware_cobs(raw: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    for run in raw.split(|&byte| byte == 0) {
        out.push(run.len() as u8 + 1);
        out.extend(run);
    }
    out.push(0);
    out
}

fn command(random: &mut Random) -> Command {
    let clip = [0, 1, 2, 3, 4, LIVE][random.below(6)];
    let repeats = random.below(2) == 0;
    match random.below(12) {
        0 | 1 => Command::Play { clip, repeats },
        2 => Command::Queue { clip, repeats },
        3 => Command::Pause,
        4 => Command::Resume,
        5 => Command::Speed(Speed::new(random.below(3000) as u16)),
        6 => Command::Seek { frame: random.below(1000) as u32 },
        7 => Command::Sync { frame: random.below(500) as u32, fraction: random.below(65_536) as u16 },
        8 => [Command::Stop, Command::Home][random.below(2)],
        9 => Command::Trigger,
        10 => Command::LinkLost,
        _ => Command::Acknowledge,
    }
}

/// Requests that come from nowhere.
fn anything<'c>(random: &mut Random, bytes: &'c [u8]) -> Request<'c> {
    let some = random.below(5) as u16;
    match random.below(23) {
        0 => Request::Hello { version: VERSION, session: random.below(3) as u32 },
        1 => Request::Telemetry { millis: random.below(60) as u16 },
        2 => Request::Hold { millis: [0, 0, 0, 200][random.below(4)] },
        3 => Request::Alive,
        4 => Request::Clip { index: some },
        5 => Request::Begin { clip: some, name: "", bytes: random.below(1 << 20) as u32, crc: 0 },
        6 => Request::Data { offset: random.below(20_000) as u32, bytes: &bytes[..random.below(1000)] },
        7 => [Request::Commit, Request::Abandon, Request::Remove { clip: some }][random.below(3)],
        8 => Request::Stream { bytes: random.below(10_000) as u32 },
        9 => Request::Header { offset: random.below(2000) as u32, bytes: &bytes[..random.below(1000)] },
        10 => Request::Packet { bytes: &bytes[..random.below(1000)] },
        11 => Request::Facts { clip: [some, LIVE][random.below(2)] },
        12 => Request::Demands,
        13 => Request::Prove { proof: &bytes[..random.below(40)] },
        _ => Request::Command(command(random)),
    }
}

/// Bytes before the first block.
fn header(clip: &[u8]) -> usize {
    use decoder_core::mclip::{PREFIX_BYTES, Prefix};
    Prefix::read(&clip[..PREFIX_BYTES]).unwrap().header_bytes
}

#[test]
fn anything_on_the_link_is_borne() {
    let times =
        std::env::var("BUNRAKU_FUZZ").map_or(1, |times| times.parse().expect("BUNRAKU_FUZZ: a number"));
    let sample = sample::clip();
    let encoder = Encoder::new(&sample.skeleton, &sample.motion).unwrap();
    let clips = [(CodecId::Dpcm, 4), (CodecId::Adpcm, 3), (CodecId::Pcm, 4)]
        .map(|(codec, bits)| encoder.encode(&Encoding::new(codec), Quality::Bits(bits)).unwrap())
        .to_vec();
    let map = crate::virtual_device::map("sample.toml", &sample.skeleton);
    let mut host = Host::new(&clips);
    let identity = Identity {
        name: "fuzzed".try_into().unwrap(),
        clock_hz: 1_000_000,
        data_bytes: 512,
        flash_stalls: false,
    };
    let mut device = Device::new(identity);
    let show = Show { trigger_clip: Some(1), ..Show::default() };
    let mut machine = Machine::<_, MAX_SERVOS>::new(&map, shelf(), show, Start::Power);
    let mut session = Session::new();
    let mut reply = Deframer::<{ ANSWER_BYTES + OVERHEAD }>::new();
    let reading = |position| Reading {
        position,
        temperature: Some(30),
        millivolts: Some(12_000),
        load: Some(0),
        hardware_error: 0,
        torque: Some(true),
    };
    let mut positions: Vec<i32> = map.joints().iter().map(|joint| joint.home).collect();
    let mut speeds = vec![0; positions.len()];
    let (mut frames, mut answers, mut ticks, mut playing, mut stored, mut streamed) = (0, 0, 0u32, 0, 0, 0);
    let mut action = None;
    while frames < FRAMES * times {
        let mut line = Vec::new();
        for _ in 0..host.random.below(4) {
            line.extend(host.frame());
            frames += 1;
        }
        // Now and then a host that begins properly, else nothing is done after the first wrong hello.
        if ticks % 50 == 0 {
            let mut buffer = [0; 40];
            let number = host.number;
            line.push(0);
            let hello = Request::Hello { version: VERSION, session: host.random.below(1000) as u32 };
            line.extend(&*write(number, &hello, &mut buffer).unwrap());
            line.extend(
                &*write(number.wrapping_add(1), &Request::Command(Command::Acknowledge), &mut buffer)
                    .unwrap(),
            );
            host.number = number.wrapping_add(2);
            frames += 2;
        }
        let readings: Vec<_> = positions.iter().map(|&position| Some(reading(position))).collect();
        let feedback = Feedback { readings: &readings, bus: Ok(()), action, late: false };
        device.tick(&mut machine, &feedback, ticks * 20, 100);
        let mut rest = line.as_slice();
        while !rest.is_empty() {
            let before = rest.len();
            device.serve(&mut session, &mut rest, &mut machine, &feedback);
            assert!(rest.len() < before);
        }
        let outgoing = session.outgoing().to_vec();
        session.sent(outgoing.len());
        let mut outgoing = outgoing.as_slice();
        while let Some(frame) = reply.feed(&mut outgoing) {
            let answer: Answer = decode_all(frame.unwrap().message).unwrap();
            host.hear(&answer);
            answers += 1;
        }
        let plan = machine.tick(&feedback);
        action = plan.action.map(|_| Ok(()));
        for ((goal, joint), (position, speed)) in
            plan.goals.iter().zip(map.joints()).zip(positions.iter_mut().zip(&mut speeds))
        {
            assert!((joint.min..=joint.max).contains(&goal.position), "a goal is out of its range");
            let step = goal.position - *position;
            let most = joint.max_velocity / 1024 + 1;
            assert!(step.abs() <= most, "a goal jumps by {step}, at most {most}");
            let jerk = (step - *speed).abs();
            assert!(jerk <= joint.max_acceleration / 1024 + 2, "a goal's speed jumps by {jerk}");
            (*position, *speed) = (goal.position, step);
        }
        playing += u32::from(machine.mixer().position().is_some());
        streamed += u32::from(machine.mixer().position().is_some_and(|(clip, ..)| clip == LIVE));
        ticks += 1;
        if ticks % 64 == 0 {
            // Each clip in the store is one that was sent, whole.
            let store = machine.library().store().unwrap();
            for entry in store.list() {
                let bytes = store.get(entry.clip).unwrap();
                assert!(clips.iter().any(|clip| clip == bytes), "clip {} is none", entry.clip);
                stored += 1;
            }
        }
    }
    println!(
        "{frames} frames, {answers} answers, {ticks} ticks; {playing} of them with a clip, {streamed} with a stream; clips found whole {stored} times"
    );
    assert!(answers > frames / 2 && playing > ticks / 50 && streamed > 0 && stored > 20);
}

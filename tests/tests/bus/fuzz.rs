//! Random and mutated bytes as answers, on every client and bus: no panic, no hang, no reading that was not sent, no
//! time beyond the limits.

use crate::servos1;
use crate::servos2;
use crate::session::{Port2, line, port, wire};
use crate::wire::{Servos, Wire};
use fastrand::Rng;
use servo_wire::blender::Parser;
use servo_wire::bus::{Goal, Reading, ServoBus};
use servo_wire::dynamixel::bus::BLOCK_LEN;
use servo_wire::dynamixel::{self, DynamixelBus};
use servo_wire::feetech::{FeetechBus, Series};
use servo_wire::protocol1::{self, Protocol1Bus};

const IDS: [u8; 4] = [1, 2, 9, 252];

/// Frames for each of the buses.
const FRAMES: usize = 260_000;

/// The same numbers on every run.
pub struct Random(Rng);

impl Random {
    fn new(seed: u64) -> Self {
        Self(Rng::with_seed(seed))
    }

    fn below(&mut self, bound: usize) -> usize {
        self.0.usize(..bound)
    }

    /// Bytes in which headers and their parts are common.
    fn bytes(&mut self, len: usize) -> Vec<u8> {
        let common = [0xFF, 0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x55, 0xFE, 0x02, 0x04];
        (0..len)
            .map(|_| match self.below(12) {
                at @ ..10 => common[at],
                _ => self.below(256) as u8,
            })
            .collect()
    }
}

/// Servos that answer whatever they hear with packets near to right ones.
struct Babble {
    random: Random,
    two: bool,
    frames: usize,
}

impl Babble {
    fn new(two: bool) -> Self {
        Self { random: Random::new(0x5EED), two, frames: 0 }
    }

    fn answer(&mut self, asked: u8, len: usize) -> Vec<u8> {
        let random = &mut self.random;
        let id = match random.below(3) {
            0 => [1, 2, 9, 252, 254, 33][random.below(6)],
            _ if asked == 254 => IDS[random.below(IDS.len())],
            _ => asked,
        };
        let error = [0, 0, 0, 0, 0x80, 1 << random.below(8)][random.below(6)];
        let len = if random.below(4) == 0 { random.below(40) } else { len };
        let data = random.bytes(len);
        let mut bytes = match self.two {
            true => servos2::packet(id, &[&[0x55, error][..], &data].concat()),
            false => servos1::packet(id, &[&[error][..], &data].concat()),
        };
        match random.below(10) {
            0 => bytes[random.below(8).min(5)] = random.below(256) as u8,
            1 => bytes.truncate(random.below(bytes.len())),
            2 => {
                let at = random.below(bytes.len());
                let noise = random.below(6);
                bytes.splice(at..at, random.bytes(noise));
            }
            3 => {
                let bit = random.below(8 * bytes.len());
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
            4 => {
                let len = random.below(60);
                bytes = random.bytes(len);
            }
            _ => {}
        }
        bytes
    }

    /// A joint answer of all servos, whole, cut or with wrong bytes.
    fn joint(&mut self, question: &[u8]) -> Vec<u8> {
        let ids = question[12..question.len() - 2].to_vec();
        let mut out = vec![0xFF, 0xFF, 0xFD, 0x00, 0xFE];
        out.extend((1 + ids.len() as u16 * (4 + BLOCK_LEN as u16)).to_le_bytes());
        out.push(0x55);
        for mut id in ids {
            let data = self.random.bytes(BLOCK_LEN);
            if self.random.below(20) == 0 {
                id = 33;
            }
            out.extend([[0, 0x80, 4][self.random.below(3)], id]);
            out.extend(data);
            let sum = servos2::crc(&out);
            out.extend(sum.to_le_bytes());
        }
        if self.random.below(2) == 0 {
            let at = self.random.below(out.len());
            match self.random.below(3) {
                0 => out.truncate(at),
                1 => out[at] ^= 1 << self.random.below(8),
                _ => drop(out.remove(at)),
            }
        }
        out
    }
}

impl Servos for Babble {
    fn hear(&mut self, bytes: &[u8], _now: u64) -> Vec<(u64, Vec<u8>)> {
        let fast = self.two && bytes.get(7) == Some(&0x8A) && bytes.len() > 14;
        let wanted = match bytes {
            [_, _, _, _, _, _, _, 2 | 0x82 | 0x8A, _, _, len, ..] if self.two => *len,
            [_, _, _, _, 2 | 0x82, _, len, ..] if !self.two => *len,
            [_, _, _, _, _, _, _, 1, ..] if self.two => 3,
            _ => 0,
        };
        let asked = bytes.get(if self.two { 4 } else { 2 }).copied().unwrap_or(0);
        let count = 1 + self.random.below(if fast { 2 } else { IDS.len() + 1 });
        let answers: Vec<_> = (0..count)
            .map(|at| {
                let answer =
                    if fast && at == 0 { self.joint(bytes) } else { self.answer(asked, wanted.into()) };
                ([0, 0, 0, 50_000, 2_000_000][self.random.below(5)], answer)
            })
            .collect();
        self.frames += answers.len();
        answers
    }

    fn seal(&self, _packet: &mut [u8]) {}

    fn places(&self) -> (usize, usize) {
        (0, 0)
    }

    fn refuse(&self, packet: &[u8], _number: u8) -> Vec<u8> {
        packet.to_vec()
    }
}

/// The data of all bytes that are an answer of this servo, wherever they begin: of protocol 2.0, alone or in a joint
/// answer.
fn answers2(heard: &[u8], id: u8) -> Vec<Vec<u8>> {
    let mut found = Vec::new();
    for start in heard.windows(4).enumerate().filter(|(_, w)| *w == [0xFF, 0xFF, 0xFD, 0]).map(|(at, _)| at) {
        let Some(&[from, low, high, 0x55]) = heard.get(start + 4..start + 8) else { continue };
        if from == 0xFE {
            // Each part is checked by the checksum before it, and what was sent by all bytes.
            for end in start + 8 + 4 + BLOCK_LEN..=heard.len() {
                if heard[end - 3 - BLOCK_LEN] == id {
                    found.push(heard[end - 2 - BLOCK_LEN..end - 2].to_vec());
                }
            }
            continue;
        }
        let end = start + 7 + usize::from(u16::from_le_bytes([low, high]));
        let Some(bytes) = heard.get(start..end).filter(|bytes| from == id && bytes.len() > 11) else {
            continue;
        };
        let (body, sum) = bytes.split_at(bytes.len() - 2);
        if servos2::crc(body).to_le_bytes() == sum {
            found.push(servos2::unstuffed(&body[8..])[1..].to_vec());
        }
    }
    found
}

/// As [`answers2`], of protocol 1.0.
fn answers1(heard: &[u8], id: u8) -> Vec<Vec<u8>> {
    let starts = heard.windows(3).enumerate().filter(move |(_, w)| *w == [0xFF, 0xFF, id]);
    let frames = starts.filter_map(|(at, _)| {
        let len = usize::from(*heard.get(at + 3)?);
        heard.get(at..at + 4 + len).filter(|frame| frame.len() > 6)
    });
    let right = frames.filter(|frame| servos1::sum(&frame[2..]) == 255);
    right.map(|frame| frame[5..frame.len() - 1].to_vec()).collect()
}

/// Calls everything until the servos have sent so many frames. `shown`: whether a reading shows these bytes.
fn storm<B: ServoBus>(
    wire: &Wire<Babble>,
    bus: &mut B,
    limit: u64,
    answers: impl Fn(&[u8], u8) -> Vec<Vec<u8>>,
    shown: impl Fn(&Reading, &[u8]) -> bool,
) -> usize {
    let (mut good, mut round) = (0, 0_usize);
    while wire.servos(|servos| servos.frames) < FRAMES {
        let index = round % IDS.len();
        let mut readings = [None; IDS.len()];
        let took = match round % 16 {
            0 => wire.run(bus.ping(&IDS, index)).1,
            1 => wire.run(bus.set_torque(&IDS, index, true)).1,
            2 => wire.run(bus.reboot(&IDS, index)).1,
            3 => wire.run(bus.set_watchdog(&IDS, 100)).1,
            4 => wire.run(bus.write_goals(&IDS.map(|id| Goal { id, position: round as i32 }))).1,
            _ => {
                let took = wire.run(bus.read_all(&IDS, &mut readings)).1;
                for (id, reading) in IDS.iter().zip(&readings) {
                    let Some(reading) = reading else { continue };
                    let heard = wire.heard();
                    let data = answers(&heard, *id).iter().any(|data| shown(reading, data));
                    assert!(data, "nobody sent {reading:?} of {id}");
                    good += 1;
                }
                took
            }
        };
        assert!(took <= limit, "a call took {took} of {limit} µs");
        round += 1;
    }
    good
}

#[test]
fn a_million_frames() {
    let line = line(false);
    let mut frames = 0;
    let mut report = |what: &str, wire: &Wire<Babble>, good: usize| {
        let count = wire.servos(|servos| servos.frames);
        println!("{what}: {count} frames, {good} readings out of them");
        assert!(good > 100, "{what} is never answered well");
        frames += count;
    };
    let limit = 60_000;

    for fast in [true, false] {
        let wire = wire(Babble::new(true), None, line);
        let bus = DynamixelBus::new(dynamixel::DynamixelClient::<_, _, _, 640>::new(port(&wire, line)));
        let mut bus = if fast { bus } else { bus.with_plain_reads() };
        let good = storm(&wire, &mut bus, limit, answers2, |reading, data| {
            data.len() == BLOCK_LEN && reading.position.to_le_bytes() == data[5..9]
        });
        report(if fast { "Dynamixel 2.0" } else { "Dynamixel 2.0, plain reads" }, &wire, good);
    }
    let wire1 = || wire(Babble::new(false), None, line);
    let client = |wire: &Wire<Babble>| {
        protocol1::Protocol1Client::<_, _, _, 192>::new(port(wire, line) as Port2<Babble>)
    };
    let wire = wire1();
    let good = storm(&wire, &mut Protocol1Bus::new(client(&wire)), limit, answers1, |reading, data| {
        data.len() == 20 && reading.position == i32::from(i16::from_le_bytes([data[12], data[13]]))
    });
    report("Dynamixel 1.0", &wire, good);
    for series in [Series::Sts, Series::Scs] {
        let wire = wire1();
        let good =
            storm(&wire, &mut FeetechBus::new(client(&wire), series), limit, answers1, |reading, data| {
                data.len() == 26 && reading.temperature == Some(data[23])
            });
        report(if series == Series::Sts { "Feetech STS" } else { "Feetech SCS" }, &wire, good);
    }
    let mut random = Random::new(7);
    let mut parser = Parser::new();
    let (mut blender, mut expected) = (0, 0);
    for _ in 0..200_000 {
        let (id, position) = (random.below(256) as u8, random.below(65_536) as u16);
        let [high, low] = position.to_be_bytes();
        let noise = random.below(4);
        let bytes = match noise {
            0 => random.bytes(5),
            _ => vec![b'<', id, high, low, b'>'],
        };
        expected += usize::from(noise != 0);
        for byte in bytes {
            blender += usize::from(parser.feed(byte).is_some());
        }
    }
    println!("Blender: 200000 frames, {blender} goals of {expected} sent");
    assert!(blender > expected * 9 / 10);
    frames += 200_000;
    println!("{frames} frames in all");
    assert!(frames >= 1_000_000);
}

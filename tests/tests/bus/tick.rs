//! What a tick costs: bytes and time on the wire, computed and met.

use crate::servos1::{Kind, Protocol1};
use crate::servos2::XSeries;
use crate::session::{BAUD, Bus2, line, port, wire};
use servo_wire::bus::{Goal, ServoBus};
use servo_wire::dynamixel::{self, DynamixelBus};
use servo_wire::feetech::{self, FeetechBus, Series};
use servo_wire::port::LineConfig;
use servo_wire::protocol1::{self, Protocol1Bus};

const SERVOS: usize = 20;

fn ids() -> Vec<u8> {
    (1..=SERVOS as u8).collect()
}

/// Bytes and microseconds of one tick, after everybody was found.
fn tick<S: crate::wire::Servos>(
    wire: &crate::wire::Wire<S>,
    bus: &mut impl ServoBus,
    position: i32,
) -> (usize, u64) {
    let ids = ids();
    for index in 0..SERVOS {
        wire.run(bus.ping(&ids, index)).0.expect("a servo that answers");
    }
    let goals: Vec<Goal> = ids.iter().map(|&id| Goal { id, position }).collect();
    let mut readings = [None; SERVOS];
    let ((down, up), start) = (wire.bytes(), wire.now_us());
    wire.run(bus.write_goals(&goals)).0.expect("goals that are sent");
    wire.run(bus.read_all(&ids, &mut readings)).0.expect("servos that answer");
    assert!(readings.iter().all(Option::is_some));
    let (down, up) = (wire.bytes().0 - down, wire.bytes().1 - up);
    ((down + up) as usize, wire.now_us() - start)
}

fn dynamixel(line: LineConfig, delay: u8) -> (crate::wire::Wire<XSeries>, Bus2) {
    let wire = wire(XSeries::new(&ids()), None, line);
    wire.servos(|bus| bus.servos.iter_mut().for_each(|servo| servo.set_return_delay(delay)));
    let bus = DynamixelBus::new(dynamixel::DynamixelClient::new(port(&wire, line)));
    (wire, bus)
}

#[test]
fn twenty_servos_keep_100_hz_at_1_mbaud() {
    let (wire, mut bus) = dynamixel(line(false), 0);
    let (bytes, micros) = tick(&wire, &mut bus, 2048);
    // By hand: Sync Write 14 + 20 · 5, Fast Sync Read 14 + 20, its answer 8 + 20 · (4 + 12).
    assert_eq!(bytes, 114 + 34 + 328);
    assert_eq!(bytes, dynamixel::bus::tick_bytes(SERVOS));
    assert_eq!(micros, 4760);
    println!("Dynamixel 2.0, Fast Sync Read: {bytes} bytes, {micros} us of 10000");

    // The factory's return delay of 500 µs comes once in a fast read.
    let factory = LineConfig { return_delay_us: 500, ..line(false) };
    let (wire, mut bus) = dynamixel(factory, 250);
    let (bytes, micros) = tick(&wire, &mut bus, 2048);
    assert_eq!((bytes, micros), (476, 5260));

    let (wire, bus) = dynamixel(line(false), 0);
    let (bytes, micros) = tick(&wire, &mut bus.with_plain_reads(), 2048);
    // Each answer 11 + 12 bytes.
    assert_eq!((bytes, micros), (114 + 34 + 20 * 23, 6080));
    println!("Dynamixel 2.0, Sync Read: {bytes} bytes, {micros} us of 10000");

    // Goals that must be stuffed, FF FF FD 00, cost a byte each.
    let (wire, mut bus) = dynamixel(line(false), 0);
    let (bytes, _) = tick(&wire, &mut bus, -131_073);
    assert_eq!(bytes, 476 + SERVOS);
    assert!(Bus2::write_limit_us(&line(false), SERVOS) > 1140);
}

#[test]
fn the_worst_tick_is_no_longer_than_stated() {
    // Every servo in turn falls silent, and then all.
    let limit = u64::from(Bus2::read_limit_us(&line(false), SERVOS));
    let mut longest = 0;
    for dead in 0..=SERVOS {
        let (wire, mut bus) = dynamixel(line(false), 0);
        tick(&wire, &mut bus, 2048);
        wire.servos(|bus| {
            for (at, servo) in bus.servos.iter_mut().enumerate() {
                servo.dead = dead == SERVOS || at == dead;
            }
        });
        for round in 0..6 {
            let mut readings = [None; SERVOS];
            let (_, took) = wire.run(bus.read_all(&ids(), &mut readings));
            longest = longest.max(took);
            assert!(took <= limit, "{took} of {limit} µs");
            let expected = if dead == SERVOS { 0 } else { SERVOS - 1 };
            assert_eq!(readings.iter().flatten().count(), expected, "servo {dead} dead, tick {round}");
        }
    }
    println!("the longest read of 20 servos, one or all of them dead, takes {longest} of {limit} us stated");
}

#[test]
fn other_servos_take_longer() {
    let servos: Vec<(u8, u16)> = ids().iter().map(|&id| (id, 500)).collect();
    let rig = |kind| wire(Protocol1::new(kind, &servos), None, line(false));
    let wire = rig(Kind::Ax);
    let mut bus =
        Protocol1Bus::new(protocol1::Protocol1Client::<_, _, _, 192>::new(port(&wire, line(false))));
    let (bytes, micros) = tick(&wire, &mut bus, 512);
    assert_eq!(bytes, (8 + 20 * 3) + 20 * (8 + 26));
    assert_eq!((bytes, micros), (protocol1::bus::tick_bytes(SERVOS), 10 * bytes as u64));
    println!("AX, MX 1.0: {bytes} bytes, {micros} us of 10000");
    for (series, kind, expected) in [
        (Series::Sts, Kind::Sts, (8 + 20 * 3) + (8 + 20) + 20 * 32),
        (Series::Scs, Kind::Scs, (8 + 20 * 3) + 20 * (8 + 32)),
    ] {
        let wire = rig(kind);
        let mut bus = FeetechBus::new(
            protocol1::Protocol1Client::<_, _, _, 192>::new(port(&wire, line(false))),
            series,
        );
        let (bytes, micros) = tick(&wire, &mut bus, 512);
        assert_eq!(bytes, expected);
        assert_eq!((bytes, micros), (feetech::tick_bytes(series, SERVOS), 10 * bytes as u64));
        println!("Feetech {series:?}: {bytes} bytes, {micros} us of 10000");
    }
    assert_eq!(BAUD, 1_000_000);
}

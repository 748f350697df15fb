//! The fault matrix: every fault at every packet of a session, on every bus.

use crate::session::{BAUD, IDS, Look, Rig, ax, dynamixel, dynamixel_plain, feetech, line};
use crate::wire::Fault;
use servo_wire::bus::ServoBus;
use servo_wire::feetech::Series;
use std::collections::BTreeMap;

/// All faults of a packet of this length.
fn faults(from_servo: bool, len: usize) -> Vec<Fault> {
    let mut all = vec![Fault::Drop, Fault::Duplicate, Fault::Noise];
    all.extend([400, 6000].map(Fault::Again));
    all.extend([200, 3000, 12_000].map(Fault::Delay));
    all.extend([1, len as isize / 2, -1].map(Fault::Truncate));
    all.extend((0..8 * len).map(Fault::Flip));
    all.extend((0..len).map(Fault::Lose));
    all.extend([1, 33, 252, 254].map(Fault::WrongId));
    all.extend([0, 1, 2, len as u8, 255].map(Fault::BadLength));
    all.extend([-2, -1, 1].map(Fault::Resized));
    all.extend([1000, 25_000].map(Fault::StuckLow));
    all.extend([1000, 25_000].map(Fault::Broken));
    if from_servo {
        all.extend((0..8).map(|bit| Fault::Refused(1 << bit)));
        all.extend([3, 5, 6, 7].map(Fault::Refused));
    } else {
        all.push(Fault::Echo);
    }
    all
}

fn name(fault: Fault) -> String {
    let text = format!("{fault:?}");
    text.split('(').next().unwrap_or_default().to_owned()
}

/// Plays the session with each fault; returns the number of cases.
fn matrix<S: Look, B: ServoBus>(what: &str, rig: impl Fn(Option<(usize, Fault)>) -> Rig<S, B>) -> usize {
    let mut clean = rig(None);
    let count = clean.play().unwrap_or_else(|error| panic!("{what} without a fault: {error}"));
    let complaints = clean.wire.servos(|servos| servos.complaints().to_vec());
    assert!(complaints.is_empty(), "{what} sends what servos refuse: {complaints:?}");
    let mut cases = BTreeMap::<String, usize>::new();
    for (at, (from_servo, packet)) in clean.wire.packets()[..count].iter().enumerate() {
        let len = packet.len();
        for fault in faults(*from_servo, len) {
            if let Err(error) = rig(Some((at, fault))).play() {
                panic!(
                    "{what}: {fault:?} at packet {at} (of {len} bytes, from a servo: {from_servo}): {error}"
                );
            }
            *cases.entry(name(fault)).or_default() += 1;
        }
    }
    let sum = cases.values().sum();
    println!("{what}: {sum} cases at {count} packets: {cases:?}");
    sum
}

#[test]
fn dynamixel_survives_every_fault_at_every_packet() {
    assert!(matrix("Dynamixel 2.0", |fault| dynamixel(&IDS, line(false), fault)) > 10_000);
}

#[test]
fn dynamixel_with_an_echo_survives_every_fault_at_every_packet() {
    assert!(matrix("Dynamixel 2.0 with echo", |fault| dynamixel(&IDS, line(true), fault)) > 10_000);
}

#[test]
fn dynamixel_with_plain_reads_survives_every_fault_at_every_packet() {
    assert!(matrix("Dynamixel 2.0, plain reads", |fault| dynamixel_plain(&IDS, line(false), fault)) > 10_000);
}

#[test]
fn ax_survives_every_fault_at_every_packet() {
    assert!(matrix("Dynamixel 1.0", |fault| ax(line(false), fault)) > 10_000);
}

#[test]
fn feetech_sts_survives_every_fault_at_every_packet() {
    assert!(matrix("Feetech STS", |fault| feetech(Series::Sts, line(false), fault)) > 10_000);
}

#[test]
fn feetech_scs_with_an_echo_survives_every_fault_at_every_packet() {
    assert!(matrix("Feetech SCS with echo", |fault| feetech(Series::Scs, line(true), fault)) > 10_000);
}

#[test]
fn slow_lines_work_too() {
    for baud in [9600, 57_600, 115_200, 4_000_000] {
        let slow = servo_wire::port::LineConfig { baud, ..line(false) };
        assert_eq!(BAUD, line(false).baud);
        dynamixel(&IDS[..3], slow, None).play().map(drop).unwrap_or_else(|error| panic!("{baud}: {error}"));
    }
}

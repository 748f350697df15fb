//! `bunraku puppet jog` and `bunraku puppet set-id`, on virtual servos behind a pseudo terminal.
#![allow(clippy::unwrap_used)]
#![cfg(unix)]

use bunraku_tests::bunraku;
use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::thread;
use std::time::Duration;
use virtual_servos::config::{ConfigError, ServoConfig};
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::protocol1::Protocol1Servos;
use virtual_servos::protocol1_models::Protocol1Family;
use virtual_servos::serve::{BYTE_GAP_US, Pty, Served};
use virtual_servos::virtual_bus::{Disturbance, Event, VirtualBus};

/// Serves a bus on a pseudo terminal until the test is over.
fn serve(bus: Box<dyn VirtualBus>) -> PathBuf {
    let mut pty = Pty::open().unwrap();
    let path = pty.path().to_owned();
    thread::spawn(move || pty.serve(Served::new(bus)));
    path
}

/// Two buses on one wire, on which both answer at once: where they say the same, it is heard, and elsewhere neither is.
struct AtOnce(Box<dyn VirtualBus>, Box<dyn VirtualBus>);

impl VirtualBus for AtOnce {
    fn receive(&mut self, bytes: &[u8], now_us: u64, tap: &mut dyn FnMut(Event)) -> Vec<u8> {
        let one = self.0.receive(bytes, now_us, tap);
        let mut both = self.1.receive(bytes, now_us, tap);
        if both.is_empty() {
            return one;
        }
        // A line that either pulls low is low.
        both.iter_mut().zip(one).for_each(|(both, one)| *both &= one);
        both
    }

    fn schedule(&mut self, _: u64, _: Disturbance) -> Result<(), ConfigError> {
        Ok(())
    }
}

/// Two buses on one wire, on which one answers after the other.
struct InTurn(Box<dyn VirtualBus>, Box<dyn VirtualBus>);

impl VirtualBus for InTurn {
    fn receive(&mut self, bytes: &[u8], now_us: u64, tap: &mut dyn FnMut(Event)) -> Vec<u8> {
        let mut both = self.0.receive(bytes, now_us, tap);
        both.extend(self.1.receive(bytes, now_us, tap));
        both
    }

    fn schedule(&mut self, _: u64, _: Disturbance) -> Result<(), ConfigError> {
        Ok(())
    }
}

/// Servos with these ids and positions.
fn bus(kind: &str, servos: &[(u8, i32)]) -> Box<dyn VirtualBus> {
    let max_position = if matches!(kind, "dynamixel" | "sts") { 4095 } else { 1023 };
    let servo = |&(id, position): &(u8, i32)| ServoConfig { position, max_position, ..ServoConfig::new(id) };
    let servos: Vec<ServoConfig> = servos.iter().map(servo).collect();
    let family = match kind {
        "dynamixel" => {
            let config = DynamixelConfig { servos, byte_gap_us: BYTE_GAP_US };
            return Box::new(DynamixelServos::new(&config).unwrap());
        }
        "dynamixel1" => Protocol1Family::AxMx,
        "sts" => Protocol1Family::Sts,
        _ => Protocol1Family::Scs,
    };
    let servos: Vec<_> = servos.into_iter().map(|servo| (servo, None)).collect();
    Box::new(Protocol1Servos::new(family, &servos, BYTE_GAP_US).unwrap())
}

const KINDS: [&str; 4] = ["dynamixel", "dynamixel1", "sts", "scs"];

/// Exit code, standard output and standard error.
fn run(command: &mut Command) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = command.output().unwrap();
    (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

fn set_id(port: &PathBuf, kind: &str, from: &str, to: &str) -> (Option<i32>, String, String) {
    let mut command = bunraku();
    command.args(["puppet", "set-id", "--json", "--kind", kind, "--from", from, "--to", to, "--on"]);
    run(command.arg(port))
}

fn ids(port: &PathBuf, kind: &str) -> Vec<u64> {
    let mut command = bunraku();
    command.args(["puppet", "scan", "--json", "--ids", "0-9", "--baud", "1000000", "--kind", kind, "--on"]);
    let (_, json, error) = run(command.arg(port));
    let report: Value = serde_json::from_str(&json).unwrap_or_else(|_| panic!("{json}{error}"));
    let found = report["servos"].as_array().unwrap().iter();
    found.map(|servo| servo["id"].as_u64().unwrap()).collect()
}

#[test]
fn a_servo_gets_another_id_and_no_other_is_touched() {
    for kind in KINDS {
        let port = serve(bus(kind, &[(1, 500), (3, 600)]));
        let (code, json, error) = set_id(&port, kind, "1", "5");
        assert_eq!(code, Some(0), "{kind}: {json}{error}");
        let report: Value = serde_json::from_str(&json).unwrap();
        assert_eq!((&report["from"], &report["to"]), (&1.into(), &5.into()));
        assert_eq!(ids(&port, kind), [3, 5], "{kind}");
        // The old id has nobody, and the other one is taken.
        let (code, _, error) = set_id(&port, kind, "1", "6");
        assert!(code == Some(1) && error.contains("answers to the id 1"), "{kind}: {error}");
        let (code, _, error) = set_id(&port, kind, "5", "3");
        assert!(code == Some(1) && error.contains("the id 3 is taken"), "{kind}: {error}");
        assert_eq!(ids(&port, kind), [3, 5], "{kind}");
    }
}

/// What `set-id` says is said to a servo whose supply then breaks in: an id that was written under the lock is the old one again.
#[test]
fn the_new_id_outlasts_a_restart() {
    for kind in KINDS {
        let mut servos = bus(kind, &[(1, 500)]);
        for packet in record(kind) {
            servos.receive(&packet, 0, &mut |_| {});
        }
        servos.schedule(0, Disturbance::Restart { servo: 5 }).unwrap();
        // It is away while it starts.
        let port = serve(servos);
        thread::sleep(Duration::from_millis(500));
        assert_eq!(ids(&port, kind), [5], "{kind}");
    }
}

/// What `set-id` says on the wire.
fn record(kind: &str) -> Vec<Vec<u8>> {
    struct Tapped(Box<dyn VirtualBus>, Sender<Vec<u8>>);
    impl VirtualBus for Tapped {
        fn receive(&mut self, bytes: &[u8], now_us: u64, tap: &mut dyn FnMut(Event)) -> Vec<u8> {
            let _ = self.1.send(bytes.to_vec());
            self.0.receive(bytes, now_us, tap)
        }
        fn schedule(&mut self, _: u64, _: Disturbance) -> Result<(), ConfigError> {
            Ok(())
        }
    }
    let (sender, packets) = channel();
    let port = serve(Box::new(Tapped(bus(kind, &[(1, 500)]), sender)));
    let (code, _, error) = set_id(&port, kind, "1", "5");
    assert_eq!(code, Some(0), "{kind}: {error}");
    packets.try_iter().collect()
}

#[test]
fn two_servos_of_one_id_are_refused_however_they_answer() {
    for kind in KINDS {
        let twins = || (bus(kind, &[(1, 341)]), bus(kind, &[(1, 682)]));
        let (one, other) = twins();
        let at_once = serve(Box::new(AtOnce(one, other)));
        let (one, other) = twins();
        let in_turn = serve(Box::new(InTurn(one, other)));
        for port in [at_once, in_turn] {
            let (code, _, error) = set_id(&port, kind, "1", "5");
            assert!(
                code == Some(1) && error.contains("more than one servo answers to the id 1"),
                "{kind}: {error}"
            );
        }
    }
}

/// A puppet of two servos on a bus of this kind.
fn puppet(folder: &Path, kind: &str) -> PathBuf {
    let path = folder.join("puppet.toml");
    let joint = |name: &str, id: u8| {
        format!(
            "[[joint]]\nname = '{name}'\nbus = 'one'\nchannel = 'head.r{id}'\nid = {id}\nzero = 500\nrange = [-40, 60]\nmax_speed = 400\n"
        )
    };
    let text = format!(
        "servo_hz = 50\n[[bus]]\nname = 'one'\nkind = '{kind}'\nbaud = 1_000_000\n{}{}",
        joint("head turn", 1).replace("head.r1", "head.ry"),
        joint("head nod", 2).replace("head.r2", "head.rx")
    );
    std::fs::write(&path, text).unwrap();
    path
}

fn jog(puppet: &PathBuf, port: &PathBuf) -> Command {
    let mut command = bunraku();
    command.args(["puppet", "jog"]).arg(puppet).arg("--json").arg("--on").arg(port);
    command
}

/// Goals in a degree, as the manuals have them.
fn per_degree(kind: &str) -> f64 {
    match kind {
        "dynamixel" | "sts" => 4096.0 / 360.0,
        "dynamixel1" => 1024.0 / 300.0,
        _ => 1024.0 / 200.0,
    }
}

#[test]
fn a_joint_goes_where_it_is_sent_within_its_speed_and_the_other_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    for kind in KINDS {
        let (goals, port) = {
            let (sender, goals) = channel();
            let mut pty = Pty::open().unwrap();
            let path = pty.path().to_owned();
            let mut served = Served::new(bus(kind, &[(1, 510), (2, 520)]));
            served.tap = Box::new(move |event| {
                if let Event::Goal { id, position, .. } = event {
                    let _ = sender.send((id, position));
                }
            });
            thread::spawn(move || pty.serve(served));
            (goals, path)
        };
        let puppet = puppet(folder.path(), kind);
        let (code, json, error) = run(jog(&puppet, &port).args(["head turn", "-30"]));
        assert_eq!(code, Some(0), "{kind}: {error}");
        let report: Value = serde_json::from_str(&json).unwrap();
        let expected = (500.0 - 30.0 * per_degree(kind)).round() as i32;
        let position = report["position"].as_i64().unwrap() as i32;
        assert!((position - expected).abs() <= 1, "{kind}: {json}, expected {expected}");
        let goals: Vec<(u8, i32)> = goals.try_iter().collect();
        // 400 degrees a second at 50 Hz.
        let step = (8.0 * per_degree(kind)).ceil() as i32 + 1;
        assert!(goals.iter().all(|(id, _)| *id == 1), "{kind}: {goals:?}");
        assert!(goals.windows(2).all(|two| (two[1].1 - two[0].1).abs() <= step), "{kind}: {goals:?}");
        assert!((goals[0].1 - 510).abs() <= step && goals.len() > 4, "{kind}: {goals:?}");
        // Beyond its range it does not go, and a joint that is none is told from those there are.
        let (code, _, error) = run(jog(&puppet, &port).args(["head turn", "80"]));
        assert!(
            code == Some(1) && error.contains("head turn goes from -") && error.contains("degrees, found 80"),
            "{error}"
        );
        let (code, _, error) = run(jog(&puppet, &port).args(["nose", "0"]));
        assert!(code == Some(1) && error.contains("expected one of: head turn, head nod"), "{error}");
    }
}

#[test]
fn lines_move_joints_and_mistakes_end_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let port = serve(bus("dynamixel", &[(1, 510), (2, 520)]));
    let puppet = puppet(folder.path(), "dynamixel");
    let mut process = jog(&puppet, &port)
        .arg("--torque-off")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    process
        .stdin
        .take()
        .unwrap()
        .write_all(b"head turn 10\nhead nod far\nhead nod -20.5\n\nhead nod 0\n")
        .unwrap();
    let Output { status, stdout, stderr } = process.wait_with_output().unwrap();
    let (said, error) = (String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap());
    assert!(status.success(), "{error}");
    let moves: Vec<Value> = said.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(moves.len(), 2, "{said}");
    assert!((moves[1]["degrees"].as_f64().unwrap() + 20.5).abs() < 0.1, "{said}");
    assert!(error.contains("found \"far\", expected degrees"), "{error}");
}

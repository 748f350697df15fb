//! Virtual servos that do the wrong things that people's servos do, in simulated time: each is a fault with the servo's id and its
//! joint's name. And servos on a pty that share no code with ours, where they are there.
#![allow(clippy::unwrap_used)]
#![cfg(unix)]

use bunraku_tests::clock::SimulatedClock;
use bunraku_tests::{bunraku, cases};
use embedded_hal_async::delay::DelayNs;
use encoder::qmd::{Method, Parameters, encode};
use firmware::machine::State;
use firmware::map::BusKind;
use host_sim::clip::Clip;
use host_sim::play::Performance;
use host_sim::ports::{self, Clock, Played, SerialBus};
use host_sim::puppet::joint_names::JointNames;
use puppet_file::Puppet;
use servo_wire::port::LineConfig;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::AtomicUsize;
use virtual_servos::config::ServoConfig;
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::protocol1::Protocol1Servos;
use virtual_servos::protocol1_models::Protocol1Family;
use virtual_servos::uart::InProcessUart;
use virtual_servos::virtual_bus::{Disturbance, Event, VirtualBus};

/// Nobody waits for a servo that answers at once.
struct NoDelay;

impl DelayNs for NoDelay {
    async fn delay_ns(&mut self, _: u32) {}
}

/// A puppet of the servos 7 and 3 on a bus of this kind.
fn puppet(kind: &str, head: &str, joint: &str) -> Puppet {
    let joints = [(7, "left elbow", "rradius.rx"), (3, "neck", "head.ry")].map(|(id, name, channel)| {
        format!("[[joint]]\nname = '{name}'\nchannel = '{channel}'\nid = {id}\nmax_speed = 200\n{joint}\n")
    });
    let text = format!(
        "servo_hz = 50\nease_seconds = 1.0\n{head}\n[[bus]]\nname = 'b'\nkind = '{kind}'\nbaud = 1_000_000\n{}",
        joints.concat()
    );
    Puppet::parse(Path::new("puppet.toml"), text).unwrap()
}

/// What was played, and the goals that servos took, each with its microsecond.
struct Evening {
    played: Played,
    told: Vec<(u64, u8, i32)>,
    torque_off: bool,
}

/// Plays the sample's clip on such a puppet, and on virtual servos that something happens to.
fn play(puppet: &Puppet, kind: BusKind, torque_off: bool, events: &[(u64, Disturbance)]) -> Evening {
    let sample = mocap::sample::clip();
    let map = puppet.map(&sample.skeleton).unwrap();
    let bytes = encode(&sample, Parameters::TABLE_1, Method::ClosedLoop).unwrap();
    let clip = Clip::parse(Path::new("clip.qmd"), &bytes).unwrap();
    let configs =
        map.joints().iter().map(|joint| ServoConfig { position: joint.home, ..ServoConfig::new(joint.id) });
    let mut servos: Box<dyn VirtualBus> = match kind {
        BusKind::Dynamixel => {
            let config = DynamixelConfig { servos: configs.collect(), ..DynamixelConfig::with_ids(&[]) };
            Box::new(DynamixelServos::new(&config).unwrap())
        }
        kind => {
            let family = if kind == BusKind::Sts { Protocol1Family::Sts } else { Protocol1Family::AxMx };
            let most = family.max_position(None);
            let configs: Vec<_> =
                configs.map(|config| (ServoConfig { max_position: most, ..config }, None)).collect();
            Box::new(Protocol1Servos::new(family, &configs, 10_000).unwrap())
        }
    };
    for (at, event) in events {
        servos.schedule(*at, *event).unwrap();
    }
    let (clock, mut told) = (SimulatedClock::new(|_| {}), Vec::new());
    let hear = |bytes: &[u8]| {
        servos.receive(bytes, clock.now().as_micros() as u64, &mut |event| {
            if let Event::Goal { time_us, id, position } = event {
                told.push((time_us, id, position));
            }
        })
    };
    let bus = SerialBus::on(kind, InProcessUart::new(hear), NoDelay, LineConfig::uart(1_000_000));
    let names = JointNames::of(puppet, &map);
    let performance = Performance { names, torque_off, ..Performance::of(&clip, 0) };
    let mut said = String::new();
    let mut say = |line: ports::Told<'_>| {
        if let ports::Told::Line(line) = line {
            said += line;
        }
    };
    let played = ports::play(&performance, &map, bus, &clock, &AtomicUsize::new(0), &mut say).unwrap();
    Evening { played, told, torque_off: said.contains("torque is off") }
}

const RANGE: &str = "range = [-45, 45]";

/// What happens at the start to the servo 3, whose place in the map is 1.
fn failed(kind: BusKind, name: &str, events: &[(u64, Disturbance)]) -> String {
    let Evening { played, .. } = play(&puppet(name, "", RANGE), kind, false, events);
    assert_eq!(played.state, State::Holding);
    played.failed.unwrap()
}

fn set(address: u16, value: i64) -> (u64, Disturbance) {
    (0, Disturbance::Set { servo: 3, address, value })
}

#[test]
fn servos_that_do_not_follow_are_named() {
    let stuck = (0, Disturbance::Stick { servo: 3, seconds: 1e5 });
    for (kind, name, events) in [
        (BusKind::Dynamixel, "dynamixel", vec![stuck]),
        // Operating Mode (11): velocity. Goal positions do nothing to it.
        (BusKind::Dynamixel, "dynamixel", vec![set(11, 1)]),
        // Its own limits are narrower than the joint's.
        (BusKind::Dynamixel, "dynamixel", vec![set(48, 2060), set(52, 2040)]),
        (BusKind::Sts, "sts", vec![stuck]),
        // Operation Mode (33): wheel.
        (BusKind::Sts, "sts", vec![set(33, 1)]),
        (BusKind::Dynamixel1, "dynamixel1", vec![stuck]),
        // Torque Limit (34), as after an overload.
        (BusKind::Dynamixel1, "dynamixel1", vec![set(34, 0)]),
    ] {
        let failed = failed(kind, name, &events);
        assert!(
            failed.starts_with("servo 3 (neck) does not follow: it is told"),
            "{name} {events:?}: {failed}"
        );
    }
}

/// Nothing is wrong with servos that are slow: with the least useful profile they come after what they are told.
#[test]
fn a_slow_profile_is_no_fault() {
    // Profile Velocity (112): 5 times 0.229 turns a minute are 7 degrees a second.
    let evening = play(&puppet("dynamixel", "", RANGE), BusKind::Dynamixel, false, &[set(112, 5)]);
    assert_eq!((evening.played.failed, evening.played.state), (None, State::Resting));
}

#[test]
fn a_servo_beyond_its_turn_is_not_run_around() {
    let joint = "zero = 3500\nrange = [-44, 44]";
    for position in [4200, 104] {
        let turned = (0, Disturbance::Turn { servo: 3, position });
        let Evening { played, told, .. } =
            play(&puppet("dynamixel", "", joint), BusKind::Dynamixel, false, &[turned]);
        let failed = played.failed.unwrap();
        assert!(failed.starts_with("servo 3 (neck) stands at 104, outside its range"), "{failed}");
        let told: Vec<i32> = told.iter().filter(|(_, id, _)| *id == 3).map(|(.., goal)| *goal).collect();
        assert!(told.iter().all(|goal| *goal == 104), "{position}: {told:?}");
    }
    // In extended position mode the numbers lead back, and it eases in.
    let turned = (1, Disturbance::Turn { servo: 3, position: 4200 });
    let Evening { played, told, .. } =
        play(&puppet("dynamixel", "", joint), BusKind::Dynamixel, false, &[set(11, 4), turned]);
    assert_eq!((played.failed, played.state), (None, State::Resting));
    let told: Vec<i32> = told.iter().filter(|(_, id, _)| *id == 3).map(|(.., goal)| *goal).collect();
    // 200 degrees a second are 45.5 goal units a tick, and a way eases at a quarter of that.
    let ways = told.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    assert!(told[0] == 4200 && ways.clone().take(50).max().is_some_and(|most| (1..=12).contains(&most)));
}

#[test]
fn a_joint_outside_its_range_eases_in() {
    let turned = (0, Disturbance::Turn { servo: 3, position: 2900 });
    let Evening { played, told, .. } =
        play(&puppet("dynamixel", "", RANGE), BusKind::Dynamixel, false, &[turned]);
    assert_eq!((played.failed, played.state), (None, State::Resting));
    let told: Vec<i32> = told.iter().filter(|(_, id, _)| *id == 3).map(|(.., goal)| *goal).collect();
    let outside = told.windows(2).take_while(|pair| pair[1] > 2560);
    let most = outside.map(|pair| (pair[1] - pair[0]).abs()).max();
    assert!(most.is_some_and(|most| (4..=12).contains(&most)), "{most:?}");
}

/// Letting go at the end is repeated until each has confirmed it, and one that does not is told.
#[test]
fn who_may_still_hold_is_told() {
    let puppet = puppet("dynamixel", "", RANGE);
    let clean = play(&puppet, BusKind::Dynamixel, true, &[]);
    assert_eq!((clean.played.failed, clean.torque_off), (None, true));
    let end = clean.told.last().unwrap().0;
    // Gone for half a second it is asked again; gone for good it may hold.
    for (seconds, expected) in [(0.5, None), (1e5, Some("servo 3 (neck) may still hold"))] {
        let gone = (end + 5000, Disturbance::Silence { servo: 3, seconds });
        let Evening { played, .. } = play(&puppet, BusKind::Dynamixel, true, &[gone]);
        let failed = played.failed.unwrap_or_default();
        assert!(
            expected.map_or(failed.is_empty(), |expected| failed.contains(expected)),
            "{seconds}: {failed}"
        );
    }
    // And so where a fault lets the puppet go.
    let puppet = puppet_that_lets_go();
    let gone = (end / 2, Disturbance::Silence { servo: 3, seconds: 1e5 });
    let Evening { played, .. } = play(&puppet, BusKind::Dynamixel, false, &[gone]);
    let failed = played.failed.unwrap();
    assert_eq!(played.state, State::LettingGo);
    assert!(
        failed.starts_with("servo 3 (neck) does not answer")
            && failed.contains("servo 3 (neck) may still hold"),
        "{failed}"
    );
}

fn puppet_that_lets_go() -> Puppet {
    puppet("dynamixel", "on_fault = 'torque-off'", RANGE)
}

/// A motion of one joint, as the cases want it.
fn write_swing(path: &Path) {
    let mut text = "HIERARCHY\nROOT Hips\n{\nOFFSET 0 90 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n\
                    JOINT Spine\n{\nOFFSET 0 20 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 0 15 0\n}\n}\n}\n\
                    MOTION\nFrames: 90\nFrame Time: 0.0333333\n"
        .to_owned();
    for frame in 0..90 {
        let angle = 20.0 * (f64::from(frame) / 9.5).sin();
        text += &format!("0 0 0 0 0 0 0 {angle:.4} 0\n");
    }
    std::fs::write(path, text).unwrap();
}

/// `bunraku play` on servos of Python, which share no code with ours, in real time.
#[test]
fn servos_that_share_no_code_with_ours_are_told_of_as_well() {
    let Some(cases) = cases().map(|cases| cases.join("servo")) else { return };
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_swing(&at("swing.bvh"));
    let made =
        bunraku().arg("encode").arg(at("swing.bvh")).arg("-o").arg(at("swing.mclip")).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let mut judged = 0;
    for (case, fake, puppet, expected) in [
        ("ok", "fakedxl", "one", ""),
        ("stuck", "fakedxl", "one", "servo 1 (spine bend) does not follow"),
        ("near", "fakedxl", "near", "servo 1 (spine bend) stands at 104, outside its range"),
        ("outside", "fakedxl", "one", ""),
        ("mode1", "fakedxl", "one", "Operating Mode (11) is 1"),
        ("limits", "fakedxl", "one", "Max Position Limit (48) is 2200"),
        ("sts_ok", "fakep1", "sts", ""),
        ("sts_wheel", "fakep1", "sts", "Operation Mode (33) is 1"),
        ("ax_ok", "fakep1", "dynamixel1", ""),
        ("ax_torque_limit_0", "fakep1", "dynamixel1", "Torque Limit (34) is 0"),
    ] {
        std::fs::copy(cases.join(format!("{case}.json")), at(&format!("{case}.json"))).unwrap();
        // A machine that is busy makes ticks late, which is no case of this.
        let said = (0..5).find_map(|_| {
            let mut servos = Command::new("python3")
                .arg(cases.join(format!("{fake}.py")))
                .arg(at(&format!("{case}.json")))
                .stdout(Stdio::piped())
                .spawn()
                .unwrap();
            let mut port = String::new();
            BufReader::new(servos.stdout.take().unwrap()).read_line(&mut port).unwrap();
            let mut play = bunraku();
            play.arg("play").arg(at("swing.mclip")).arg("--puppet").arg(cases.join(format!("{puppet}.toml")));
            let output = play.arg("--on").arg(port.trim()).output().unwrap();
            servos.kill().unwrap();
            servos.wait().unwrap();
            let said = String::from_utf8(output.stderr).unwrap();
            let busy = ["ticks come too late", "does not answer", "no servo can be reached"];
            // What is expected counts on any machine.
            let as_expected = !expected.is_empty() && said.contains(expected);
            let is_busy = !as_expected && busy.iter().any(|busy| said.contains(busy));
            (!is_busy).then_some((output.status.success(), said))
        });
        let Some((success, said)) = said else {
            eprintln!("this machine is too busy for servos in real time: {case}");
            continue;
        };
        assert_eq!(success, expected.is_empty(), "{case}: {said}");
        assert!(said.contains(expected), "{case}: {said}");
        judged += 1;
    }
    assert!(judged > 0, "this machine was too busy for each of the cases");
}

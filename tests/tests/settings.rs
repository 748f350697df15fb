//! What servos are set to before they are armed: virtual ones with every setting that makes movements wrong, and servos in
//! Python that share no code with ours.
#![allow(clippy::unwrap_used)]
#![cfg(unix)]

use bunraku_tests::{bunraku, cases, require_program};
use embassy_futures::block_on;
use firmware::map::BusKind;
use host_sim::ports::SerialBus;
use host_sim::puppet_servos;
use host_sim::settings::{self, Found, Judged};
use mocap::sample;
use puppet_file::{Map, Puppet};
use serde_json::Value;
use servo_wire::port::LineConfig;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use virtual_servos::uart::{InProcessUart, ZeroDelay};
use virtual_servos::virtual_bus::{Disturbance, VirtualBus};

/// A puppet of one joint with the id 1, which goes 45 degrees to both sides of the servo's middle.
fn puppet_of(kind: BusKind, more: &str) -> (Puppet, Map) {
    let bus = format!("[[bus]]\nname = 'arm'\nkind = '{}'\nbaud = 1_000_000\n", kind.name());
    let joint = "[[joint]]\nname = 'bend'\nchannel = 'head.ry'\nid = 1\nrange = [-45, 45]\nmax_speed = 200\n";
    let text = format!("servo_hz = 50\nservo_watchdog_ms = 0\n{bus}{joint}{more}");
    let puppet = Puppet::parse(Path::new("puppet.toml"), text).unwrap();
    let map = puppet.map(puppet.channels().unwrap()).unwrap();
    (puppet, map)
}

/// A virtual servo with the id 1 that is set like this from the start.
fn servo(kind: BusKind, set: &[(u16, i64)]) -> Box<dyn VirtualBus> {
    let mut servos = puppet_servos::without_puppet(kind, &[1]).virtual_bus(1500).unwrap().unwrap();
    for &(address, value) in set {
        servos.schedule(0, Disturbance::Set { servo: 1, address, value }).unwrap();
    }
    servos
}

/// Looks at a servo, sets it right where `fix` says so and looks again.
fn look(kind: BusKind, set: &[(u16, i64)], more: &str, fix: bool) -> (Found, Vec<settings::Fixed>) {
    let (mut servos, mut now_us) = (servo(kind, set), 0);
    let uart = InProcessUart::new(|bytes: &[u8]| {
        now_us += 1000;
        servos.receive(bytes, now_us, &mut |_| ())
    });
    let mut bus = SerialBus::on(kind, uart, ZeroDelay, LineConfig::uart(1_000_000));
    let (puppet, map) = puppet_of(kind, more);
    let expected = settings::expected(&puppet, Some(&map)).unwrap().remove(0).remove(0);
    let mut found = block_on(settings::survey(&mut bus, kind, &expected)).unwrap();
    let mut fixed = Vec::new();
    if fix {
        fixed = block_on(settings::fix(&mut bus, kind, &found, false)).unwrap();
        found = block_on(settings::survey(&mut bus, kind, &expected)).unwrap();
    }
    (found, fixed)
}

fn worst(found: &Found) -> Option<Judged> {
    found.mismatches.iter().map(|mismatch| mismatch.judged).max()
}

const REFUSED: Judged = Judged::Refused;
const WARNED: Judged = Judged::Warned;

/// What a servo is set to, how that is judged, and a part of the sentence.
type Case = (BusKind, &'static [(u16, i64)], Judged, &'static str);

const CASES: [Case; 34] = [
    (BusKind::Dynamixel, &[(11, 0)], REFUSED, "Operating Mode (11) is 0 (current), expected 3 (position)"),
    (BusKind::Dynamixel, &[(11, 1)], REFUSED, "Operating Mode (11) is 1 (velocity), expected 3 (position)"),
    (BusKind::Dynamixel, &[(11, 16)], REFUSED, "Operating Mode (11) is 16 (PWM), expected 3 (position)"),
    (BusKind::Dynamixel, &[(11, 4)], WARNED, "Operating Mode (11) is 4 (extended position)"),
    (BusKind::Dynamixel, &[(11, 5)], WARNED, "Operating Mode (11) is 5 (current-based position)"),
    (BusKind::Dynamixel, &[(11, 5), (102, 0)], REFUSED, "Goal Current (102) is 0, expected 1193"),
    (BusKind::Dynamixel, &[(52, 1900)], REFUSED, "Min Position Limit (52) is 1900, expected 1536 or less"),
    (BusKind::Dynamixel, &[(48, 2200)], REFUSED, "the joint goes to 45.0, the servo to 13.4"),
    (BusKind::Dynamixel, &[(36, 0)], REFUSED, "PWM Limit (36) is 0, expected 885"),
    (BusKind::Dynamixel, &[(100, 0)], REFUSED, "Goal PWM (100) is 0, expected 885"),
    (BusKind::Dynamixel, &[(100, 200)], WARNED, "with 23 % of its power"),
    (BusKind::Dynamixel, &[(68, 1)], REFUSED, "Status Return Level (68) is 1, expected 2"),
    (BusKind::Dynamixel, &[(68, 0)], REFUSED, "it answers pings and no reads"),
    (
        BusKind::Dynamixel,
        &[(98, 255)],
        REFUSED,
        "Bus Watchdog (98) is 255 (it stopped the servo), expected 0",
    ),
    (BusKind::Dynamixel, &[(98, 10)], WARNED, "Bus Watchdog (98) is 10 (200 ms), expected 0"),
    (BusKind::Dynamixel, &[(10, 1)], WARNED, "it turns the other way round"),
    (BusKind::Dynamixel, &[(10, 4), (112, 500)], WARNED, "Profile Velocity (112) is 500 ms"),
    (BusKind::Dynamixel, &[(20, -512)], WARNED, "shifted by -45.0 degrees"),
    (BusKind::Dynamixel, &[(112, 50)], WARNED, "it does 69 a second where the joint's max_speed is 200"),
    (BusKind::Dynamixel, &[(112, 400), (108, 20)], WARNED, "Profile Acceleration (108) is 20"),
    (BusKind::Dynamixel, &[(70, 32)], WARNED, "Hardware Error Status (70) is 32, expected 0"),
    (
        BusKind::Dynamixel1,
        &[(6, 0), (8, 0)],
        REFUSED,
        "CCW Angle Limit (8) is 0, and CW Angle Limit (6) too (wheel mode)",
    ),
    (BusKind::Dynamixel1, &[(8, 600)], REFUSED, "CCW Angle Limit (8) is 600, expected 666 or more"),
    (BusKind::Dynamixel1, &[(34, 0)], REFUSED, "Torque Limit (34) is 0, as after an overload, expected 1023"),
    (BusKind::Dynamixel1, &[(34, 300)], WARNED, "with 29 % of its power"),
    (BusKind::Dynamixel1, &[(16, 1)], REFUSED, "Status Return Level (16) is 1, expected 2"),
    (BusKind::Dynamixel1, &[(16, 0)], REFUSED, "it answers pings and no reads"),
    (BusKind::Dynamixel1, &[(32, 100)], WARNED, "Moving Speed (32) is 100"),
    (BusKind::Sts, &[(33, 1)], REFUSED, "Operation Mode (33) is 1 (wheel), expected 0 (position)"),
    (BusKind::Sts, &[(9, 1900)], REFUSED, "Min Angle Limit (9) is 1900, expected 1536 or less"),
    (BusKind::Sts, &[(48, 0)], REFUSED, "Torque Limit (48) is 0, expected 1000"),
    (BusKind::Sts, &[(8, 0)], REFUSED, "Response Status Level (8) is 0, expected 1"),
    (
        BusKind::Scs,
        &[(9, 0), (11, 0)],
        REFUSED,
        "Max Angle Limit (11) is 0, and Min Angle Limit (9) too (wheel mode)",
    ),
    (BusKind::Scs, &[(16, 0)], REFUSED, "Max Torque (16) is 0, expected 1000"),
];

#[test]
fn what_a_servo_is_set_to_is_named_and_judged() {
    for (kind, set, judged, expected) in CASES {
        let (found, _) = look(kind, set, "", false);
        let sentences: Vec<String> = found.sentences(Judged::Noted).collect();
        assert!(sentences.iter().any(|sentence| sentence.contains(expected)), "{set:?}: {sentences:#?}");
        assert!(
            sentences.iter().all(|sentence| sentence.starts_with("servo 1 (\"bend\"): ")),
            "{sentences:#?}"
        );
        assert_eq!(worst(&found), Some(judged), "{kind:?} {set:?}: {sentences:#?}");
    }
}

#[test]
fn a_healthy_servo_is_not_complained_of() {
    for kind in [BusKind::Dynamixel, BusKind::Dynamixel1, BusKind::Sts, BusKind::Scs] {
        let (found, _) = look(kind, &[], "", false);
        assert!(
            found.answers && worst(&found).is_none_or(|worst| worst == Judged::Noted),
            "{kind:?}: {found:?}"
        );
    }
}

#[test]
fn what_is_amiss_is_set_right_and_read_back() {
    for (kind, set, _, expected) in CASES {
        // A hardware error takes a restart.
        if set[0].0 == 70 {
            continue;
        }
        let (found, fixed) = look(kind, set, "", true);
        assert!(!fixed.is_empty() && fixed.iter().all(|fixed| fixed.done), "{expected}: {fixed:#?}");
        let left: Vec<String> = found.sentences(Judged::Noted).collect();
        // A second look finds what the first one could not read.
        let mute = expected.contains("pings");
        assert!(
            left.is_empty() || mute && worst(&found) == Some(Judged::Noted),
            "{kind:?} {set:?}: {left:#?}"
        );
    }
}

#[test]
fn nothing_is_written_to_the_eeprom_of_a_servo_that_holds() {
    for (kind, torque, mode) in [(BusKind::Dynamixel, 64, 11), (BusKind::Sts, 40, 33)] {
        let (found, fixed) = look(kind, &[(mode, 1), (torque, 1)], "", true);
        let said = fixed.iter().find(|fixed| !fixed.done).unwrap();
        assert!(said.sentence.contains("add --torque-off to let it go"), "{said:?}");
        assert_eq!(worst(&found), Some(Judged::Refused));
    }
}

#[test]
fn extended_positions_are_good_within_the_first_turn_only() {
    let (found, _) = look(BusKind::Dynamixel, &[(11, 4), (132, 5000)], "", false);
    // Nobody writes where a servo is; somebody turns it.
    assert_eq!(worst(&found), Some(Judged::Warned));
    let (mut servos, mut now_us) = (servo(BusKind::Dynamixel, &[(11, 4)]), 0);
    servos.schedule(1, Disturbance::Turn { servo: 1, position: 5000 }).unwrap();
    let uart = InProcessUart::new(|bytes: &[u8]| {
        now_us += 1000;
        servos.receive(bytes, now_us, &mut |_| ())
    });
    let mut bus = SerialBus::on(BusKind::Dynamixel, uart, ZeroDelay, LineConfig::uart(1_000_000));
    let (puppet, map) = puppet_of(BusKind::Dynamixel, "");
    let expected = settings::expected(&puppet, Some(&map)).unwrap().remove(0).remove(0);
    let found = block_on(settings::survey(&mut bus, BusKind::Dynamixel, &expected)).unwrap();
    let sentence = found.sentences(Judged::Refused).next().unwrap();
    assert!(sentence.contains("counts turns and stands at 5000"), "{sentence}");
}

/// An SCS0009 has 300 degrees in the goals in which an SCS15 has 200, and an MX a turn in four times those of an AX.
#[test]
fn a_model_has_its_own_degrees() {
    let joint = |kind, more: &str| {
        let (_, map) = puppet_of(kind, more);
        (map.joints()[0].min, map.joints()[0].zero, map.joints()[0].max)
    };
    assert_eq!(joint(BusKind::Scs, ""), (282, 512, 742));
    assert_eq!(joint(BusKind::Scs, "model = 'SCS0009'"), (358, 512, 666));
    assert_eq!(joint(BusKind::Dynamixel1, "model = 'MX-28'"), (1536, 2048, 2560));
    for (kind, model_at, number, name) in
        [(BusKind::Scs, 3, 1284, "SCS0009"), (BusKind::Dynamixel1, 0, 29, "MX-28")]
    {
        let (found, _) = look(kind, &[(model_at, number)], "", false);
        let sentence = found.sentences(Judged::Refused).next().unwrap();
        assert!(sentence.contains(&format!("give the joint model = \"{name}\"")), "{sentence}");
        let (found, _) = look(BusKind::Scs, &[(3, 1284)], "model = 'SCS0009'", false);
        assert!(found.sentences(Judged::Warned).next().is_none(), "{found:?}");
    }
}

/// Somebody who serves servos in a process of their own.
struct Servos {
    process: Child,
    port: String,
}

impl Servos {
    fn start(command: &mut Command) -> Self {
        let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut port = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut port).unwrap();
        Self { process, port: port.trim().to_owned() }
    }

    /// Ours, as a puppet says, and set like this.
    fn ours(puppet: &Path, set: &[&str]) -> Self {
        let mut command = bunraku();
        command.arg("servos").arg("--config").arg(puppet);
        set.iter().for_each(|set| {
            command.args(["--set", set]);
        });
        Self::start(&mut command)
    }
}

impl Drop for Servos {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A puppet's file, and a clip that it can play.
struct Given {
    folder: tempfile::TempDir,
    puppet: PathBuf,
    clip: PathBuf,
}

impl Given {
    fn new(kind: BusKind) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        let (puppet, clip, motion) = (file("puppet.toml"), file("sample.mclip"), file("sample.amc"));
        fs::write(&puppet, puppet_of(kind, "").0.source().1).unwrap();
        fs::write(file("sample.asf"), sample::asf()).unwrap();
        let (sample, mut amc) = (sample::clip(), Vec::new());
        let rotations = mocap::export::amc::Rotations::AsTheyAre;
        mocap::export::amc::write(&mut amc, &sample.skeleton, &sample.motion, rotations).unwrap();
        fs::write(&motion, amc).unwrap();
        let mut encode = bunraku();
        encode.arg("encode").arg(&motion).arg("--skeleton").arg(file("sample.asf"));
        let (code, _, error) = run(encode.args(["--codec", "dpcm", "-o"]).arg(&clip));
        assert_eq!(code, Some(0), "{error}");
        Self { folder, puppet, clip }
    }

    fn check(&self, port: &str, more: &[&str]) -> (Option<i32>, String, String) {
        run(bunraku().args(["puppet", "check"]).arg(&self.puppet).args(["--on", port]).args(more))
    }

    fn scan(&self, port: &str, more: &[&str]) -> (Option<i32>, String, String) {
        run(bunraku().args(["puppet", "scan", "--on", port, "--puppet"]).arg(&self.puppet).args(more))
    }

    /// Plays four seconds of the clip in one.
    fn play(&self, port: &str) -> (Option<i32>, String, String) {
        let mut play = bunraku();
        play.arg("play").arg(&self.clip).arg("--puppet").arg(&self.puppet).args(["--on", port, "--json"]);
        run(play.args(["--fps", "480"]))
    }
}

/// Exit code, standard output and standard error.
fn run(command: &mut Command) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = command.output().unwrap();
    (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

/// Whether it came to its end, or this machine was too busy for it, which the player must say.
fn played((code, json, error): (Option<i32>, String, String)) {
    if code == Some(0) {
        let report: Value = serde_json::from_str(&json).unwrap();
        assert_eq!(report["state"], "Resting", "{json}");
        return;
    }
    let late = ["ticks come too late", "did not answer in time"].iter().any(|why| error.contains(why));
    println!("measured: this machine is too late: {error}");
    assert!(late, "{error}");
}

#[test]
fn a_servo_that_is_set_wrong_is_not_armed_until_it_is_set_right() {
    let given = Given::new(BusKind::Dynamixel);
    let servos = Servos::ours(&given.puppet, &["1:operating-mode=1", "1:68=1", "1:max-position-limit=2200"]);
    let (code, text, _) = given.scan(&servos.port, &["--settings"]);
    assert_eq!(code, Some(1), "{text}");
    for expected in
        ["Operating Mode (11) is 1 (velocity)", "5 of 5", "bunraku puppet check", "Max Position Limit"]
    {
        assert!(text.contains(expected), "{expected:?} is not in {text}");
    }
    let (code, _, error) = given.play(&servos.port);
    assert!(code == Some(1) && error.contains("nothing was armed"), "{error}");
    let lines = error.lines().filter(|line| line.contains("servo 1 (\"bend\")")).count();
    assert!(lines == 3 && error.contains("with --fix sets right what can be set"), "{error}");
    let (code, json, error) = given.check(&servos.port, &["--json"]);
    let report: Value = serde_json::from_str(&json).unwrap();
    assert_eq!((code, &report["servos"]["servos"][0]["joint"]), (Some(1), &"bend".into()), "{error}");
    let (code, text, error) = given.check(&servos.port, &["--fix"]);
    assert!(
        code == Some(0) && text.contains("Operating Mode (11) was 1 (velocity), and is 3 now"),
        "{text}{error}"
    );
    assert_eq!(given.check(&servos.port, &[]).0, Some(0));
    played(given.play(&servos.port));
}

#[test]
fn doubtful_settings_are_told_once_and_played() {
    let given = Given::new(BusKind::Sts);
    let servos = Servos::ours(&given.puppet, &["1:goal-speed=300"]);
    let (code, json, error) = given.play(&servos.port);
    assert_eq!(error.matches("Goal Speed (46) is 300").count(), 1, "{error}");
    played((code, json, error));
}

/// XL330 and XC330 among others, old firmware, and firmware that says it is new and has no Fast Sync Read.
#[test]
fn every_model_and_firmware_is_read() {
    let given = Given::new(BusKind::Dynamixel);
    let text = fs::read_to_string(&given.puppet).unwrap();
    let second =
        "[[joint]]\nname = 'turn'\nchannel = 'head.rx'\nid = 2\nrange = [-45, 45]\nmax_speed = 200\n";
    fs::write(&given.puppet, format!("{text}{second}")).unwrap();
    for set in [
        &["1:model-number=1200"][..],
        &["1:model-number=1240", "2:model-number=1190"],
        &["2:firmware-version=44"],
        &["1:model-number=1220", "1:firmware-version=40"],
    ] {
        let servos = Servos::ours(&given.puppet, set);
        assert_eq!(given.scan(&servos.port, &[]).0, Some(0), "{set:?}");
        played(given.play(&servos.port));
    }
}

#[test]
fn servos_need_no_puppet() {
    let servos = Servos::start(bunraku().args(["servos", "--ids", "3-4,9", "--kind", "sts"]));
    let (code, text, error) = run(bunraku().args([
        "puppet",
        "scan",
        "--kind",
        "sts",
        "--ids",
        "1-10",
        "--baud",
        "1000000",
        "--on",
        &servos.port,
    ]));
    assert!(code == Some(0) && text.lines().count() == 4 && text.contains("STS3215"), "{text}{error}");
    for (set, expected) in [("1:33=1", "there is no servo 1"), ("3:colour=1", "has no register \"colour\"")] {
        let (code, _, error) = run(bunraku().args(["servos", "--ids", "3", "--kind", "sts", "--set", set]));
        assert!(code == Some(1) && error.contains(expected), "{error}");
    }
}

/// Servos in Python that were written from the manuals by somebody else.
#[test]
fn servos_that_share_no_code_with_ours() {
    let Some(cases) = cases() else { return };
    if !require_program("python3") {
        return;
    }
    let fake = |given: &Given, case: &str, script: &str| {
        let folder = given.folder.path();
        let own = |name: &str| folder.join(name);
        fs::copy(cases.join("servo").join(script), own(script)).unwrap();
        // Long enough for a machine that is busy.
        let config = fs::read_to_string(cases.join("servo").join(case)).unwrap();
        let mut config: Value = serde_json::from_str(&config).unwrap();
        config["seconds"] = 600.into();
        fs::write(own(case), config.to_string()).unwrap();
        Servos::start(Command::new("python3").arg(own(script)).arg(own(case)))
    };
    let good = [
        (BusKind::Dynamixel, "ok.json", "fakedxl.py"),
        (BusKind::Dynamixel, "xl330.json", "fakedxl.py"),
        (BusKind::Dynamixel, "nofast.json", "fakedxl.py"),
        (BusKind::Sts, "sts_ok.json", "fakep1.py"),
        (BusKind::Dynamixel1, "ax_ok.json", "fakep1.py"),
    ];
    for (kind, case, script) in good {
        let given = Given::new(kind);
        let servos = fake(&given, case, script);
        let (code, text, error) = given.check(&servos.port, &[]);
        assert_eq!(code, Some(0), "{case}: {text}{error}");
        let (code, json, error) = given.play(&servos.port);
        assert!(!error.contains("bunraku: servo"), "{case}: {error}");
        played((code, json, error));
    }
    let wrong = [
        (BusKind::Dynamixel, "mode1.json", "fakedxl.py", "Operating Mode (11) is 1 (velocity)"),
        (
            BusKind::Dynamixel,
            "limits.json",
            "fakedxl.py",
            "Min Position Limit (52) is 1900, expected 1536 or less",
        ),
        (BusKind::Dynamixel, "srl1.json", "fakedxl.py", "Status Return Level (68) is 1, expected 2"),
        (BusKind::Sts, "sts_wheel.json", "fakep1.py", "Operation Mode (33) is 1 (wheel)"),
        (BusKind::Dynamixel1, "ax_torque_limit_0.json", "fakep1.py", "Torque Limit (34) is 0"),
    ];
    for (kind, case, script, expected) in wrong {
        let given = Given::new(kind);
        let servos = fake(&given, case, script);
        let (code, text, _) = given.scan(&servos.port, &["--ids", "1"]);
        assert!(code == Some(1) && text.contains(expected), "{case}: {text}");
        let (code, _, error) = given.play(&servos.port);
        assert!(code == Some(1) && error.contains(expected) && error.contains("--fix"), "{case}: {error}");
        let (code, text, error) = given.check(&servos.port, &["--fix"]);
        assert_eq!(code, Some(0), "{case}: {text}{error}");
        played(given.play(&servos.port));
    }
}

//! What `encode`, `compare` and `puppet check` say of a clip's errors, against recordings whose right answer is known.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{bunraku, motion, trials, workspace};
use serde_json::Value;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn file(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, text).unwrap();
        path
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// A clip of the recording, and what was said on standard error.
    fn encode(&self, recording: &Path, arguments: &[&str]) -> (PathBuf, Value, String) {
        let clip = self.path("clip.mclip");
        let output =
            run(bunraku().arg("encode").arg(recording).args(arguments).arg("--json").arg("-o").arg(&clip));
        assert!(output.status.success(), "{}", said(&output));
        (clip, serde_json::from_slice(&output.stdout).unwrap(), said(&output))
    }
}

fn run(command: &mut Command) -> Output {
    command.output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn compare(recording: &Path, clip: &Path) -> Value {
    let output = run(bunraku().arg("compare").arg(recording).arg(clip).args(["--unit", "cm", "--json"]));
    assert!(output.status.success(), "{}", said(&output));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

/// A BVH of a root and a joint above it, both with these rotations, and these rows of values at 30 frames a second.
fn bvh([root, joint]: [&str; 2], rotations: &str, rows: &[Vec<f64>]) -> String {
    let mut text = format!(
        "HIERARCHY\nROOT {root}\n{{\nOFFSET 0 90 0\nCHANNELS 6 Xposition Yposition Zposition {rotations}\nJOINT {joint}\n{{\n\
         OFFSET 0 20 0\nCHANNELS 3 {rotations}\nEnd Site\n{{\nOFFSET 0 15 0\n}}\n}}\n}}\nMOTION\nFrames: {}\nFrame Time: 0.0333333\n",
        rows.len()
    );
    for row in rows {
        let row: Vec<String> = row.iter().map(|value| format!("{value:.5}")).collect();
        writeln!(text, "{}", row.join(" ")).unwrap();
    }
    text
}

const ZXY: &str = "Zrotation Xrotation Yrotation";

/// 18 seconds of rest with a nod of 20 degrees in them.
fn nods() -> Vec<Vec<f64>> {
    let angle = |frame: u32| {
        let part = (f64::from(frame) - 500.0).clamp(0.0, 40.0) / 40.0;
        10.0 - 10.0 * (part * std::f64::consts::TAU).cos()
    };
    (0..560).map(|frame| vec![0.0, 90.0, 0.0, 0.0, 0.0, 0.0, 0.0, angle(frame), 0.0]).collect()
}

#[test]
fn bounds_hold_where_there_is_movement() {
    let folder = Folder::new();
    let recording = folder.file("nod.bvh", &bvh(["hips", "neck"], ZXY, &nods()));
    for (target, worst) in [(0.05, 0.5), (0.2, 2.0)] {
        let (clip, _, said) =
            folder.encode(&recording, &["--unit", "cm", "--target-error", &target.to_string()]);
        assert_eq!(said, "");
        let report = compare(&recording, &clip);
        assert!(number(&report, "moving_joint_cm") <= target, "{report}");
        assert!(number(&report, "max_point_cm") <= worst, "{report}");
    }
    let (clip, ..) = folder.encode(&recording, &["--target-error", "0.5", "--worst-error", "0.3"]);
    assert!(number(&compare(&recording, &clip), "max_point_cm") <= 0.3);
}

#[test]
fn a_still_pose_is_exact() {
    let folder = Folder::new();
    let pose = vec![3.3, 101.7, -20.0, 10.0, 20.0, 30.0, -5.0, 6.0, 7.0];
    let recording = folder.file("still.bvh", &bvh(["hips", "neck"], ZXY, &vec![pose; 40]));
    for target in ["0.01", "0.1", "5"] {
        let (clip, ..) = folder.encode(&recording, &["--target-error", target]);
        let report = compare(&recording, &clip);
        assert!(number(&report, "max_point_cm") < 2e-4, "{target} cm: {report}");
    }
}

#[test]
fn what_a_codec_cannot_do_is_said_with_the_error_that_the_clip_has() {
    let folder = Folder::new();
    let row = |x: f64| vec![x, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let recording =
        folder.file("jump.bvh", &bvh(["hips", "neck"], ZXY, &[row(0.0), row(32766.537), row(1.371)]));
    let (clip, _, said) = folder.encode(&recording, &["--target-error", "0.0001"]);
    let report = compare(&recording, &clip);
    let found = number(&report, "mean_joint_cm").max(number(&report, "moving_joint_cm"));
    assert!(
        said.contains(&format!("a mean joint error of {found:.4} cm, expected 0.0001 cm at most")),
        "{said}"
    );
    // Of 32767 cm.
    assert!(found < 2.0, "{said}");
}

#[test]
fn channels_are_compared_by_their_names() {
    let folder = Folder::new();
    let rows: Vec<Vec<f64>> =
        (0..9).map(|frame| (0..9).map(|value| f64::from(frame * value)).collect()).collect();
    let one = folder.file("one.bvh", &bvh(["hips", "neck"], ZXY, &rows));
    let refused = |other: &Path| {
        let output = run(bunraku().arg("compare").arg(&one).arg(other));
        assert_eq!(output.status.code(), Some(1));
        said(&output)
    };
    let renamed = folder.file("renamed.bvh", &bvh(["hips", "head"], ZXY, &rows));
    assert!(
        refused(&renamed).contains("has no channel neck.rz, which the reference has"),
        "{}",
        refused(&renamed)
    );
    let turned = folder.file("turned.bvh", &bvh(["hips", "neck"], "Yrotation Xrotation Zrotation", &rows));
    let said = refused(&turned);
    assert!(said.contains("turns about y, then x, then z, expected z, then x, then y"), "{said}");
    // Positions may stand after the rotations: their values are found by name.
    let text = bvh(
        ["hips", "neck"],
        ZXY,
        &rows
            .iter()
            .map(|row| {
                let (positions, others) = row.split_at(3);
                let (rotations, neck) = others.split_at(3);
                [rotations, positions, neck].concat()
            })
            .collect::<Vec<_>>(),
    );
    let moved = text.replace(
        &format!("CHANNELS 6 Xposition Yposition Zposition {ZXY}"),
        &format!("CHANNELS 6 {ZXY} Xposition Yposition Zposition"),
    );
    let report = compare(&one, &folder.file("moved.bvh", &moved));
    assert_eq!((number(&report, "max_joint_cm"), number(&report, "rms_deg")), (0.0, 0.0));
}

/// A puppet whose joints follow the neck's nod.
fn puppet(joints: &[(&str, &str)]) -> String {
    let mut text = "servo_hz = 50\nbaud = 1_000_000\n".to_owned();
    for (id, (name, lines)) in joints.iter().enumerate() {
        writeln!(text, "[[joint]]\nname = '{name}'\nid = {id}\n{lines}").unwrap();
    }
    text
}

const FREE: &str = "channel = 'neck.rx'\nrange = [-60, 60]\nmax_speed = 600";

#[test]
fn a_puppets_joints_are_within_their_degrees_as_they_are_played() {
    let folder = Folder::new();
    let recording = folder.file("nod.bvh", &bvh(["hips", "neck"], ZXY, &nods()));
    let other = "channel = 'hips.rx'\nrange = [-60, 60]\nmax_speed = 600";
    let file = folder.file("puppet.toml", &puppet(&[("nod", FREE), ("bow", other)]));
    let puppet = ["--puppet", file.to_str().unwrap()];
    let in_cm = ["--unit", "cm"];
    for (arguments, rms, worst) in
        [(&[][..], 0.25, 2.0), (&["--target-degrees", "1", "--worst-degrees", "1.5"][..], 1.0, 1.5)]
    {
        let (clip, report, said) = folder.encode(&recording, &[&puppet[..], &in_cm, arguments].concat());
        assert!(!said.contains("joint \"nod\"") && !said.contains("joint \"bow\""), "{said}");
        let nod = &report["joints"][0];
        assert!(number(nod, "rms") <= rms && number(&nod["worst"], "value") <= worst, "{nod}");
        assert!((nod["played"][1].as_f64().unwrap() - 20.0).abs() < 1.5, "{nod}");
        // The log of what the servos are told says the same.
        let log = folder.path("log.csv");
        let played =
            run(bunraku().arg("play").arg(&clip).args(puppet).args(["--on", "host", "--log"]).arg(&log));
        assert!(played.status.success(), "{}", self::said(&played));
        let text = fs::read_to_string(log).unwrap();
        let goals = text.lines().filter(|line| line.split(',').nth(2) == Some("0"));
        let goals = goals.map(|line| line.rsplit(',').next().unwrap().parse::<f64>().unwrap());
        let highest = goals.fold(0.0, f64::max);
        let degrees = (highest - 2048.0) * 360.0 / 4096.0;
        assert!((degrees - nod["played"][1].as_f64().unwrap()).abs() < 0.01, "{degrees} and {nod}");
    }
    let check =
        run(bunraku().args(["puppet", "check"]).arg(&file).arg("--clip").arg(folder.path("clip.mclip")));
    let text = String::from_utf8(check.stdout).unwrap();
    assert!(
        text.contains("1 of 2 joints move\njoint \"bow\" never moves: its servo is told 0.0 °"),
        "{text}"
    );
}

#[test]
fn a_joint_that_cannot_do_it_is_named_with_what_it_does() {
    let folder = Folder::new();
    let recording = folder.file("nod.bvh", &bvh(["hips", "neck"], ZXY, &nods()));
    let slow = "channel = 'neck.rx'\nrange = [-60, 60]\nmax_speed = 10";
    let file = folder.file("puppet.toml", &puppet(&[("nod", FREE), ("slow", slow)]));
    let arguments = ["--unit", "cm", "--puppet", file.to_str().unwrap()];
    let (clip, report, said) = folder.encode(&recording, &arguments);
    let [nod, slow] = [0, 1].map(|index| &report["joints"][index]);
    assert!(number(nod, "rms") <= 0.25, "{nod}");
    let (rms, worst) = (number(slow, "rms"), number(&slow["worst"], "value"));
    assert!(worst > 10.0 && number(slow, "clip_rms") <= 0.25, "{slow}");
    let expected = format!("joint \"slow\" is {rms:.2} ° RMS and {worst:.2} ° at worst");
    assert!(said.contains(&expected) && !said.contains("joint \"nod\""), "{said}");
    // compare says the same of the clip.
    let compared =
        run(bunraku().arg("compare").arg(&recording).arg(&clip).arg("--puppet").arg(&file).arg("--json"));
    let compared: Value = serde_json::from_slice(&compared.stdout).unwrap();
    assert_eq!(compared["joints"], report["joints"]);
}

/// docs/RESULTS.md, "Clips for a puppet".
#[test]
fn twenty_joints_take_an_eighth_of_int16_and_a_twentieth_of_blenders_frames() {
    if motion().is_none() {
        return;
    }
    let folder = Folder::new();
    let puppet = workspace().join("puppets/cmu-20.toml");
    let (mut bytes, mut seconds, mut beyond) = (0.0, 0.0, 0);
    for (recording, skeleton) in trials().unwrap() {
        let files = [&skeleton, &puppet].map(|path| path.to_str().unwrap());
        let arguments =
            ["--rate", "120", "--fps", "60", "--skeleton", files[0], "--puppet", files[1], "--smooth"];
        let (_, report, said) = folder.encode(&recording, &arguments);
        let joints = report["joints"].as_array().unwrap();
        assert_eq!(joints.len(), 20);
        for joint in joints {
            let within = number(joint, "rms") <= 0.25 && number(&joint["worst"], "value") <= 2.0;
            assert_eq!(within, !said.contains(&format!("joint {} is ", joint["joint"])), "{joint}: {said}");
            beyond += u32::from(!within);
            // What the joint's limits keep it from, the clip has nevertheless.
            assert!(number(joint, "clip_rms") < 0.28 && number(joint, "clip_worst") < 1.0, "{joint}");
        }
        bytes += number(&report, "bytes");
        seconds += number(&report, "frames") / 60.0;
    }
    let rate = bytes / seconds / 20.0;
    assert!((12.0..15.0).contains(&rate), "{rate} bytes a second and servo");
    assert!(beyond <= 6, "{beyond} of 240 joints");
}

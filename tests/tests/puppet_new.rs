//! From a recording to a moving puppet without a line by hand: `puppet new`, `encode --puppet`, `puppet check`, `play`.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{bunraku, motion, trials};
use mocap::{Clip, export, sample};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;

fn run(command: &mut Command) -> (String, String) {
    let output = command.output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{command:?}: {errors}");
    (String::from_utf8(output.stdout).unwrap(), errors)
}

/// A servo by itself cannot do all that an ankle or a waist does: it only turns about one axis.
fn turns_only(joints: &Value) -> bool {
    joints.to_string().contains("ankle") || joints.to_string().contains("waist")
}

/// Goes the whole way with so many servos, and returns the worst mean angle between where a bone points and where it
/// was recorded, in degrees.
fn whole_way(recording: &Path, skeleton: Option<&Path>, servos: usize) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    let [puppet, clip] = ["puppet.toml", "clip.mclip"].map(|name| folder.path().join(name));
    let what = format!("{} with {servos} servos", recording.display());
    let source = |command: &str, arguments: &[&str]| {
        let mut command_line = bunraku();
        command_line.args(command.split(' ')).arg(recording).args(arguments);
        skeleton.iter().for_each(|skeleton| {
            command_line.arg("--skeleton").arg(skeleton);
        });
        command_line
    };
    let (_, notes) = run(source("puppet new", &["--servos", &servos.to_string()]).arg("-o").arg(&puppet));
    let frames: &[&str] = if notes.contains("--frames 1..") { &["--frames", "1.."] } else { &[] };
    let mut encode = source("encode", frames);
    let (report, _) = run(encode.arg("--puppet").arg(&puppet).arg("--json").arg("-o").arg(&clip));
    run(bunraku().args(["puppet", "check"]).arg(&puppet).arg("--clip").arg(&clip));
    run(bunraku().arg("play").arg(&clip).arg("--puppet").arg(&puppet));
    let report: Value = serde_json::from_str(&report).unwrap();
    let seconds = report["frames"].as_f64().unwrap() / report["fps"].as_f64().unwrap();
    let joints = report["fit"]["joints"].as_array().unwrap();
    assert_eq!(joints.len(), servos, "{what}");
    for joint in joints {
        let [low, high] = [0, 1].map(|end| joint["fitted"][end].as_f64().unwrap());
        assert!(high - low > 1.0, "{what}: {joint} stands still");
        let beyond = joint["out_of_range"]["seconds"].as_f64().unwrap_or(0.0);
        assert!(beyond <= 0.02 * seconds, "{what}: {joint} is at its end stop");
    }
    let bones = report["fit"]["bones"].as_array().unwrap().iter().filter(|bone| !turns_only(&bone["joints"]));
    let worst = bones.map(|bone| bone["mean"].as_f64().unwrap()).fold(0.0, f64::max);
    println!("{what}: {worst:.1} degrees");
    worst
}

/// The sample as a BVH file whose joints are named as this says.
fn write_sample(path: &Path, name: impl Fn(usize, &str) -> String) {
    let Clip { mut skeleton, motion } = sample::clip();
    for (index, joint) in skeleton.joints.iter_mut().enumerate() {
        joint.name = name(index, &joint.name);
    }
    let mut bytes = Vec::new();
    export::bvh::write(&mut bytes, &skeleton, &motion).unwrap();
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_figure_with_names_moves_a_puppet() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("walk.bvh");
    write_sample(&path, |_, name| name.to_owned());
    for servos in [6, 12] {
        assert!(whole_way(&path, None, servos) < 2.0);
    }
}

#[test]
fn a_figure_without_names_moves_the_same_puppet() {
    let folder = tempfile::tempdir().unwrap();
    let [named, unnamed] = ["named.bvh", "unnamed.bvh"].map(|name| folder.path().join(name));
    write_sample(&named, |_, name| name.to_owned());
    write_sample(&unnamed, |index, _| format!("j{index}"));
    let [named, unnamed] = [named, unnamed].map(|path| {
        let puppet = path.with_extension("toml");
        let (_, notes) = run(bunraku().args(["puppet", "new"]).arg(&path).arg("-o").arg(&puppet));
        let text = fs::read_to_string(puppet).unwrap();
        // The number of the figure is also that of its names.
        let is_same = |line: &&str| !line.starts_with('#') && !line.starts_with("bones = ");
        let keys = text.lines().filter(is_same).map(str::to_owned);
        (keys.collect::<Vec<String>>(), notes)
    });
    assert_eq!(named.0, unnamed.0);
    assert!(
        !named.1.contains("guessed") && unnamed.1.contains("guessed by the figure's shape"),
        "{unnamed:?}"
    );
}

#[test]
fn a_puppet_that_is_there_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let [walk, puppet] = ["walk.bvh", "puppet.toml"].map(|name| folder.path().join(name));
    write_sample(&walk, |_, name| name.to_owned());
    fs::write(&puppet, "mine").unwrap();
    let new = || {
        let mut command = bunraku();
        command
            .args(["puppet", "new", "--joints", "head,arms", "--kind", "sts"])
            .arg(&walk)
            .arg("-o")
            .arg(&puppet);
        command
    };
    let refused = new().output().unwrap();
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("is there already"));
    assert_eq!(fs::read_to_string(&puppet).unwrap(), "mine");
    let (told, _) = run(new().arg("--force"));
    assert!(told.contains("8 servos: head turn, head nod, right shoulder"), "{told}");
    assert!(fs::read_to_string(&puppet).unwrap().contains("kind = \"sts\""));
}

#[test]
fn what_is_no_figure_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tail.bvh");
    let text = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\nJOINT b\n{\nOFFSET 0 9 0\nCHANNELS 1 \
                Xrotation\nEnd Site\n{\nOFFSET 0 9 0\n}\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.1\n0 0\n1 2\n";
    fs::write(&path, text).unwrap();
    let mut command = bunraku();
    command.args(["puppet", "new"]).arg(&path).arg("-o").arg(folder.path().join("p.toml"));
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(error.contains("none of these parts: head, arms, legs, waist. Its joints are a, b"), "{error}");
}

/// The sentence of a `puppet new` that must fail.
fn refused(recording: &Path, puppet: &Path) -> String {
    let output = bunraku().args(["puppet", "new"]).arg(recording).arg("-o").arg(puppet).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(!puppet.exists());
    String::from_utf8(output.stderr).unwrap()
}

/// The columns of a table have the names of joints, and no bones.
#[test]
fn a_table_is_no_figure() {
    let folder = tempfile::tempdir().unwrap();
    let [bvh, csv, puppet] = ["a.bvh", "a.csv", "p.toml"].map(|name| folder.path().join(name));
    write_sample(&bvh, |_, name| name.to_owned());
    let Clip { skeleton, motion } = sample::clip();
    let mut table = Vec::new();
    export::csv::write(&mut table, &skeleton, &motion).unwrap();
    fs::write(&csv, table).unwrap();
    let error = refused(&csv, &puppet);
    assert!(error.contains("none of these parts"), "{error}");
    run(bunraku().args(["puppet", "new"]).arg(&bvh).arg("-o").arg(&puppet));
    let mut encode = bunraku();
    encode.arg("encode").arg(&csv).arg("--puppet").arg(&puppet).arg("-o").arg(folder.path().join("a.mclip"));
    let output = encode.output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(1) && error.contains("a table has columns and no bones"), "{error}");
}

#[test]
fn what_stands_still_gets_no_servo() {
    let folder = tempfile::tempdir().unwrap();
    let [bvh, puppet] = ["a.bvh", "p.toml"].map(|name| folder.path().join(name));
    let Clip { skeleton, mut motion } = sample::clip();
    let first = motion.frame(0).to_vec();
    let turning = skeleton.channel("rradius.rx").unwrap();
    let write = |motion: &mocap::Motion| {
        let mut bytes = Vec::new();
        export::bvh::write(&mut bytes, &skeleton, motion).unwrap();
        fs::write(&bvh, bytes).unwrap();
    };
    for row in motion.samples.chunks_exact_mut(first.len()) {
        row.copy_from_slice(&first);
    }
    write(&motion);
    let error = refused(&bvh, &puppet);
    assert!(error.contains("no joint turns by 1 degree or more in 480 frames"), "{error}");
    for (frame, row) in motion.samples.chunks_exact_mut(first.len()).enumerate() {
        row[turning] = first[turning] + 20.0 * (frame as f64 / 50.0).sin();
    }
    write(&motion);
    let (said, notes) = run(bunraku().args(["puppet", "new"]).arg(&bvh).arg("-o").arg(&puppet));
    assert!(said.contains("1 servos: right elbow"), "{said}");
    assert!(notes.contains("left out, since the recording does not turn them: "), "{notes}");
}

/// What is written for each kind of servo is taken by `check`, and its bus is fast enough.
#[test]
fn every_kind_of_servo_gets_a_puppet_that_checks() {
    let folder = tempfile::tempdir().unwrap();
    let [bvh, puppet] = ["a.bvh", "p.toml"].map(|name| folder.path().join(name));
    write_sample(&bvh, |_, name| name.to_owned());
    for kind in ["dynamixel", "dynamixel1", "sts", "scs", "pwm", "pca9685", "blender"] {
        let mut new = bunraku();
        new.args(["puppet", "new", "--force", "--kind", kind]).arg(&bvh).arg("-o").arg(&puppet);
        run(&mut new);
        run(bunraku().args(["puppet", "check"]).arg(&puppet));
    }
}

/// Recordings of seven programs. How far the worst bone is off in the mean is in docs/RESULTS.md.
#[test]
fn real_recordings_move_a_puppet() {
    let Some(folder) = motion() else { return };
    let mut files: Vec<_> =
        fs::read_dir(folder.join("bvh")).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    for path in files {
        let worst = whole_way(&path, None, 6);
        assert!(worst < 4.0, "{}: {worst}", path.display());
    }
    for (amc, asf) in trials().into_iter().flatten().filter(|(amc, _)| !amc.ends_with("05_03.amc")).take(4) {
        let worst = whole_way(&amc, Some(&asf), 6);
        assert!(worst < 4.0, "{}: {worst}", amc.display());
    }
}

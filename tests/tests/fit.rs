//! Clips that are made for a puppet: the values of its joints, and no skeleton from then on.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{bunraku, workspace};
use mocap::sample;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The embedded sample as files, and its puppet, which names no skeleton.
struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let clip = sample::clip();
        let mut amc = Vec::new();
        let rotations = mocap::export::amc::Rotations::AsTheyAre;
        mocap::export::amc::write(&mut amc, &clip.skeleton, &clip.motion, rotations).unwrap();
        fs::write(folder.path().join("sample.amc"), amc).unwrap();
        fs::write(folder.path().join("sample.asf"), sample::asf()).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Encodes the sample into this file.
    fn encode(&self, output: &str, arguments: &[&str]) -> PathBuf {
        let mut command = bunraku();
        command.arg("encode").arg(self.path("sample.amc")).arg("--skeleton").arg(self.path("sample.asf"));
        ok(command.args(arguments).arg("-o").arg(self.path(output)));
        self.path(output)
    }
}

fn puppet() -> PathBuf {
    workspace().join("puppets/sample.toml")
}

/// Standard output of a command that must succeed.
fn ok(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The sentence of a command that must fail.
fn refused(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    String::from_utf8(output.stderr).unwrap()
}

fn play(clip: &Path, puppet: &Path) -> Command {
    let mut command = bunraku();
    command.arg("play").arg(clip).arg("--puppet").arg(puppet).args(["--on", "host"]);
    command
}

fn goals(command: &mut Command, log: PathBuf) -> Vec<(String, i32)> {
    ok(command.arg("--log").arg(&log));
    let text = fs::read_to_string(log).unwrap();
    let lines = text.lines().skip(1).map(|line| line.rsplit_once(',').unwrap());
    lines.map(|(when, goal)| (when.to_owned(), goal.parse().unwrap())).collect()
}

#[test]
fn a_puppets_clip_moves_it_as_the_whole_one_does_and_needs_no_skeleton() {
    let files = Files::new();
    let fine = ["--codec", "dpcm", "--target-error", "0.001"];
    let whole = files.encode("whole.mclip", &fine);
    let puppet_path = puppet();
    let of_puppet = [&fine[..], &["--puppet", puppet_path.to_str().unwrap()]].concat();
    let fitted = files.encode("fitted.mclip", &of_puppet);
    let info: Value = serde_json::from_str(&ok(bunraku().arg("info").arg(&fitted).arg("--json"))).unwrap();
    assert_eq!(info["channels"].as_array().unwrap().len(), 12, "{info}");
    let size = |path: &Path| fs::metadata(path).unwrap().len();
    assert!(size(&fitted) * 3 < size(&whole) * 2, "{} and {}", size(&fitted), size(&whole));

    let expected = goals(&mut play(&whole, &puppet()), files.path("whole.csv"));
    let found = goals(&mut play(&fitted, &puppet()), files.path("fitted.csv"));
    assert_eq!(found.len(), expected.len());
    let mut moved = false;
    for ((when, expected), (at, found)) in expected.iter().zip(&found) {
        assert!(when == at && (expected - found).abs() <= 3, "{when}: {expected}, {found}");
        moved |= (expected - 2048).abs() > 300;
    }
    assert!(moved, "the puppet waves");
    // On the skeleton it has nothing to say: its channels are the puppet's joints.
    let mut decode = bunraku();
    decode.arg("decode").arg(&fitted).arg("--skeleton").arg(files.path("sample.asf"));
    let said = refused(decode.arg("-o").arg(files.path("back.csv")));
    assert!(said.contains("channels of a puppet (waist turn.rx is the first)"), "{said}");
}

/// A recording that asks for more than the joint can do: what is cut is told, in the table and as JSON.
#[test]
fn what_a_puppet_cannot_do_is_told_once_for_each_joint() {
    let files = Files::new();
    let text = fs::read_to_string(puppet()).unwrap();
    let narrow = files.path("narrow.toml");
    let lift = "channel = \"rhumerus.rz\"\nid = 4\nrange = [-150, 30]";
    assert!(text.contains(lift));
    fs::write(&narrow, text.replace(lift, &lift.replace("[-150, 30]", "[-50, 30]"))).unwrap();
    let mut encode = bunraku();
    encode.arg("encode").arg(files.path("sample.amc")).arg("--skeleton").arg(files.path("sample.asf"));
    encode.arg("--puppet").arg(&narrow).arg("--json").arg("-o").arg(files.path("narrow.mclip"));
    let output = encode.output().unwrap();
    assert!(output.status.success());
    let said = String::from_utf8(output.stderr).unwrap();
    let row = said.lines().find(|line| line.starts_with("right shoulder lift")).unwrap();
    assert!(row.contains("-50.0 to ") && row.contains("times, "), "{row}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let joints = report["fit"]["joints"].as_array().unwrap();
    let of = |name: &str| joints.iter().find(|joint| joint["name"] == name).unwrap();
    let (cut, whole) = (&of("right shoulder lift")["out_of_range"], &of("right elbow")["out_of_range"]);
    assert!(cut["most"].as_f64().unwrap() > 20.0 && cut["times"].as_u64().unwrap() >= 1, "{cut}");
    assert!(whole.is_null(), "{whole}");
}

/// `--smooth`: what a clip asks is then within speed and acceleration at every tick of the player.
#[test]
fn a_smoothed_clip_is_within_its_joints_limits() {
    let files = Files::new();
    let slow = files.path("slow.toml");
    let text = fs::read_to_string(puppet()).unwrap();
    fs::write(&slow, text.replace("max_speed = 450", "max_speed = 60\nmax_acceleration = 1500")).unwrap();
    let unmet = |name: &str, arguments: &[&str]| {
        let clip = files.encode(name, &[&["--puppet", slow.to_str().unwrap()], arguments].concat());
        let mut check = bunraku();
        check.args(["puppet", "check"]).arg(&slow).arg("--clip").arg(clip).arg("--json");
        let report: Value = serde_json::from_str(&ok(&mut check)).unwrap();
        let of = |joint: &Value| {
            let demand = &joint["demand"];
            demand["too_fast"].as_u64().unwrap() + demand["too_sudden"].as_u64().unwrap()
        };
        report["joints"].as_array().unwrap().iter().map(of).sum::<u64>()
    };
    let fine = ["--codec", "dpcm", "--target-error", "0.001"];
    assert!(unmet("fast.mclip", &fine) > 100);
    assert_eq!(unmet("smooth.mclip", &[&fine[..], &["--smooth"]].concat()), 0);
}

#[test]
fn frames_are_cut_before_anything_else() {
    let files = Files::new();
    let cut = files.encode("cut.mclip", &["--frames", "100..340"]);
    let info: Value = serde_json::from_str(&ok(bunraku().arg("info").arg(&cut).arg("--json"))).unwrap();
    assert_eq!(info["frames"], 240);
    let mut compare = bunraku();
    compare.arg("compare").arg(files.path("sample.amc")).arg(&cut);
    compare.arg("--skeleton").arg(files.path("sample.asf")).args([
        "--frames",
        "100..340",
        "--max-error",
        "0.11",
    ]);
    ok(&mut compare);
    let mut beyond = bunraku();
    beyond.arg("encode").arg(files.path("sample.amc")).arg("--skeleton").arg(files.path("sample.asf"));
    let said = refused(beyond.args(["--frames", "480..", "-o"]).arg(files.path("none.mclip")));
    assert!(said.contains("sample.amc has 480 frames, expected more than 480"), "{said}");
    assert!(!files.path("none.mclip").exists());
}

#[test]
fn clips_of_other_channels_are_refused_by_name_or_number() {
    let files = Files::new();
    let puppet_path = puppet();
    let fitted = files.encode("fitted.mclip", &["--puppet", puppet_path.to_str().unwrap()]);
    let text = fs::read_to_string(&puppet_path).unwrap();
    let other = files.path("other.toml");
    fs::write(&other, text.replace("\"head turn\"", "\"gaze\"")).unwrap();
    let said = refused(&mut play(&fitted, &other));
    assert!(said.contains("line 18, key \"channel\": the clip has no joint \"head\""), "{said}");
    // A .qmd names nothing: its number of channels has to do.
    let whole = files.encode("whole.qmd", &[]);
    let said = refused(&mut play(&whole, &puppet()));
    assert!(
        said.contains("whole.qmd has 31 channels, expected 12 as in the puppet, which has no skeleton"),
        "{said}"
    );
    let fitted = files.encode("fitted.qmd", &["--puppet", puppet_path.to_str().unwrap()]);
    ok(&mut play(&fitted, &puppet()));
    let said = refused(play(&fitted, &puppet()).arg("--skeleton").arg(files.path("sample.asf")));
    assert!(said.contains("fitted.qmd has 12 channels, expected 31 as in the skeleton"), "{said}");
    // A recording that lacks a channel of the puppet.
    let mut encode = bunraku();
    encode.arg("encode").arg(files.path("sample.amc")).arg("--skeleton").arg(files.path("sample.asf"));
    let said = refused(
        encode
            .arg("--puppet")
            .arg(workspace().join("puppets/bvh-12.toml"))
            .arg("-o")
            .arg(files.path("no.mclip")),
    );
    assert!(
        said.contains("bvh-12.toml, line 13") && said.contains("the skeleton has no joint \"Spine\""),
        "{said}"
    );
}

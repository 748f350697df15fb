//! The player gives the same goals here, on the Cortex-M4 board under QEMU and on the simulated core, and on an emulated Pico.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{bunraku, motion, npm_package, require_program, require_target, workspace};
use mocap::sample;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const BOARD_TARGET: &str = "thumbv7em-none-eabi";

fn succeeds(command: &mut Command) -> String {
    let Output { status, stdout, stderr } = command.output().unwrap();
    assert!(status.success(), "{command:?}: {}", String::from_utf8_lossy(&stderr));
    String::from_utf8(stdout).unwrap()
}

fn can_run_the_board() -> bool {
    require_target(BOARD_TARGET) && require_program("qemu-system-arm")
}

/// Where the Cortex-M4 board runs.
fn m4() -> &'static [&'static str] {
    if can_run_the_board() { &["qemu", "sim"] } else { &[] }
}

/// Encodes a motion of `skeleton` in `folder`, plays it on the puppet, and gives the report and the log.
fn play(
    folder: &Path,
    motion: &Path,
    skeleton: &Path,
    puppet: &str,
    container: &str,
    on: &str,
) -> (serde_json::Value, String) {
    let (clip, log) = (folder.join("clip").with_extension(container), folder.join(on).with_extension("csv"));
    succeeds(bunraku().arg("encode").arg(motion).arg("--skeleton").arg(skeleton).arg("-o").arg(&clip));
    let puppet = workspace().join("puppets").join(puppet);
    let report = succeeds(
        bunraku()
            .arg("play")
            .arg(clip)
            .args(["--on", on, "--json", "--puppet"])
            .arg(puppet)
            .arg("--skeleton")
            .arg(skeleton)
            .arg("--log")
            .arg(&log),
    );
    (serde_json::from_str(&report).unwrap(), fs::read_to_string(log).unwrap())
}

fn write_sample(folder: &Path) -> (PathBuf, PathBuf) {
    let (skeleton, motion) = (folder.join("sample.asf"), folder.join("sample.amc"));
    let clip = sample::clip();
    fs::write(&skeleton, sample::asf()).unwrap();
    let mut amc = Vec::new();
    let rotations = mocap::export::amc::Rotations::AsTheyAre;
    mocap::export::amc::write(&mut amc, &clip.skeleton, &clip.motion, rotations).unwrap();
    fs::write(&motion, amc).unwrap();
    (motion, skeleton)
}

/// `ticks` are those of the clip alone: the servos are also found and turned on, and go to the first pose and home.
fn same_everywhere(
    motion: &Path,
    skeleton: &Path,
    puppet: &str,
    container: &str,
    ticks: u64,
    awake_most: f64,
    elsewhere: &[&str],
) {
    let folder = tempfile::tempdir().unwrap();
    let (report, here) = play(folder.path(), motion, skeleton, puppet, container, "host");
    let (played, servos) = (report["ticks"].as_u64().unwrap(), report["servos"].as_u64().unwrap());
    let hz = report["servo_hz"].as_u64().unwrap();
    assert!(
        (ticks + 4 * hz..ticks + 6 * hz).contains(&played),
        "{played} ticks, {ticks} of them of the clip"
    );
    assert_eq!(here.lines().count() as u64, 1 + servos * played);
    assert_eq!(here.lines().next(), Some("time_s,bus,servo,goal_position"));
    for &on in elsewhere {
        let (report, there) = play(folder.path(), motion, skeleton, puppet, container, on);
        assert!(here == there, "the logs of {} on {on} differ", motion.display());
        if on != "qemu" {
            // The rest of the core's clock must pass asleep, or sleeping does not work.
            let awake = report["awake"].as_f64().unwrap();
            assert!(awake > 0.0 && awake < awake_most, "{report}");
        }
    }
}

#[test]
fn the_cmu_walk_is_the_same_on_the_board() {
    let Some(folder) = motion() else { return };
    let folder = folder.join("cmu");
    // 343 frames at 120 Hz: ⌈342 · 50 / 120⌉ + 1 ticks.
    same_everywhere(&folder.join("02_01.amc"), &folder.join("02.asf"), "cmu-12.toml", "qmd", 144, 0.25, m4());
}

#[test]
fn a_clip_in_blocks_is_the_same_on_the_board() {
    let Some(folder) = motion() else { return };
    let folder = folder.join("cmu");
    // 251 frames at 120 Hz, and as many ticks. Every byte wakes this board, and 20 servos are read 120 times a second.
    same_everywhere(
        &folder.join("49_04.amc"),
        &folder.join("49.asf"),
        "cmu-20.toml",
        "mclip",
        251,
        0.75,
        m4(),
    );
}

#[test]
fn the_sample_is_the_same_on_the_board() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, skeleton) = write_sample(folder.path());
    // An AMC has no rate, so 480 frames play at 120 Hz: ⌈479 · 50 / 120⌉ + 1 ticks.
    same_everywhere(&motion, &skeleton, "sample.toml", "qmd", 201, 0.25, m4());
}

#[test]
fn the_sample_is_the_same_on_a_pico() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, skeleton) = write_sample(folder.path());
    if npm_package("rp2040js").is_some() && require_target("thumbv6m-none-eabi") {
        same_everywhere(&motion, &skeleton, "sample.toml", "qmd", 201, 0.1, &["rp2040"]);
    }
}

#[test]
fn hobby_servos_are_told_the_same_on_a_pico() {
    if npm_package("rp2040js").is_none() || !require_target("thumbv6m-none-eabi") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (motion, skeleton) = write_sample(folder.path());
    let play = |puppet: &str, on| play(folder.path(), &motion, &skeleton, puppet, "qmd", on);
    let ((report, here), (_, there)) = (play("hobby.toml", "host"), play("hobby.toml", "rp2040"));
    assert!(here == there, "the logs differ");
    // Eight on a PCA9685 and two on PWM pins go from where they are at rest, about, and back to there.
    let goals = |id: u8| -> Vec<i32> {
        let id = id.to_string();
        let rows = here.lines().map(|line| line.split(',').collect::<Vec<_>>());
        rows.filter(|row| row[2] == id).map(|row| row[3].parse().unwrap()).collect()
    };
    let ticks = report["ticks"].as_u64().unwrap() as usize;
    for id in (8..16).chain([0, 1]) {
        let goals = goals(id);
        assert!((ticks - 20..ticks).contains(&goals.len()), "{id}: {} of {ticks} ticks", goals.len());
        let (least, most) = (goals.iter().min().unwrap(), goals.iter().max().unwrap());
        assert!(
            most - least > 20 && (500..=2500).contains(least) && *most <= 2500,
            "{id}: {least} to {most}"
        );
        assert_eq!(goals.first(), goals.last(), "{id}");
    }
    // In single microseconds on pins, in steps of 4.88 on the PCA9685.
    assert_eq!((goals(0)[0], goals(1)[0]), (2000, 1000));
    assert_eq!((goals(8)[0], goals(15)[0]), (1835, 2308));
    assert_eq!(goals(21).len(), ticks);
}

#[test]
fn a_bus_that_a_board_has_not_is_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, skeleton) = write_sample(folder.path());
    let clip = folder.path().join("clip.qmd");
    succeeds(bunraku().arg("encode").arg(&motion).arg("--skeleton").arg(&skeleton).arg("-o").arg(&clip));
    for (puppet, board, expected) in [
        ("hobby.toml", "stm32f411", "no bus of the kind \"pca9685\""),
        ("sample-buses.toml", "rp2040", "no bus of the kind \"dynamixel1\""),
    ] {
        let mut image = bunraku();
        image.arg("image").arg(&clip).arg("--puppet").arg(workspace().join("puppets").join(puppet));
        let Output { status, stderr, .. } =
            image.arg("--skeleton").arg(&skeleton).args(["--board", board]).output().unwrap();
        let said = String::from_utf8(stderr).unwrap();
        assert_eq!((status.code(), said.lines().count()), (Some(1), 1), "{said}");
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn cargo_run_in_the_boards_folder_plays_the_sample() {
    if !can_run_the_board() {
        return;
    }
    let said = succeeds(
        Command::new("cargo")
            .args(["run", "--quiet"])
            .current_dir(workspace().join("firmware/boards/qemu-mps2")),
    );
    let states = ["Reading", "Arming", "Easing", "Playing", "Stopping", "Returning", "Resting"];
    let states: String = states.iter().map(|state| format!("info: {state}\n")).collect();
    let begins = format!("info: 480 frames at 6000 cHz on 12 servos\n{states}info: rests after ");
    assert!(said.starts_with(&begins), "{said}");
}

#[test]
fn a_wrong_puppet_is_one_sentence_and_no_log() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, skeleton) = write_sample(folder.path());
    let (clip, log) = (folder.path().join("clip.qmd"), folder.path().join("log.csv"));
    succeeds(bunraku().arg("encode").arg(&motion).arg("--skeleton").arg(&skeleton).arg("-o").arg(&clip));
    let sample = fs::read_to_string(workspace().join("puppets/sample.toml")).unwrap();
    let refused = |puppet: &str, arguments: &[&str], expected: &str| {
        let path = folder.path().join("puppet.toml");
        fs::write(&path, puppet).unwrap();
        let mut command = bunraku();
        command.arg("play").arg(&clip).arg("--puppet").arg(&path).arg("--log").arg(&log).args(arguments);
        let Output { status, stderr, .. } = command.output().unwrap();
        let said = String::from_utf8(stderr).unwrap();
        assert_eq!(status.code(), Some(1), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
        assert!(said.contains(expected), "{expected:?} is not in {said:?}");
        assert!(!log.exists());
    };
    let skeleton = ["--skeleton", skeleton.to_str().unwrap()];
    let unknown = sample.replace("rtibia.rx", "rshin.rx");
    refused(&unknown, &skeleton, "key \"channel\": the skeleton has no joint \"rshin\"");
    refused(&sample, &[], "as in the puppet, which has no skeleton: name the clip's with --skeleton");
    refused("joint = 3", &skeleton, "puppet.toml, line 1, key \"joint\"");
    refused(&sample.replace("[[joint]]", "[[joint]"), &skeleton, "puppet.toml, line");
}

#[test]
fn several_clips_are_played_as_often_and_as_fast_as_asked() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, skeleton) = write_sample(folder.path());
    let to = |name: &str| folder.path().join(name);
    for clip in ["wave.mclip", "walk.qmd"] {
        succeeds(
            bunraku().arg("encode").arg(&motion).arg("--skeleton").arg(&skeleton).arg("-o").arg(to(clip)),
        );
    }
    let puppet = workspace().join("puppets/sample.toml");
    let play = |arguments: &[&str]| {
        let mut command = bunraku();
        command.arg("play").arg("--skeleton").arg(&skeleton).arg("--puppet").arg(&puppet).args(arguments);
        command.current_dir(folder.path());
        command
    };
    let both = ["wave.mclip", "walk.qmd", "--json"];
    let ticks = |more: &[&str]| {
        let report = succeeds(play(&both).args(more));
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        assert_eq!((&report["failed"], &report["servos"]), (&serde_json::Value::Null, &12.into()));
        report["ticks"].as_u64().unwrap()
    };
    // Each lasts 4 s at 120 Hz, or 200 ticks.
    let once = ticks(&["--log", "log.csv", "--html", "page.html"]);
    let log = fs::read_to_string(to("log.csv")).unwrap();
    assert!(log.lines().skip(1).all(|row| row.split(',').nth(1) == Some("bus")), "{log}");
    let page = fs::read_to_string(to("page.html")).unwrap();
    assert!(page.contains("wave, walk") && page.contains("12 virtual servos at 50 Hz"), "{page}");
    assert!(page.contains("clip0") && page.contains("clip1"));
    let (twice, later, slow) = (ticks(&["--loop=2"]), ticks(&["--from", "2"]), ticks(&["--speed", "0.5"]));
    assert!((330..=400).contains(&(twice - once)), "{once} ticks once, {twice} twice");
    assert!((once - later).abs_diff(100) <= 3, "{once} ticks from the beginning, {later} from 2 s on");
    assert!((330..=400).contains(&(slow - once)), "{once} ticks, {slow} at half the speed");
    for (arguments, expected) in [
        (&["wave.mclip", "--loop"][..], "--loop has no end on the host"),
        (&["wave.mclip", "--from", "4.1"], "wave.mclip ends"),
        (&["wave.mclip", "--on", "sim", "--speed", "2"], "a board plays one clip, once and as it is"),
        (&["wave.mclip", "walk.qmd", "--on", "qemu"], "a board plays one clip, once and as it is"),
    ] {
        let Output { status, stderr, .. } = play(arguments).output().unwrap();
        let said = String::from_utf8(stderr).unwrap();
        assert_eq!((status.code(), said.lines().count()), (Some(1), 1), "{said}");
        assert!(said.contains(expected), "{said}");
    }
}

/// Servos of other protocols are virtual on the host as well, and are let go where that is asked.
#[test]
fn a_puppet_of_other_buses_is_played_on_the_host() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, skeleton) = write_sample(folder.path());
    let (clip, log) = (folder.path().join("clip.mclip"), folder.path().join("log.csv"));
    succeeds(bunraku().arg("encode").arg(&motion).arg("--skeleton").arg(&skeleton).arg("-o").arg(&clip));
    let mut play = bunraku();
    play.arg("play").arg(&clip).arg("--puppet").arg(workspace().join("puppets/sample-buses.toml"));
    let Output { status, stderr, .. } = play.arg("--torque-off").arg("--log").arg(&log).output().unwrap();
    let said = String::from_utf8(stderr).unwrap();
    assert!(status.success(), "{said}");
    assert!(said.contains("torque is off, but for 3 of 12 servos: servo 4 cannot be let go"), "{said}");
    let log = fs::read_to_string(log).unwrap();
    for (bus, servo) in [("ax", 1), ("sts", 2), ("scs", 3), ("hobby", 4)] {
        let goals = log.lines().filter(|row| row.contains(&format!(",{bus},{servo},"))).count();
        assert!(goals > 300, "{bus}: {goals}");
    }
}

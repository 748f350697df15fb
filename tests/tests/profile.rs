//! `bunraku profile`: budgets, the committed baseline, and how fast QMD is to be.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{budgets, bunraku, motion, require_target, workspace};
use decoder_core::{I16F16, Limits, mclip};
use firmware::map::{BusKind, BusSpec, Idle, Joint, JointMap, MAX_SERVOS, Settings, bytes_len};
use host_sim::clip::Clip;
use host_sim::profile::measure::Runner;
use host_sim::profile::{tick_images, ticks};
use serde_json::Value;
use std::path::Path;
use std::process::Output;
use thumb_cycles::Core;

/// Cores of the baseline, and the targets that their images take.
const CORES: &str = "cortex-m0plus,cortex-m3,cortex-m4,cortex-m33";
const TARGETS: [&str; 4] =
    ["thumbv6m-none-eabi", "thumbv7m-none-eabi", "thumbv7em-none-eabi", "thumbv8m.main-none-eabi"];

fn profile(arguments: &[&str]) -> Output {
    bunraku().arg("profile").args(arguments).output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The only core's figures.
fn core(output: &Output) -> Value {
    assert!(output.status.success(), "{}", said(output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    report["cores"][0].clone()
}

/// A sound clip of one segment, b = 8, whose content is random.
fn clip(path: &Path, frames: u32, channels: u16, fdf: u16) {
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as u32
    };
    let mut bytes = Vec::new();
    bytes.extend(frames.to_le_bytes());
    bytes.extend(channels.to_le_bytes());
    bytes.extend(12000u16.to_le_bytes());
    bytes.extend(u32::from(fdf).to_le_bytes());
    bytes.push(8);
    bytes.extend((0..channels).map(|_| 1));
    let mut float = |random: u32| bytes.extend(((random as f32 / 1e9) - 1.0).to_le_bytes());
    (0..channels + 256).for_each(|_| float(random()));
    for _ in 0..frames {
        (0..fdf).for_each(|_| bytes.extend(((random() as f32 / 1e9) - 1.0).to_le_bytes()));
        (fdf..channels).for_each(|_| bytes.push(random() as u8));
    }
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn qmd_is_as_fast_and_as_small_as_it_was_on_every_core() {
    if !TARGETS.iter().all(|target| require_target(target)) {
        return;
    }
    let output = profile(&["--core", CORES, "--json"]);
    assert!(output.status.success(), "{}", said(&output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let cores = report["cores"].as_array().unwrap();
    assert_eq!(cores.len(), TARGETS.len());
    let mut measured = Vec::new();
    for core in cores {
        for (key, what) in [
            ("cycles_mean", "mean cycles of a frame"),
            ("cycles_max", "worst cycles of a frame"),
            ("cycles_open", "cycles to open"),
            ("code_bytes", "bytes of code"),
            ("ram_bytes", "bytes of static RAM"),
            ("stack_bytes", "bytes of stack"),
        ] {
            let name = core["core"].as_str().unwrap();
            measured.push((format!("qmd, embedded sample: {name}, {what}"), core[key].as_f64().unwrap()));
        }
    }
    budgets::check(&measured);
}

#[test]
fn a_slowdown_of_5_percent_is_found_by_the_baseline_and_one_of_2_is_not() {
    if !require_target("thumbv7em-none-eabi") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("baseline.json");
    let before = profile(&["--core", "cortex-m4", "--json"]);
    core(&before);
    // A baseline of which this decoder is slower by so many percent.
    let slower_by = |percent: f64| {
        let mut report: Value = serde_json::from_slice(&before.stdout).unwrap();
        for figure in ["cycles_mean", "cycles_max"] {
            let faster = report["cores"][0][figure].as_f64().unwrap() / (1.0 + percent / 100.0);
            report["cores"][0][figure] =
                if figure == "cycles_max" { (faster.round() as u64).into() } else { faster.into() };
        }
        std::fs::write(&path, report.to_string()).unwrap();
        profile(&["--core", "cortex-m4", "--baseline", path.to_str().unwrap()])
    };
    let output = slower_by(5.0);
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("cortex-m4: the worst frame rose"), "{}", said(&output));
    assert_eq!(slower_by(2.0).status.code(), Some(0));
}

#[test]
fn a_frame_over_the_budget_fails() {
    if !require_target("thumbv7em-none-eabi") {
        return;
    }
    let run = |budget| profile(&["--core", "cortex-m4", "--clock", "64MHz", "--budget", budget]);
    assert_eq!(run("100000").status.code(), Some(0));
    assert_eq!(run("5%").status.code(), Some(0));
    for budget in ["300", "0.01%"] {
        let output = run(budget);
        assert_eq!(output.status.code(), Some(1), "{budget}");
        assert!(said(&output).contains("over the budget"), "{}", said(&output));
    }
    assert_eq!(run("fast").status.code(), Some(2));
}

#[test]
fn a_baseline_of_another_clip_is_refused() {
    if !require_target("thumbv7em-none-eabi") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let baseline = folder.path().join("baseline.json");
    std::fs::write(&baseline, profile(&["--core", "cortex-m4", "--json"]).stdout).unwrap();
    let vector = workspace().join("tests/vectors/v1/qmd-segments.qmd");
    let (vector, baseline) = (vector.to_str().unwrap(), baseline.to_str().unwrap());
    let output = profile(&[vector, "--core", "cortex-m4", "--rate", "60", "--baseline", baseline]);
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("the baseline is of another run"), "{}", said(&output));
}

#[test]
fn sixty_two_channels_take_as_many_cycles_as_they_may() {
    if !require_target("thumbv7em-none-eabi") || !require_target("thumbv6m-none-eabi") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut measured = Vec::new();
    // What QMD is to reach, but for the last: its goal of 2600 cycles is missed by 1 % (docs/CYCLES.md).
    for (fdf, table, core_name, most) in [
        (6, "lent", "cortex-m4", 750.0),
        (0, "lent", "cortex-m4", 650.0),
        (6, "none", "cortex-m4", 1700.0),
        (6, "lent", "cortex-m0plus", 1000.0),
        (0, "lent", "cortex-m0plus", 760.0),
        (6, "none", "cortex-m0plus", 2630.0),
    ] {
        let path = folder.path().join("clip.qmd");
        clip(&path, 100, 62, fdf);
        let output = profile(&[path.to_str().unwrap(), "--core", core_name, "--table", table, "--json"]);
        let core = core(&output);
        let mean = core["cycles_mean"].as_f64().unwrap();
        let name = format!("qmd, 62 channels, FDF {fdf}, table {table}: {core_name}, mean cycles of a frame");
        measured.push((name, mean));
        assert!(mean <= most && mean > 400.0, "{core_name}, FDF {fdf}, table {table}: {mean}");
        assert!(core["frame_stack_bytes"].as_u64().unwrap() <= 256, "{core}");
        assert!(core["code_bytes"].as_u64().unwrap() <= 3072, "{core}");
    }
    budgets::check(&measured);
}

/// Cycles that a tick is to take at most on a Cortex-M4, whatever clip and puppet.
const WORST_TICK: u64 = 9_000;

#[test]
fn a_tick_of_20_servos_is_within_its_budget_on_m4() {
    if !require_target("thumbv7em-none-eabi") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("clip.qmd");
    clip(&path, 120, 62, 6);
    let bytes = std::fs::read(&path).unwrap();
    let joint = |id: u8| Joint {
        channel: 3 * u16::from(id),
        bus: 0,
        id,
        zero: 2048,
        home: 2048,
        scale: I16F16::lit("11.378"),
        min: 0,
        max: 4095,
        max_velocity: 200 << 10,
        max_acceleration: 100 << 10,
        idle: Idle { breathing: 10, sway: 10, gaze: 10 },
    };
    // Ticks as fast as frames: each decodes one.
    let buses = [BusSpec { kind: BusKind::Dynamixel, baud: 1_000_000 }].into_iter().collect();
    let map = JointMap::<MAX_SERVOS>::new(Settings::new(120), buses, (0..20).map(joint).collect()).unwrap();
    let mut buffer = [0; bytes_len(20)];
    let images =
        tick_images(&bytes, map.to_bytes(&mut buffer).unwrap(), &["thumbv7em-none-eabi"], true).unwrap();
    let mut runner = Runner::new(Core::M4, &images[0], 0).unwrap();
    // The same packets as on this machine.
    let clip = Clip::parse(&path, &bytes).unwrap();
    let expected = ticks(&clip, &map).unwrap().frames;
    for (tick, expected) in expected.iter().enumerate() {
        assert_eq!(runner.next_frame(1).unwrap().unwrap(), expected, "tick {tick}");
    }
    assert!(runner.next_frame(1).unwrap().is_none());
    let measured = runner.finish();
    let worst = measured.frame_cycles.iter().copied().max().unwrap();
    assert!((1000..=WORST_TICK).contains(&worst), "{worst} cycles; of all ticks: {:?}", measured.functions);
    budgets::check(&[("tick of 20 servos: cortex-m4, worst cycles".to_owned(), worst as f64)]);
    assert_eq!(expected.len(), 120);
}

#[test]
fn a_puppet_is_profiled_tick_by_tick() {
    if !require_target("thumbv7em-none-eabi") {
        return;
    }
    let puppet = workspace().join("puppets/sample.toml");
    let run = |budget: u64| {
        let (puppet, budget) = (puppet.to_str().unwrap(), budget.to_string());
        profile(&["--core", "cortex-m4", "--puppet", puppet, "--json", "--budget", &budget])
    };
    let output = run(WORST_TICK);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    // 480 frames at 60 Hz: ⌈479 · 50 / 60⌉ + 1 ticks.
    assert_eq!(report["puppet"], serde_json::json!({ "ticks": 401, "servos": 12, "servo_hz": 50 }));
    assert_eq!(report["rate_hz"], 50.0);
    let core = core(&output);
    let mean = core["cycles_mean"].as_f64().unwrap();
    let worst = core["cycles_max"].as_f64().unwrap();
    budgets::check(&[
        ("tick of the sample puppet: cortex-m4, mean cycles".to_owned(), mean),
        ("tick of the sample puppet: cortex-m4, worst cycles".to_owned(), worst),
    ]);
    assert!((core["cycles_per_sample"].as_f64().unwrap() * 12.0 - mean).abs() < 1e-6);
    // Some ticks decode a frame and some two.
    assert!(core["cycles_min"].as_u64().unwrap() + 300 < core["cycles_max"].as_u64().unwrap(), "{core}");
    let over = run(1000);
    assert_eq!(over.status.code(), Some(1));
    assert!(said(&over).contains("cortex-m4: tick "), "{}", said(&over));
}

#[test]
fn the_walk_is_played_on_20_servos_within_its_budget_on_m4() {
    let Some(folder) = motion() else { return };
    if !require_target("thumbv7em-none-eabi") {
        return;
    }
    let (cmu, out) = (folder.join("cmu"), tempfile::tempdir().unwrap());
    let (skeleton, clip) = (cmu.join("02.asf"), out.path().join("walk.qmd"));
    let skeleton = skeleton.to_str().unwrap();
    let mut encode = bunraku();
    encode.arg("encode").arg(cmu.join("02_01.amc")).args(["--skeleton", skeleton, "-o"]).arg(&clip);
    assert!(encode.status().unwrap().success());
    let puppet = workspace().join("puppets/cmu-20.toml");
    let output = profile(&[
        clip.to_str().unwrap(),
        "--puppet",
        puppet.to_str().unwrap(),
        "--skeleton",
        skeleton,
        "--core",
        "cortex-m4",
        "--budget",
        &WORST_TICK.to_string(),
        "--json",
    ]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert_eq!(report["puppet"], serde_json::json!({ "ticks": 343, "servos": 20, "servo_hz": 120 }));
    let core = core(&output);
    budgets::check(&["mean", "max"].map(|which| {
        let name = format!("tick of the walk on 20 servos: cortex-m4, {which} cycles");
        (name, core[format!("cycles_{which}")].as_f64().unwrap())
    }));
}

#[test]
fn a_clip_in_blocks_is_profiled_too() {
    if !require_target("thumbv7em-none-eabi") {
        return;
    }
    let vector = workspace().join("tests/vectors/v1/dpcm-edges.mclip");
    let vector = vector.to_str().unwrap();
    let output = profile(&[vector, "--core", "cortex-m4", "--json"]);
    let core = core(&output);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let bytes = std::fs::read(vector).unwrap();
    let clip = mclip::Clip::parse(&bytes, Limits::MAX).unwrap();
    assert_eq!(report["codec"], "dpcm");
    assert_eq!(report["channels"].as_u64(), Some(clip.channels() as u64));
    assert_eq!(report["frames"].as_u64(), Some(u64::from(clip.frames())));
    // What is lent to the decoder lies in the static RAM.
    let lent = report["lent_bytes"].as_u64().unwrap();
    assert_eq!(lent, clip.header().needs().bytes() as u64);
    assert!(core["ram_bytes"].as_u64().unwrap() >= lent, "{core}");
    assert!(core["cycles_mean"].as_f64().unwrap() > 10.0 * clip.channels() as f64, "{core}");
    let table = profile(&[vector, "--table", "lent"]);
    assert_eq!(table.status.code(), Some(1));
    assert!(said(&table).contains("--table is for a .qmd"), "{}", said(&table));
}

#[test]
fn the_page_needs_nothing_else() {
    if !require_target("thumbv7em-none-eabi") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("page.html");
    let output =
        profile(&["--core", "cortex-m4", "--part", "nrf52840", "--html", page.to_str().unwrap(), "--json"]);
    let core = core(&output);
    let page = std::fs::read_to_string(page).unwrap();
    assert!(!page.contains("<script") && !page.contains("src=") && !page.contains("href="));
    assert_eq!(page.matches("<svg").count(), 2);
    assert!(page.contains(&format!("worst {} at frame", core["cycles_max"])));
    assert!(page.contains("nrf52840 at 64 MHz"));
    assert!(core["energy"]["battery_hours"].as_f64().unwrap() > 1000.0);
}

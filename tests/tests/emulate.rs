//! A host talks to a Raspberry Pi Pico: the board's image in rp2040js, its line to the host on a TCP port.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{bunraku, npm_package, require_target, workspace};
use mocap::sample;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Seconds for which an answer is waited for, and [`TIME`] in which anything happens: only a hang takes so long, however
/// busy this machine is.
const PATIENCE: &str = "300";
const TIME: Duration = Duration::from_secs(900);

/// The emulator, which does not outlive the test.
struct Pico(Child);

impl Drop for Pico {
    fn drop(&mut self) {
        // An error means that it is gone already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn succeeds(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The sample clip's motion, and a Pico that plays it, in a folder.
struct Bench {
    folder: TempDir,
    port: String,
    _pico: Pico,
}

impl Bench {
    /// None where there is no emulator.
    fn new(arguments: &[&str]) -> Option<Self> {
        if npm_package("rp2040js").is_none() || !require_target("thumbv6m-none-eabi") {
            return None;
        }
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let clip = sample::clip();
        fs::write(path("sample.asf"), sample::asf()).unwrap();
        let mut amc = Vec::new();
        let rotations = mocap::export::amc::Rotations::AsTheyAre;
        mocap::export::amc::write(&mut amc, &clip.skeleton, &clip.motion, rotations).unwrap();
        fs::write(path("sample.amc"), amc).unwrap();
        encode(folder.path(), "clip.qmd", &[]);
        let mut emulate = bunraku();
        emulate.arg("emulate").arg(path("clip.qmd")).arg("--skeleton").arg(path("sample.asf"));
        emulate.arg("--puppet").arg(workspace().join("puppets/sample.toml"));
        let log = fs::File::create(path("log")).unwrap();
        let mut pico = Pico(emulate.args(arguments).stdout(Stdio::piped()).stderr(log).spawn().unwrap());
        let mut port = String::new();
        BufReader::new(pico.0.stdout.take().unwrap()).read_line(&mut port).unwrap();
        Some(Self { folder, port: port.trim().to_owned(), _pico: pico })
    }

    /// The sample clip in a file of this name.
    fn encode(&self, name: &str, arguments: &[&str]) -> PathBuf {
        encode(self.folder.path(), name, arguments)
    }

    /// A command that talks to the Pico.
    fn link(&self, name: &str) -> Command {
        let mut command = bunraku();
        command.arg(name).arg(&self.port).args(["--patience", PATIENCE]);
        command
    }

    fn push(&self, arguments: &[&str]) -> String {
        succeeds(self.link("push").args(arguments))
    }

    fn status(&self) -> serde_json::Value {
        serde_json::from_str(&self.push(&["status", "--json"])).unwrap()
    }

    /// What the image and the emulator have said.
    fn log(&self) -> String {
        fs::read_to_string(self.folder.path().join("log")).unwrap()
    }

    /// Waits for what the puppet does, by itself or as told.
    fn until(&self, wanted: &[&str]) -> serde_json::Value {
        let began = Instant::now();
        loop {
            let status = self.status();
            assert_eq!(status["device"]["name"], "Pico");
            assert!(status["status"]["fault"].is_null(), "{status}");
            let state = status["status"]["state"].as_str().unwrap().to_owned();
            if wanted.contains(&&*state) {
                return status;
            }
            assert!(began.elapsed() < TIME, "{state}, and not {wanted:?}");
            sleep(Duration::from_millis(100));
        }
    }
}

fn encode(folder: &Path, name: &str, arguments: &[&str]) -> PathBuf {
    let mut encode = bunraku();
    encode.arg("encode").arg(folder.join("sample.amc")).arg("--skeleton").arg(folder.join("sample.asf"));
    succeeds(encode.args(arguments).arg("-o").arg(folder.join(name)));
    folder.join(name)
}

#[test]
fn a_clip_is_pushed_to_a_pico_and_played() {
    let Some(bench) = Bench::new(&[]) else { return };
    let clip = bench.encode("clip.mclip", &[]);
    bench.until(&["Playing"]);
    bench.push(&["stop"]);
    // Its flash stops everything else, so it takes clips only at rest.
    bench.until(&["Holding"]);
    bench.push(&["upload", "7", clip.to_str().unwrap()]);
    let list = bench.push(&["list"]);
    let bytes = fs::metadata(clip).unwrap().len();
    assert!(list.contains(&format!("{bytes} bytes")) && list.contains("2 clips"), "{list}");
    bench.push(&["play", "7"]);
    let status = bench.until(&["Playing"]);
    assert_eq!(status["status"]["playing"]["clip"], 7, "{status}");
    // An erase takes 45 ms, at rest; nothing else may be late.
    assert!(status["status"]["missed"].as_u64().unwrap() < 100, "{status}");
}

#[test]
fn a_stream_to_a_pico_plays_as_it_was_sent_or_its_line_is_too_slow() {
    let Some(bench) = Bench::new(&[]) else { return };
    bench.until(&["Playing"]);
    let stream = |clip: &Path| {
        let output = bench.link("stream").arg(clip).arg("--json").output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{said}");
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        (report, said)
    };
    // A frame a block, and more of them than the device has ticks (50 a second), if each takes one.
    let short = ["--codec", "pcm", "--bits", "12", "--rate", "75", "--block", "64"];
    let (report, said) = stream(&bench.encode("short.mclip", &short));
    assert_eq!((&report["counters"]["played"], &*said), (&480.into(), ""), "{report}");
    // 119 kbit/s, where a UART at 115,200 bit/s carries 92.
    let fast = ["--codec", "pcm", "--bits", "16", "--rate", "240"];
    let (report, said) = stream(&bench.encode("fast.mclip", &fast));
    assert!(report["counters"]["concealed"].as_u64().unwrap() > 0, "{report}");
    let (needs, carried) = (&report["clip_bits_per_second"], &report["line_bits_per_second"]);
    assert!(needs.as_f64().unwrap() > 92_160.0 && carried.as_f64().unwrap() < 92_160.0, "{report}");
    assert!(said.contains(&format!("needs {:.0} bits per second", needs.as_f64().unwrap())), "{said}");
}

#[test]
fn a_pico_that_hangs_is_started_again_by_its_watchdog_and_holds_still() {
    // In the middle of the clip.
    let Some(bench) = Bench::new(&["--hang", "6000"]) else { return };
    bench.until(&["Playing"]);
    let began = Instant::now();
    while !bench.log().contains("starts again") {
        assert!(began.elapsed() < TIME, "{}", bench.log());
        sleep(Duration::from_millis(100));
    }
    let log = bench.log();
    let bitten = log.lines().find(|line| line.contains("the watchdog was not fed")).unwrap();
    let millis = bitten.split_once(" again, ").and_then(|(_, after)| after.split(' ').next()).unwrap();
    // It was fed a tick before that at most.
    assert!((479..=500).contains(&millis.parse::<u32>().unwrap()), "{bitten}");

    // It says why it started, and holds the pose in which it was.
    let held = loop {
        let status = bench.status();
        if status["status"]["state"] == "Holding" {
            break status;
        }
        assert!(began.elapsed() < TIME, "{status}");
        sleep(Duration::from_millis(100));
    };
    assert_eq!(held["status"]["fault"], "the controller has restarted by itself", "{held}");
    let servos = |status: &serde_json::Value| {
        let servos = status["status"]["servos"].as_array().unwrap().iter();
        servos.map(|servo| [servo["goal"].clone(), servo["reading"]["position"].clone()]).collect::<Vec<_>>()
    };
    sleep(Duration::from_secs(2));
    assert_eq!(servos(&bench.status()), servos(&held));
    let refused = bench.link("push").args(["play", "0"]).output().unwrap();
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(said.contains("the controller has restarted by itself"), "{said}");
    bench.push(&["acknowledge"]);
    bench.until(&["Playing"]);
}

//! A host talks to a Raspberry Pi Pico: the board's image in rp2040js, its line to the host on a TCP port.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{bunraku, npm_package, require_target, workspace};
use encoder::sample;
use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

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

#[test]
fn a_clip_is_pushed_to_a_pico_and_played() {
    if npm_package("rp2040js").is_none() || !require_target("thumbv6m-none-eabi") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let clip = sample::clip();
    fs::write(path("sample.asf"), sample::asf()).unwrap();
    let mut amc = Vec::new();
    let rotations = encoder::export::amc::Rotations::AsTheyAre;
    encoder::export::amc::write(&mut amc, &clip.skeleton, &clip.motion, rotations).unwrap();
    fs::write(path("sample.amc"), amc).unwrap();
    for name in ["clip.qmd", "clip.mclip"] {
        let mut encode = bunraku();
        encode.arg("encode").arg(path("sample.amc")).arg("--skeleton").arg(path("sample.asf"));
        succeeds(encode.arg("-o").arg(path(name)));
    }

    let mut emulate = bunraku();
    emulate.arg("emulate").arg(path("clip.qmd")).arg("--skeleton").arg(path("sample.asf"));
    emulate.arg("--puppet").arg(workspace().join("puppets/sample.toml"));
    let mut pico = Pico(emulate.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap());
    let mut port = String::new();
    BufReader::new(pico.0.stdout.take().unwrap()).read_line(&mut port).unwrap();
    let push = |arguments: &[&str]| succeeds(bunraku().arg("push").arg(port.trim()).args(arguments));
    // What the puppet does, by itself or as told.
    let until = |wanted: &[&str]| {
        let began = Instant::now();
        loop {
            let status: serde_json::Value = serde_json::from_str(&push(&["status", "--json"])).unwrap();
            assert_eq!(status["device"]["name"], "Pico");
            assert!(status["status"]["fault"].is_null(), "{status}");
            let state = status["status"]["state"].as_str().unwrap().to_owned();
            if wanted.contains(&&*state) {
                return status;
            }
            assert!(began.elapsed() < Duration::from_secs(120), "{state}, and not {wanted:?}");
            sleep(Duration::from_millis(100));
        }
    };

    until(&["Playing"]);
    push(&["stop"]);
    // Its flash stops everything else, so it takes clips only at rest.
    until(&["Holding"]);
    push(&["upload", "7", path("clip.mclip").to_str().unwrap()]);
    let list = push(&["list"]);
    let bytes = fs::metadata(path("clip.mclip")).unwrap().len();
    assert!(list.contains(&format!("{bytes} bytes")) && list.contains("2 clips"), "{list}");
    push(&["play", "7"]);
    let status = until(&["Playing"]);
    assert_eq!(status["status"]["playing"]["clip"], 7, "{status}");
    // An erase takes 45 ms, at rest; nothing else may be late.
    assert!(status["status"]["missed"].as_u64().unwrap() < 100, "{status}");
}

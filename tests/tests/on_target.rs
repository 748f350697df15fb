//! A clip's frames are the same bits on x86 and on Cortex-M0, M3 and M4, in place and streamed.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{cargo, mclip, require_program, require_target, vectors};
use host_sim::qemu;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

/// The longest trial takes 2 s.
const LIMIT: Duration = Duration::from_secs(120);

/// A clip in a file, and the hash of its frames as decoded here.
struct Case {
    path: PathBuf,
    sha256: String,
}

/// Golden vectors, the embedded sample, and the six trials where they are there.
fn cases() -> &'static [Case] {
    static CASES: OnceLock<(tempfile::TempDir, Vec<Case>)> = OnceLock::new();
    let (_, cases) = CASES.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let cases = vectors::with_trials()
            .into_iter()
            .chain(mclip::with_sample())
            .map(|vector| {
                let path = folder.path().join(&vector.name);
                fs::write(&path, &vector.bytes).unwrap();
                Case { path, sha256: vector.sha256 }
            })
            .collect();
        (folder, cases)
    });
    cases
}

/// Runs the image on every clip.
fn check(machine: &str, target: &str, binary: &str) {
    if !require_target(target) || !require_program("qemu-system-arm") {
        return;
    }
    let image = cargo::image("on-target", binary, target, "firmware", &[]);
    for case in cases() {
        // The streaming image is one for QMD.
        if binary == "stream" && case.path.extension().is_some_and(|extension| extension == "mclip") {
            continue;
        }
        assert_eq!(run(&image, machine, &case.path), case.sha256, "{} on {machine}", case.path.display());
    }
}

fn run(image: &Path, machine: &str, clip: &Path) -> String {
    let image = qemu::Image { path: image, machine, arguments: &[clip.to_str().unwrap()] };
    let mut lines = Vec::new();
    qemu::run_image(&image, None, LIMIT, &mut |line| lines.push(line.to_owned())).unwrap();
    lines.join("\n")
}

#[test]
fn cortex_m4_in_place() {
    check("mps2-an386", "thumbv7em-none-eabi", "in-place");
}

#[test]
fn cortex_m4_streamed() {
    check("mps2-an386", "thumbv7em-none-eabi", "stream");
}

#[test]
fn cortex_m3_in_place() {
    check("mps2-an385", "thumbv7m-none-eabi", "in-place");
}

#[test]
fn cortex_m0_streamed() {
    check("microbit", "thumbv6m-none-eabi", "stream");
}

#[test]
fn an_image_that_fails_or_hangs_is_an_error() {
    if !require_target("thumbv7em-none-eabi") || !require_program("qemu-system-arm") {
        return;
    }
    let path = cargo::image("on-target", "in-place", "thumbv7em-none-eabi", "firmware", &[]);
    let error = |argument: &str, limit| {
        let image = qemu::Image { path: &path, machine: "mps2-an386", arguments: &[argument] };
        format!("{:#}", qemu::run_image(&image, None, limit, &mut |_| {}).unwrap_err())
    };
    let missing = error("no/such/clip", LIMIT);
    assert!(missing.contains("exit status: 101") && missing.contains("cannot be opened"), "{missing}");
    let slow = error(cases()[0].path.to_str().unwrap(), Duration::ZERO);
    assert!(slow.contains("did not end within 0 s"), "{slow}");
}

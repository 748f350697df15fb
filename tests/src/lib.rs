//! Helpers that the workspace-wide tests share.
#![forbid(unsafe_code)]

pub mod budgets;
pub mod cargo;
pub mod clock;
pub mod live;
pub mod mclip;
pub mod vectors;

use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Says that a test, or a part of it, cannot run here. `cargo xtask test` lists what was said (in the file that
/// `BUNRAKU_SKIPS` names) and counts the test as skipped, not as passed; in CI, or where `BUNRAKU_NO_SKIP` is set, it fails
/// the test.
///
/// # Panics
/// Where skipping is not allowed.
pub fn skip(why: &str) {
    let name = test_name();
    let set = |name: &str| std::env::var(name).is_ok_and(|value| !["", "false"].contains(&&*value));
    let forbidden = set("CI") || set("BUNRAKU_NO_SKIP");
    assert!(!forbidden, "SKIPPED, which is not allowed here: {name}: {why}");
    eprintln!("SKIPPED: {name}: {why}");
    if let Some(path) = std::env::var_os("BUNRAKU_SKIPS") {
        let line = format!("{name}: {why}\n");
        let file = OpenOptions::new().create(true).append(true).open(&path);
        file.and_then(|mut file| file.write_all(line.as_bytes()))
            .unwrap_or_else(|error| panic!("cannot note a skipped test in {}: {error}", path.display()));
    }
}

/// The running test, as nextest's report has it: the test program, a space, and the test's name.
fn test_name() -> String {
    let program = std::env::var("NEXTEST_BINARY_ID").ok().or_else(|| {
        let path = std::env::current_exe().ok()?;
        // Without the hash that cargo puts behind the name.
        Some(path.file_stem()?.to_string_lossy().rsplit_once('-')?.0.to_owned())
    });
    let test = std::env::var("NEXTEST_TEST_NAME").ok();
    let test = test.or_else(|| std::thread::current().name().map(str::to_owned));
    format!("{} {}", program.as_deref().unwrap_or("a program"), test.as_deref().unwrap_or("a test"))
}

/// The workspace's folder.
pub fn workspace() -> &'static Path {
    match Path::new(env!("CARGO_MANIFEST_DIR")).parent() {
        Some(folder) => folder,
        None => unreachable!("tests/ lies in the workspace"),
    }
}

/// The folder of real motion capture, which is no part of the project: `BUNRAKU_MOTION`, or `../shared/motion`.
/// `None` where it is not there, which is said.
pub fn motion() -> Option<PathBuf> {
    let folder = motion_folder();
    if folder.join("cmu").is_dir() {
        return Some(folder);
    }
    skip(&format!("{} has no motion capture (set BUNRAKU_MOTION)", folder.display()));
    None
}

/// The folder of inputs that went wrong once, which is no part of the project: `cases` beside the real motion capture. `None`
/// where it is not there, which is said.
pub fn cases() -> Option<PathBuf> {
    let folder = motion_folder().join("../cases");
    if folder.is_dir() {
        return Some(folder);
    }
    skip(&format!("{} is not there", folder.display()));
    None
}

fn motion_folder() -> PathBuf {
    std::env::var_os("BUNRAKU_MOTION").map_or_else(|| workspace().join("../shared/motion"), PathBuf::from)
}

/// Recorded trials of CMU (motion and skeleton, .amc and .asf), sorted: all of the folder of real motion capture where that is
/// there, otherwise the one that `cargo xtask setup` fetches. `None` where there is neither, which is said.
///
/// # Panics
/// Where the folder cannot be read.
pub fn trials() -> Option<Vec<(PathBuf, PathBuf)>> {
    let fetched = workspace().join("target/motion/cmu");
    let all = motion_folder().join("cmu");
    let Some(folder) = [all, fetched].into_iter().find(|folder| folder.is_dir()) else {
        skip("no recorded trial is in target/motion (run `cargo xtask setup`)");
        return None;
    };
    let files = std::fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut trials = vec![];
    for path in files.flatten().map(|file| file.path()) {
        let name = path.file_stem().and_then(|name| name.to_str()).unwrap_or_default();
        // 02_01.amc is trial 1 of subject 2, whose skeleton is 02.asf.
        if let (Some("amc"), Some((subject, _))) =
            (path.extension().and_then(|extension| extension.to_str()), name.split_once('_'))
        {
            let skeleton = folder.join(format!("{subject}.asf"));
            trials.push((path, skeleton));
        }
    }
    trials.sort();
    assert!(!trials.is_empty(), "{} has no .amc", folder.display());
    Some(trials)
}

/// The folder of an npm package that tests compare us with: in target/npm, where `cargo xtask setup` puts it.
pub fn npm_package(name: &str) -> Option<PathBuf> {
    let folder = workspace().join("target/npm/node_modules").join(name);
    if !folder.is_dir() {
        skip(&format!("the npm package {name} is not in target/npm (run `cargo xtask setup`)"));
        return None;
    }
    require_program("node").then_some(folder)
}

/// The command `bunraku`, as built next to the running test.
///
/// # Panics
/// Where it was not built: cargo builds no other package's commands for a test.
pub fn bunraku() -> Command {
    let path = std::env::current_exe().ok().and_then(|test| Some(test.parent()?.parent()?.join("bunraku")));
    match path {
        Some(path) if path.is_file() => Command::new(path),
        _ => panic!("bunraku is not built: cargo build --package host-sim, or run `cargo xtask test`"),
    }
}

/// A Python with the packages of tests/peers/requirements.txt: `BUNRAKU_PEERS_PYTHON`, which
/// `cargo xtask test` sets up.
pub fn python() -> Option<PathBuf> {
    let found = std::env::var_os("BUNRAKU_PEERS_PYTHON").map(PathBuf::from);
    if found.is_none() {
        skip("no Python with the peers' packages (run `cargo xtask test`, or set BUNRAKU_PEERS_PYTHON)");
    }
    found
}

/// Whether Rust's target `target` is installed; says so where it is not.
pub fn require_target(target: &str) -> bool {
    let output = Command::new("rustc").args(["--print", "target-libdir", "--target", target]).output();
    let found = output.is_ok_and(|output| {
        output.status.success() && Path::new(String::from_utf8_lossy(&output.stdout).trim()).is_dir()
    });
    if !found {
        skip(&format!("target {target} is not installed (rustup target add {target})"));
    }
    found
}

/// Whether a program can be started; says so where it cannot.
pub fn require_program(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success());
    if !found {
        skip(&format!("{program} is not installed"));
    }
    found
}

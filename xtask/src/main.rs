//! `cargo xtask`: the commands of a fresh clone.
//!
//! `demo` runs the main job on the embedded clip, `test` runs all tests, `calibrate` those that the simulated cores
//! are trusted by. All install what they need first, or say exactly what is missing.
#![forbid(unsafe_code)]

mod setup;
mod verify;

use std::env;
use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::process::{Command, ExitCode};

const USAGE: &str = "\
Usage: cargo xtask <COMMAND>

Commands:
  demo       Encode, compare and play the embedded clip, on this machine and on a Cortex-M4 in QEMU
  test       Run all tests; what cannot run here is listed and counted. Arguments go to the test runner
  boards     Build the firmware of every board with the embedded clip, and print what it takes of flash and RAM
  calibrate  Print how well the simulated cores agree with measurements and other simulators (docs/CYCLES.md)
  coverage   Print which lines of decoder-core its tests run; fails below 98 % (docs/TESTING.md, as the next three)
  miri       Interpret the tests of decoder-core, for a little- and a big-endian machine (nightly)
  fuzz       Fuzz all targets, or `fuzz TARGET SECONDS` (nightly)
  mutants    Change decoder-core and see which changes its tests miss. Arguments go to cargo-mutants
  setup      Only install what the others need, or say what is missing
";

type Result<T> = std::result::Result<T, String>;

fn main() -> ExitCode {
    let mut arguments = env::args().skip(1);
    let command = arguments.next();
    let rest: Vec<String> = arguments.collect();
    let done = match (command.as_deref(), rest.as_slice()) {
        (Some("demo"), []) => demo(),
        (Some("test"), _) => test(&rest),
        (Some("boards"), []) => boards(),
        (Some("calibrate"), []) => calibrate(),
        (Some("coverage"), []) => verify::coverage(),
        (Some("miri"), []) => verify::miri(),
        (Some("fuzz"), [] | [_] | [_, _]) => verify::fuzz(&rest),
        (Some("mutants"), _) => verify::mutants(&rest),
        (Some("setup"), []) => setup::all().report(),
        _ => {
            eprint!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error}");
            ExitCode::FAILURE
        }
    }
}

fn demo() -> Result<()> {
    let ready = setup::for_boards();
    let folder = workspace().join("target/demo");
    let mut bunraku = cargo();
    bunraku
        .args(["run", "--quiet", "--package", "host-sim", "--bin", "bunraku", "--", "demo", "--output"])
        .arg(folder);
    if ready.missing.is_empty() {
        bunraku.arg("--qemu");
    } else {
        println!("The Cortex-M4 part is left out:");
        ready.list();
    }
    run(&mut bunraku)
}

fn test(arguments: &[String]) -> Result<()> {
    let ready = setup::all();
    ready.list();
    let skips = workspace().join("target/skipped-tests.txt");
    fs::create_dir_all(workspace().join("target"))
        .map_err(|error| format!("cannot make target/: {error}"))?;
    fs::write(&skips, "").map_err(|error| format!("cannot write {}: {error}", skips.display()))?;
    // Tests run the command as users do.
    run(cargo().args(["build", "--package", "host-sim", "--bin", "bunraku"]))?;
    let mut tests = cargo();
    let nextest = setup::works(Command::new("cargo").args(["nextest", "--version"]));
    tests.args(if nextest { ["nextest", "run"].as_slice() } else { &["test"] });
    tests.args(arguments).env("BUNRAKU_SKIPS", &skips);
    if let Some(python) = &ready.python {
        tests.env("BUNRAKU_PEERS_PYTHON", python);
    }
    let outcome = run(&mut tests);
    // nextest leaves the examples in the docs to cargo.
    let examples =
        if nextest && arguments.is_empty() { run(cargo().args(["test", "--doc"])) } else { Ok(()) };

    let skipped =
        fs::read_to_string(&skips).map_err(|error| format!("cannot read {}: {error}", skips.display()))?;
    for line in skipped.lines() {
        println!("skipped: {line}");
    }
    let count = skipped.lines().count();
    println!("{count} tests skipped");
    outcome.and(examples)?;
    match (count, env::var_os("CI")) {
        (1.., Some(_)) => Err(format!("{count} tests were skipped, and in CI a skip is a failure")),
        _ => Ok(()),
    }
}

/// Builds every board's image; fails where one takes more than firmware/boards/budget.toml allows.
fn boards() -> Result<()> {
    setup::for_boards().report()?;
    run(cargo()
        .args([
            "run",
            "--quiet",
            "--package",
            "host-sim",
            "--bin",
            "bunraku",
            "--",
            "image",
            "--board",
            "all",
        ])
        .args(["--budget", "firmware/boards/budget.toml"]))
}

/// The tests that show how well the simulated cores agree with others, with what they print.
fn calibrate() -> Result<()> {
    setup::all().report()?;
    let mut tests = cargo();
    tests.args(["test", "--quiet", "--package", "bunraku-tests"]);
    for name in ["rules", "calibration", "random", "lockstep", "images"] {
        tests.arg("--test").arg(format!("thumb_{name}"));
    }
    run(tests.args(["--", "--nocapture", "--test-threads", "1"]))
}

fn workspace() -> &'static Path {
    match Path::new(env!("CARGO_MANIFEST_DIR")).parent() {
        Some(folder) => folder,
        None => unreachable!("xtask/ lies in the workspace"),
    }
}

fn cargo() -> Command {
    let mut command = Command::new(env::var_os("CARGO").as_deref().unwrap_or(OsStr::new("cargo")));
    command.current_dir(workspace());
    command
}

fn run(command: &mut Command) -> Result<()> {
    let status = command.status().map_err(|error| format!("cannot start {command:?}: {error}"))?;
    if status.success() { Ok(()) } else { Err(format!("{command:?} failed ({status})")) }
}

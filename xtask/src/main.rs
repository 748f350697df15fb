//! `cargo xtask`: the commands of a fresh clone.
//!
//! `demo` runs the main job on the embedded clip, `test` runs all tests, `calibrate` those that the simulated cores
//! are trusted by. All install what they need first, or say exactly what is missing.
#![forbid(unsafe_code)]

mod budgets;
mod publish;
mod setup;
mod test;
mod verify;

use std::env;
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, ExitCode};

const USAGE: &str = "\
Usage: cargo xtask <COMMAND>

Commands:
  demo       Encode, compare and play the embedded clip, on this machine and on a Cortex-M4 in QEMU
  test       Run all tests; what cannot run here is listed and counted. Arguments go to the test runner
  boards     Build the firmware of every board with the embedded clip, and print what it takes of flash and RAM
  budgets    Measure cycles and bytes anew, and write bench/budgets.toml
  api        Write down the public items of the crates that are for others, in docs/api
  publish-check
             Package and build the crates that are for others, as for the registry, without publishing them
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
        (Some("test"), _) => test::test(&rest),
        (Some("boards"), []) => boards(),
        (Some("calibrate"), []) => calibrate(),
        (Some("budgets"), []) => budgets::budgets(),
        (Some("api"), []) => publish::write_api(),
        (Some("publish-check"), []) => publish::check(),
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
    // Little optimised, and without what the demo does not need: building takes longer than the demo.
    bunraku
        .args(["run", "--quiet", "--profile", "quick", "--package", "host-sim", "--no-default-features"])
        .args(["--bin", "bunraku", "--", "demo", "--output"])
        .arg(folder);
    if ready.missing.is_empty() {
        bunraku.arg("--qemu");
    } else {
        println!("The Cortex-M4 part is left out:");
        ready.list();
    }
    run(&mut bunraku)
}

/// Builds every board's image; fails where one takes more than bench/budgets.toml allows.
fn boards() -> Result<()> {
    setup::for_boards().report()?;
    run(cargo().args(["build", "--package", "host-sim", "--bin", "bunraku"]))?;
    run(cargo().args(["test", "--quiet", "--test", "boards", "--", "--ignored", "--nocapture"]))
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

//! What checks the tests and the decoder beyond running them: coverage, Miri, fuzzing and mutants (docs/TESTING.md).

use crate::setup::works;
use crate::{Result, cargo, run, workspace};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Least part of the lines of decoder-core that its tests must run, in percent.
const LEAST_COVERAGE: f64 = 98.0;

/// Targets that Miri interprets decoder-core for: this machine's, and one that is big-endian.
const MIRI_TARGETS: [&str; 2] = ["x86_64-unknown-linux-gnu", "s390x-unknown-linux-gnu"];

/// Seconds for which a target is fuzzed unless others are given.
const FUZZ_SECONDS: &str = "300";

/// Measures which lines of decoder-core its own tests run, and fails below 98 %. Lines of tests do not count.
pub fn coverage() -> Result<()> {
    cargo_tool("llvm-cov", "cargo-llvm-cov")?;
    run(Command::new("rustup").args(["component", "add", "llvm-tools"]))?;
    let report = workspace().join("target/coverage.lcov");
    create_target()?;
    run(cargo()
        .args(["llvm-cov", "test", "--quiet", "--package", "decoder-core", "--lcov", "--output-path"])
        .arg(&report))?;
    let files = read_lcov(&read(&report)?)?;
    let (mut all, mut hit) = (0, 0);
    for (file, lines) in &files {
        let missed: Vec<String> =
            lines.iter().filter(|(_, count)| **count == 0).map(|(line, _)| line.to_string()).collect();
        let covered = lines.len() - missed.len();
        println!(
            "{:6.2} %  {:4} lines  {file}  {}",
            percent(covered, lines.len()),
            lines.len(),
            missed.join(" ")
        );
        all += lines.len();
        hit += covered;
    }
    let total = percent(hit, all);
    println!(
        "{total:6.2} %  {all:4} lines  decoder-core (numbers behind a file are the lines that were not run)"
    );
    if total < LEAST_COVERAGE {
        return Err(format!(
            "the tests run {total:.2} % of decoder-core's lines, expected {LEAST_COVERAGE} %"
        ));
    }
    Ok(())
}

fn percent(part: usize, whole: usize) -> f64 {
    if whole == 0 { 100.0 } else { 100.0 * part as f64 / whole as f64 }
}

/// How often each line of each file was run, without the files' tests.
fn read_lcov(text: &str) -> Result<BTreeMap<String, BTreeMap<usize, u64>>> {
    let mut files = BTreeMap::new();
    let mut file: Option<(String, usize)> = None;
    for record in text.lines() {
        if let Some(path) = record.strip_prefix("SF:") {
            file = source(Path::new(path))?;
        } else if let (Some(data), Some((name, tests))) = (record.strip_prefix("DA:"), &file) {
            let mut numbers = data.split(',').map(str::parse::<u64>);
            let (Some(Ok(line)), Some(Ok(count))) = (numbers.next(), numbers.next()) else {
                return Err(format!("coverage.lcov: found {record}, expected DA:LINE,COUNT"));
            };
            let line = line as usize;
            if line < *tests {
                let lines: &mut BTreeMap<usize, u64> = files.entry(name.clone()).or_default();
                *lines.entry(line).or_default() += count;
            }
        }
    }
    if files.is_empty() {
        return Err("coverage.lcov names no file of decoder-core".to_owned());
    }
    Ok(files)
}

/// Name of a source file of decoder-core and the line where its tests begin; `None` for other files.
fn source(path: &Path) -> Result<Option<(String, usize)>> {
    let Ok(name) = path.strip_prefix(workspace().join("decoder-core/src")) else { return Ok(None) };
    // Modules that the tests share.
    if name.ends_with("testing.rs") {
        return Ok(None);
    }
    let text = read(path)?;
    let tests = text.lines().position(|line| line == "#[cfg(test)]").map_or(usize::MAX, |line| line + 1);
    // In lib.rs and mod.rs the attribute is on `mod testing;`, which has no lines to run behind it.
    Ok(Some((name.display().to_string(), tests)))
}

/// Interprets the tests of decoder-core, the golden vectors with them, as code for a little- and a big-endian machine.
/// Miri finds undefined behaviour, and differences between the two; large tests run with fewer cases there.
pub fn miri() -> Result<()> {
    nightly(&["miri", "rust-src"])?;
    for target in MIRI_TARGETS {
        println!("miri: {target}");
        // The golden vectors are files.
        run(Command::new("cargo")
            .current_dir(workspace())
            .env("MIRIFLAGS", "-Zmiri-disable-isolation")
            // Interpreted, a case takes a thousand times as long.
            .env("PROPTEST_CASES", "8")
            .args(["+nightly", "miri", "test", "--quiet", "--package", "decoder-core", "--tests"])
            .args(["--target", target]))?;
    }
    Ok(())
}

/// Fuzzes a target, or all one after the other, for some seconds each. What is found is kept in target/fuzz/TARGET,
/// and the next run goes on from there.
pub fn fuzz(arguments: &[String]) -> Result<()> {
    nightly(&[])?;
    cargo_tool("fuzz", "cargo-fuzz")?;
    let (target, seconds) = match arguments {
        [] => ("all", FUZZ_SECONDS),
        [target] => (target.as_str(), FUZZ_SECONDS),
        [target, seconds, ..] => (target.as_str(), seconds.as_str()),
    };
    let listed = fuzz_command("list").args(["--fuzz-dir", "fuzz"]).output();
    let listed = listed.map_err(|error| format!("cannot start cargo: {error}"))?.stdout;
    let listed = String::from_utf8_lossy(&listed).into_owned();
    let targets: Vec<&str> = listed.lines().filter(|name| target == "all" || target == *name).collect();
    if targets.is_empty() {
        let names = listed.lines().collect::<Vec<_>>().join(", ");
        return Err(format!("found fuzz target {target}, expected all or one of {names}"));
    }
    for target in targets {
        let folder = workspace().join("target/fuzz").join(target);
        let (corpus, seeds, artifacts) =
            (folder.join("corpus"), folder.join("seeds"), folder.join("artifacts/"));
        for folder in [&corpus, &artifacts] {
            fs::create_dir_all(folder)
                .map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
        }
        run(cargo()
            .args(["run", "--quiet", "--package", "bunraku-fuzz", "--example", "seeds", "--", target])
            .arg(&seeds))?;
        // No sanitizer: the code has no `unsafe`, so panics are what there is to find, three times as fast.
        run(fuzz_command("run")
            .args(["--fuzz-dir", "fuzz", "--sanitizer", "none", "--features", "libfuzzer", target])
            .args([&corpus, &seeds])
            .args(["--", "-timeout=20", "-max_len=12000", "-print_final_stats=1"])
            .arg(format!("-max_total_time={seconds}"))
            .arg(format!("-artifact_prefix={}/", artifacts.display())))?;
    }
    Ok(())
}

/// `cargo fuzz`, which builds the release profile.
fn fuzz_command(command: &str) -> Command {
    let mut fuzz = Command::new("cargo");
    fuzz.current_dir(workspace()).args(["+nightly", "fuzz", command]);
    fuzz
}

/// Changes decoder-core in small ways and reports which changes its tests miss. Arguments go to cargo-mutants:
/// `--file decoder-core/src/word.rs`, or `--shard 3/20` for a part of all mutants.
pub fn mutants(arguments: &[String]) -> Result<()> {
    cargo_tool("mutants", "cargo-mutants")?;
    create_target()?;
    let output = workspace().join("target");
    // Code that is compiled fast matters more than tests that run fast. The examples in the docs are left out: each is a
    // program of its own.
    run(cargo()
        .env("CARGO_PROFILE_DEV_OPT_LEVEL", "1")
        .args(["mutants", "--package", "decoder-core", "--jobs", "1", "--output"])
        .arg(output)
        .args(["--minimum-test-timeout", "60"])
        .args(arguments)
        .args(["--", "--lib", "--tests"]))
}

fn create_target() -> Result<()> {
    let target = workspace().join("target");
    fs::create_dir_all(&target).map_err(|error| format!("cannot make {}: {error}", target.display()))
}

fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).map_err(|error| format!("cannot read {}: {error}", path.display()))
}

/// Makes sure of a command of cargo from the registry.
fn cargo_tool(command: &str, package: &str) -> Result<()> {
    if works(Command::new("cargo").args([command, "--version"])) {
        return Ok(());
    }
    println!("installing {package}");
    run(Command::new("cargo").args(["install", "--locked", package]))
}

/// Makes sure of a nightly toolchain with these components.
fn nightly(components: &[&str]) -> Result<()> {
    let missing = |what: &str, command: &str| {
        format!(
            "{what} is not installed and cannot be fetched here; on a machine with access to Rust's servers: {command}"
        )
    };
    if !works(Command::new("rustc").args(["+nightly", "--version"])) {
        run(Command::new("rustup").args(["toolchain", "install", "nightly", "--profile", "minimal"]))
            .map_err(|_| missing("the nightly toolchain", "rustup toolchain install nightly"))?;
    }
    if components.is_empty() {
        return Ok(());
    }
    run(Command::new("rustup").args(["component", "add", "--toolchain", "nightly"]).args(components)).map_err(
        |_| {
            let names = components.join(" ");
            missing(
                &format!("nightly's {names}"),
                &format!("rustup component add --toolchain nightly {names}"),
            )
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_tests_and_of_other_crates_do_not_count() {
        let source = workspace().join("decoder-core/src/arithmetic.rs");
        let text = read(&source).unwrap();
        let tests = text.lines().position(|line| line == "#[cfg(test)]").unwrap() + 1;
        let report = format!(
            "SF:/elsewhere/lib.rs\nDA:1,0\nend_of_record\nSF:{}\nDA:3,0\nDA:4,7\nDA:{},0\nend_of_record\n",
            source.display(),
            tests + 3
        );
        let files = read_lcov(&report).unwrap();
        assert_eq!(files.len(), 1);
        assert_eq!(files["arithmetic.rs"], BTreeMap::from([(3, 0), (4, 7)]));
        assert!(read_lcov("SF:/elsewhere/lib.rs\nDA:1,1\n").is_err());
    }
}

//! `cargo xtask test`: all tests, and a last line that counts what passed, what failed and what could not run.

use crate::{Result, cargo, run, setup, workspace};
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{env, fs};

/// Runs all tests, or those that the arguments for the test runner say. Fails where one fails and, in CI, where one
/// could not run.
pub fn test(arguments: &[String]) -> Result<()> {
    let ready = setup::all();
    ready.list();
    let target = target();
    let skips = target.join("skipped-tests.txt");
    fs::create_dir_all(&target).map_err(|error| format!("cannot make {}: {error}", target.display()))?;
    fs::write(&skips, "").map_err(|error| format!("cannot write {}: {error}", skips.display()))?;
    // Tests run the command as users do. Built with the tests, it shares all artefacts with them.
    run(cargo().args(["build", "--bins", "--tests"]))?;

    let mut tests = cargo();
    tests.env("BUNRAKU_SKIPS", &skips);
    if let Some(python) = &ready.python {
        tests.env("BUNRAKU_PEERS_PYTHON", python);
    }
    let nextest = setup::works(Command::new("cargo").args(["nextest", "--version"]));
    let mut tally = Tally::default();
    if nextest {
        tests.args(["nextest", "run"]).args(arguments);
        nextest_tally(&mut tests, &target, &mut tally)?;
    } else {
        libtest_tally(tests.args(["test", "--no-fail-fast"]).args(arguments), &mut tally)?;
    }
    // nextest leaves the examples in the docs to cargo.
    if nextest && arguments.is_empty() {
        libtest_tally(cargo().args(["test", "--doc", "--no-fail-fast"]), &mut tally)?;
    }
    let skipped =
        fs::read_to_string(&skips).map_err(|error| format!("cannot read {}: {error}", skips.display()))?;
    tally.skip(&skipped);
    println!("{} passed, {} failed, {} skipped", tally.passed, tally.failed, tally.skipped);
    let ci = env::var("CI").is_ok_and(|value| !["", "false"].contains(&&*value));
    match (tally.failed, tally.skipped) {
        (1.., _) => Err(format!("{} tests failed", tally.failed)),
        (0, 1..) if ci => Err(format!("{} tests were skipped, and in CI a skip is a failure", tally.skipped)),
        _ => Ok(()),
    }
}

/// How many tests there were of each kind.
#[derive(Debug, Default, PartialEq, Eq)]
struct Tally {
    passed: usize,
    failed: usize,
    skipped: usize,
    /// The failed ones, where the runner names them as skips are named.
    failures: BTreeSet<String>,
}

impl Tally {
    /// Takes those that could not run off those that passed, and lists them. A test that had to leave out a part of what
    /// it does counts as skipped, once.
    fn skip(&mut self, noted: &str) {
        let mut names = BTreeSet::new();
        for line in noted.lines() {
            println!("skipped: {line}");
            let name = line.split(": ").next().unwrap_or(line);
            if !self.failures.contains(name) {
                names.insert(name);
            }
        }
        self.skipped = names.len();
        self.passed = self.passed.saturating_sub(names.len());
    }
}

/// Runs nextest, whose JUnit report has a line for each test.
fn nextest_tally(tests: &mut Command, target: &Path, tally: &mut Tally) -> Result<()> {
    let report = target.join("nextest/default/junit.xml");
    // One of an earlier run is not there any more if it cannot be removed.
    let _ = fs::remove_file(&report);
    let outcome = run(tests);
    let Ok(text) = fs::read_to_string(&report) else {
        // It has not come to running any.
        return outcome.and_then(|()| Err(format!("cannot read {}", report.display())));
    };
    read_junit(&text, tally);
    // A failure without a failed test is nextest's own.
    if tally.failed == 0 { outcome } else { Ok(()) }
}

fn read_junit(text: &str, tally: &mut Tally) {
    for case in text.split("<testcase").skip(1) {
        let attribute = |name: &str| {
            let value = case.split_once(&format!(" {name}=\"")).and_then(|(_, rest)| rest.split_once('"'));
            value.map_or("", |(value, _)| value)
        };
        if case.contains("<failure") || case.contains("<error") {
            tally.failed += 1;
            tally.failures.insert(format!("{} {}", attribute("classname"), attribute("name")));
        } else {
            tally.passed += 1;
        }
    }
}

/// Runs `cargo test`, and adds up what each of its programs says at its end.
fn libtest_tally(tests: &mut Command, tally: &mut Tally) -> Result<()> {
    let said = format!("{tests:?}");
    let cannot = |error| format!("cannot run {said}: {error}");
    let mut process = tests.stdout(Stdio::piped()).spawn().map_err(cannot)?;
    let failed_before = tally.failed;
    if let Some(output) = process.stdout.take() {
        for line in BufReader::new(output).lines().map_while(std::result::Result::ok) {
            println!("{line}");
            read_result(&line, tally);
        }
    }
    let status = process.wait().map_err(cannot)?;
    // What did not compile has no failed test.
    if status.success() || tally.failed > failed_before {
        Ok(())
    } else {
        Err(format!("{said} failed ({status})"))
    }
}

/// Reads `test result: ok. 3 passed; 1 failed; 0 ignored; ...`.
fn read_result(line: &str, tally: &mut Tally) {
    let Some(counts) = line.strip_prefix("test result: ") else { return };
    let words: Vec<&str> = counts.split([' ', ';']).filter(|word| !word.is_empty()).collect();
    for pair in words.windows(2) {
        match (pair[0].parse::<usize>(), pair[1]) {
            (Ok(count), "passed") => tally.passed += count,
            (Ok(count), "failed") => tally.failed += count,
            _ => {}
        }
    }
}

/// The folder that cargo builds into.
pub fn target() -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace().join("target"), PathBuf::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_could_not_run_is_not_counted_as_passed() {
        let report = r#"<testsuites name="nextest-run" tests="4" failures="1" errors="0">
            <testsuite name="bunraku-tests::link"><testcase name="a::one" classname="bunraku-tests::link" time="0.1"/>
            <testcase name="two" classname="bunraku-tests::link"><failure type="test failure">&lt;failure</failure></testcase>
            <testcase name="three" classname="bunraku-tests::link" time="1"><system-out>x</system-out></testcase>
            <testcase name="four" classname="bunraku-tests::link"/></testsuite></testsuites>"#;
        let mut tally = Tally::default();
        read_junit(report, &mut tally);
        assert_eq!((tally.passed, tally.failed), (3, 1));
        // A skip of a test that failed is none, and two of one test are one.
        tally.skip(
            "bunraku-tests::link two: no node\nbunraku-tests::link three: no python\nbunraku-tests::link three: no node\n",
        );
        assert_eq!((tally.passed, tally.failed, tally.skipped), (2, 1, 1));
    }

    #[test]
    fn results_of_all_programs_are_added_up() {
        let mut tally = Tally::default();
        for line in [
            "running 3 tests",
            "test result: ok. 3 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.00s",
            "test result: FAILED. 4 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.00s",
        ] {
            read_result(line, &mut tally);
        }
        assert_eq!((tally.passed, tally.failed), (7, 2));
    }
}

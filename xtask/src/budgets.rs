//! `cargo xtask budgets`: measures all that bench/budgets.toml records, and writes it anew.

use crate::{Result, cargo, run, setup, workspace};
use std::collections::BTreeMap;
use std::fs;
use std::process::Command;

/// The test programs that measure.
const MEASURING: [&str; 5] = ["mclip_cycles", "profile", "wearable", "panic_free", "boards"];

const HEAD: &str = "\
# Cycles and bytes as they were measured: with which compiler, and when. Tests fail where a measurement rises by more than
# 1 % above the recorded one, or rises at all where its name begins with `qmd` (tests/src/budgets.rs).
# `cargo xtask budgets` measures again and writes this file; what it cannot measure here stays as it is.

";

/// Measures, and writes bench/budgets.toml. A line whose value is as it was, by the same compiler, keeps its date.
pub fn budgets() -> Result<()> {
    setup::all().list();
    let measured = crate::test::target().join("measured.txt");
    fs::create_dir_all(crate::test::target()).map_err(|error| format!("cannot make target/: {error}"))?;
    fs::write(&measured, "").map_err(|error| format!("cannot write {}: {error}", measured.display()))?;
    run(cargo().args(["build", "--bins", "--tests"]))?;
    let mut tests = cargo();
    tests.env("BUNRAKU_MEASURED", &measured).arg("test");
    for name in MEASURING {
        tests.args(["--test", name]);
    }
    run(tests.args(["--", "--include-ignored"]))?;

    let read = |path| fs::read_to_string(path).map_err(|error| format!("cannot read {path:?}: {error}"));
    let path = workspace().join("bench/budgets.toml");
    let before = if path.exists() { read(&path)? } else { String::new() };
    let text = rewritten(&before, &read(&measured)?, &compiler()?, &today()?)?;
    fs::write(&path, text).map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    println!("written: {}", path.display());
    Ok(())
}

/// The file with what was measured, each line NAME, a tab and a value.
fn rewritten(before: &str, measured: &str, compiler: &str, date: &str) -> Result<String> {
    let entries = before.lines().filter(|line| line.starts_with('"'));
    let mut lines: BTreeMap<String, String> =
        entries.filter_map(|line| Some((line.split_once(" = {")?.0.to_owned(), line.to_owned()))).collect();
    for line in measured.lines() {
        let (name, value) = line
            .split_once('\t')
            .and_then(|(name, value)| Some((format!("{name:?}"), value.parse::<f64>().ok()?)))
            .ok_or_else(|| format!("found {line:?}, expected a name, a tab and a number"))?;
        let new = format!("{name} = {{ measured = {value:?}, compiler = \"{compiler}\", date = ");
        match lines.get(&name) {
            Some(line) if line.starts_with(&new) => {}
            _ => drop(lines.insert(name, format!("{new}\"{date}\" }}"))),
        }
    }
    Ok(HEAD.to_owned() + &lines.into_values().map(|line| line + "\n").collect::<String>())
}

/// The version of rustc, such as 1.95.0.
fn compiler() -> Result<String> {
    let said = output(Command::new("rustc").arg("--version"))?;
    said.split(' ').nth(1).map(str::to_owned).ok_or_else(|| format!("rustc --version says {said:?}"))
}

/// The day, as YYYY-MM-DD.
fn today() -> Result<String> {
    output(Command::new("date").arg("+%F"))
}

fn output(command: &mut Command) -> Result<String> {
    let output = command
        .current_dir(workspace())
        .output()
        .map_err(|error| format!("cannot start {command:?}: {error}"))?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_measured_again_is_written_and_the_rest_stays() {
        let first = rewritten("", "pcm\t7.5\nqmd\t100\n", "1.95.0", "2026-11-30").unwrap();
        let second = rewritten(&first, "pcm\t7.5\nqmd\t99\n", "1.95.0", "2026-12-01").unwrap();
        let expected = "\"pcm\" = { measured = 7.5, compiler = \"1.95.0\", date = \"2026-11-30\" }\n\
            \"qmd\" = { measured = 99.0, compiler = \"1.95.0\", date = \"2026-12-01\" }\n";
        assert_eq!(second, format!("{HEAD}{expected}"));
        assert_eq!(rewritten(&second, "", "1.95.0", "2026-12-02").unwrap(), second);
        assert!(rewritten("", "pcm 7.5\n", "1.95.0", "2026-11-30").is_err());
    }
}

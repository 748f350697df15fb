//! Budgets: what cycles and bytes were measured, in bench/budgets.toml, and what a measurement may exceed that by.

use crate::workspace;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::PathBuf;

/// Percent that a measurement may be above the recorded one. Measurements whose names begin with `qmd` may not be above it
/// at all.
pub const ALLOWED_PERCENT: f64 = 1.0;

/// A measurement of bench/budgets.toml.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Cycles or bytes.
    pub measured: f64,
    /// The version of the compiler that made the code.
    pub compiler: String,
    /// The day, as YYYY-MM-DD.
    pub date: String,
}

/// The file.
pub fn path() -> PathBuf {
    workspace().join("bench/budgets.toml")
}

/// All recorded measurements, by name.
///
/// # Panics
/// Where the file cannot be read, or has something else in it.
pub fn recorded() -> BTreeMap<String, Recorded> {
    let text =
        std::fs::read_to_string(path()).unwrap_or_else(|error| panic!("{}: {error}", path().display()));
    parse(&text).unwrap_or_else(|error| panic!("{}: {error}", path().display()))
}

fn parse(text: &str) -> Result<BTreeMap<String, Recorded>, String> {
    let table: toml::Table = text.parse().map_err(|error| format!("{error}"))?;
    let entry = |(name, value): (String, toml::Value)| {
        let text = |key: &str| value.get(key).and_then(toml::Value::as_str).map(str::to_owned);
        let measured =
            value.get("measured").and_then(|value| value.as_float().or(value.as_integer().map(|n| n as f64)));
        match (measured, text("compiler"), text("date")) {
            (Some(measured), Some(compiler), Some(date)) => Ok((name, Recorded { measured, compiler, date })),
            _ => Err(format!("found {name:?} = {value}, expected measured, compiler and date")),
        }
    };
    table.into_iter().map(entry).collect()
}

/// Holds measurements (name and value) against the recorded ones. Where `BUNRAKU_MEASURED` names a file, they are appended
/// there instead, for `cargo xtask budgets`.
///
/// # Panics
/// Where a measurement is above what is allowed, or was never recorded; with all that are.
pub fn check(measurements: &[(String, f64)]) {
    for (name, measured) in measurements {
        println!("{name}: {measured}");
    }
    if let Some(path) = std::env::var_os("BUNRAKU_MEASURED") {
        let lines: String = measurements.iter().fold(String::new(), |mut lines, (name, measured)| {
            let _ = writeln!(lines, "{name}\t{measured}");
            lines
        });
        // One write, so that lines of tests that run side by side do not mix.
        let file = OpenOptions::new().create(true).append(true).open(&path);
        file.and_then(|mut file| file.write_all(lines.as_bytes()))
            .unwrap_or_else(|error| panic!("cannot note measurements in {}: {error}", path.display()));
        return;
    }
    let complaints = complaints(measurements, &recorded());
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

fn complaints(measurements: &[(String, f64)], recorded: &BTreeMap<String, Recorded>) -> Vec<String> {
    let complaint = |(name, measured): &(String, f64)| {
        let Some(Recorded { measured: before, compiler, date }) = recorded.get(name) else {
            return Some(format!("{name:?} is not in bench/budgets.toml: run `cargo xtask budgets`"));
        };
        let percent = if name.starts_with("qmd") { 0.0 } else { ALLOWED_PERCENT };
        // The smallest step between two numbers is no increase.
        let most = before * (1.0 + percent / 100.0) + 1e-9 * before;
        (*measured > most || measured.is_nan()).then(|| {
            format!(
                "{name}: measured {measured}, expected at most {percent} % above {before}, measured on {date} with rustc \
                 {compiler}"
            )
        })
    };
    measurements.iter().filter_map(complaint).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(name: &str, measured: f64) -> Vec<(String, f64)> {
        vec![(name.to_owned(), measured)]
    }

    #[test]
    fn only_what_is_above_the_allowed_percent_is_told() {
        let line = |name: &str| {
            format!("{name:?} = {{ measured = 1000.0, compiler = \"1.95.0\", date = \"2026-11-30\" }}\n")
        };
        let recorded = parse(&[line("qmd: mean"), line("pcm: mean")].concat()).unwrap();
        for (name, measured, fits) in [
            ("pcm: mean", 1010.0, true),
            ("pcm: mean", 1010.1, false),
            ("pcm: mean", f64::NAN, false),
            ("qmd: mean", 1000.0, true),
            ("qmd: mean", 1000.1, false),
            ("dpcm: mean", 0.0, false),
        ] {
            let complaints = complaints(&one(name, measured), &recorded);
            assert_eq!(complaints.is_empty(), fits, "{name}, {measured}: {complaints:?}");
        }
        assert!(parse("\"pcm: mean\" = { measured = 3 }").is_err());
    }

    /// Another compiler makes other code, for which the measurements say nothing.
    #[test]
    fn all_were_measured_with_the_compiler_of_this_workspace() {
        let text = std::fs::read_to_string(workspace().join("rust-toolchain.toml")).unwrap();
        let table: toml::Table = text.parse().unwrap();
        let channel = table["toolchain"]["channel"].as_str().unwrap();
        let recorded = recorded();
        assert!(recorded.len() > 50, "{}", recorded.len());
        for (name, Recorded { compiler, .. }) in recorded {
            assert_eq!(compiler, channel, "{name}");
        }
    }
}

//! Compares a report with an earlier one.

use super::report::{Report, Subject};
use anyhow::{Context, Result, bail};
use serde::Deserialize;
use std::path::Path;

/// Rises up to this part of 1 are let pass: where the linker puts a loop moves its cycles by about 1.5 %.
pub const SLACK: f64 = 0.03;

/// The parts of an earlier report, as JSON, that are compared.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Baseline {
    #[serde(flatten)]
    subject: Subject,
    cores: Vec<Core>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Core {
    core: String,
    cycles_mean: f64,
    cycles_max: u64,
}

impl Baseline {
    /// Reads what `bunraku profile --json` has written.
    ///
    /// # Errors
    /// A sentence that names the file.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = crate::files::read(path)?;
        serde_json::from_slice(&bytes)
            .with_context(|| format!("{} is no report of bunraku profile --json", path.display()))
    }

    /// Everything that rose by more than [`SLACK`], a line each.
    ///
    /// # Errors
    /// A sentence where the reports are of different clips or settings, or have no core in common.
    pub fn risen(&self, report: &Report) -> Result<Vec<String>> {
        if self.subject != report.subject {
            bail!(
                "the baseline is of another run: it has {:?}, this one has {:?}",
                self.subject,
                report.subject
            );
        }
        let unit = report.subject.unit();
        let mut risen = Vec::new();
        let mut compared = 0;
        for now in &report.cores {
            let Some(then) = self.cores.iter().find(|then| then.core == now.core) else {
                continue;
            };
            compared += 1;
            for (what, then, now_is) in [
                (format!("a {unit}'s mean"), then.cycles_mean, now.cycles_mean),
                (format!("the worst {unit}"), then.cycles_max as f64, now.cycles_max as f64),
            ] {
                if now_is > then * (1.0 + SLACK) {
                    risen.push(format!(
                        "{}: {what} rose from {then:.1} to {now_is:.1} cycles, by {:.1} %",
                        now.core,
                        (now_is / then - 1.0) * 100.0
                    ));
                }
            }
        }
        if compared == 0 {
            bail!("the baseline has none of the cores that were profiled");
        }
        Ok(risen)
    }
}

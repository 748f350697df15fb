//! `bunraku train`: step multipliers of the adaptive quantiser, from motions.

use super::rd::named;
use anyhow::{Context, Result};
use encoder::codec::adpcm::{Adpcm, StepAdaptation};
use encoder::mclip::Encoder;
use encoder::train::{Score, Search, scores, train};
use host_sim::files;
use host_sim::rd::{Named, resample};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

/// Train the step multipliers of the adaptive quantiser (adpcm --adapt both) on motions.
///
/// For every number of bits, finds the multipliers with the least error of the motions, and tells what they come to on
/// motions that were held out, against steps that do not adapt and against Jayant's multipliers of 1973. An AMC
/// takes the skeleton of its subject from its folder: 02.asf for 02_01.amc.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku train cmu/01_04.amc cmu/14_09.amc --held-out cmu/02_01.amc --fps 30,120 -o encoder/src/codec/adpcm/multipliers.rs"
)]
pub struct Args {
    /// The recordings to train on: .bvh, .amc, .glb, .csv or .json.
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Motions to measure the result on.
    #[arg(long, value_name = "IN", num_args = 1..)]
    held_out: Vec<PathBuf>,
    /// Frames per second at which each motion takes part, separated by commas; its own unless given.
    #[arg(long, value_delimiter = ',', value_parser = super::number::recorded_rate)]
    fps: Vec<f64>,
    /// Fewest and most bits of a code to train for.
    #[arg(long, num_args = 2, value_names = ["FEWEST", "MOST"], default_values = ["2", "6"], value_parser = clap::value_parser!(u8).range(1..=8))]
    bits: Vec<u8>,
    /// Where the tables go, as a Rust file that the encoder has.
    #[arg(short, long, value_name = "OUT.rs")]
    output: Option<PathBuf>,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

/// What tables for a number of bits come to on the motions that were held out.
#[derive(serde::Serialize)]
struct Row {
    bits: u8,
    #[serde(flatten)]
    steps: StepAdaptation,
    /// Steps that do not adapt, Jayant's multipliers with the lowest step that suits them best, and those that were
    /// trained.
    still: Mean,
    jayant: Mean,
    trained: Mean,
}

/// Means over motions: of the error the geometric one.
#[derive(Clone, Copy, serde::Serialize)]
struct Mean {
    rms_cm: f64,
    entropy_bits: f64,
}

impl Mean {
    fn of(scores: &[Score]) -> Self {
        let mean = |of: fn(&Score) -> f64| scores.iter().map(of).sum::<f64>() / scores.len() as f64;
        Self { rms_cm: mean(|score| score.rms_cm.ln()).exp(), entropy_bits: mean(|score| score.entropy_bits) }
    }

    /// Bits of a code that this saves for the same error, a bit halving it: in codes of fixed width, and in codes of
    /// their entropy.
    fn saves(self, against: Self) -> (f64, f64) {
        let error = (against.rms_cm / self.rms_cm).log2();
        (error, error + against.entropy_bits - self.entropy_bits)
    }
}

pub fn run(args: Args) -> Result<ExitCode> {
    let motions = motions(&args.inputs, &args.fps)?;
    let held_out = motions_or(&args.held_out, &args.fps, &motions)?;
    let (training, testing) = (encoders(&motions)?, encoders(&held_out)?);
    let mut rows = Vec::new();
    let (fewest, most) = (args.bits[0].min(args.bits[1]), args.bits[0].max(args.bits[1]));
    if !args.json {
        let of = if args.held_out.is_empty() { "the same motions" } else { "the motions held out" };
        println!("Root mean square displacement of the joints in cm on {of}, and bits that the trained");
        println!(
            "multipliers save against Jayant's for the same error, with fixed-width codes and by entropy:\n"
        );
        println!(
            "bits     still    Jayant   trained   saved fixed, entropy   log2 of multipliers in eighths, lowest"
        );
    }
    for bits in fewest..=most {
        let jayant = train(&training, Adpcm::BOTH, bits, Search::Lowest)?;
        let steps = train(&training, Adpcm::BOTH, bits, Search::All)?;
        let mean = |steps| anyhow::Ok(Mean::of(&scores(&testing, Adpcm::BOTH, bits, steps)?));
        let (still, jayant, trained) = (mean(StepAdaptation::STILL)?, mean(jayant)?, mean(steps)?);
        if !args.json {
            let (fixed, entropy) = trained.saves(jayant);
            println!(
                "{bits:>4} {:>9.4} {:>9.4} {:>9.4}   {fixed:>11.2} {entropy:>8.2}   {:?} {:>6}",
                still.rms_cm, jayant.rms_cm, trained.rms_cm, steps.multipliers, steps.lowest
            );
        }
        rows.push(Row { bits, steps, still, jayant, trained });
    }
    if args.json {
        println!("{:#}", serde_json::json!({ "tables": rows }));
    }
    if let Some(path) = &args.output {
        let text = source(&args, &rows)?;
        files::write(path, |file| Ok(file.write_all(text.as_bytes())?))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The motions, each at each rate.
fn motions(paths: &[PathBuf], fps: &[f64]) -> Result<Vec<Named>> {
    let mut all = Vec::new();
    for path in paths {
        let named = named(path, None)?;
        if fps.is_empty() {
            all.push(named);
        } else {
            for &fps in fps {
                all.push(resample(named.clone(), fps)?);
            }
        }
    }
    Ok(all)
}

fn motions_or(paths: &[PathBuf], fps: &[f64], others: &[Named]) -> Result<Vec<Named>> {
    if paths.is_empty() { Ok(others.to_vec()) } else { motions(paths, fps) }
}

fn encoders(motions: &[Named]) -> Result<Vec<Encoder<'_>>> {
    let ready = motions.iter().map(|Named { name, clip }| {
        Encoder::new(&clip.skeleton, &clip.motion).with_context(|| format!("cannot encode {name}"))
    });
    ready.collect()
}

/// The Rust file, with how it came to be.
fn source(args: &Args, rows: &[Row]) -> Result<String> {
    let names = |paths: &[PathBuf]| {
        let name = |path: &PathBuf| path.file_name().map(|name| name.to_string_lossy().into_owned());
        paths.iter().filter_map(name).collect::<Vec<_>>()
    };
    let rates: Vec<String> = args.fps.iter().map(f64::to_string).collect();
    let mut out = String::new();
    writeln!(
        out,
        "//! Step multipliers of the adaptive quantiser (7-7), trained on motions. Written by a command:"
    )?;
    writeln!(out, "//!")?;
    let mut words = vec!["bunraku train".to_owned()];
    words.extend(names(&args.inputs));
    if !args.held_out.is_empty() {
        words.push("--held-out".to_owned());
        words.extend(names(&args.held_out));
    }
    if !rates.is_empty() {
        words.push(format!("--fps {}", rates.join(",")));
    }
    words.push("-o encoder/src/codec/adpcm/multipliers.rs".to_owned());
    writeln!(out, "//! ```text")?;
    for line in words.chunks(8) {
        writeln!(out, "//! {}", line.join(" "))?;
    }
    writeln!(out, "//! ```")?;
    writeln!(out, "//!")?;
    writeln!(
        out,
        "//! Displacement of the joints (root mean square, in cm) that remained on the motions held out:"
    )?;
    writeln!(out, "//!")?;
    writeln!(out, "//! | bits | steps that stay | Jayant's multipliers | these |")?;
    writeln!(out, "//! |---|---|---|---|")?;
    for Row { bits, still, jayant, trained, .. } in rows {
        let [still, jayant, trained] = [still, jayant, trained].map(|mean| mean.rms_cm);
        writeln!(out, "//! | {bits} | {still:.4} | {jayant:.4} | {trained:.4} |")?;
    }
    let fewest = rows.first().map_or(0, |row| row.bits);
    writeln!(out, "\n/// Bits of the codes that the first table is for; each one after it has a bit more.")?;
    writeln!(out, "pub const FEWEST_BITS: u8 = {fewest};\n")?;
    writeln!(
        out,
        "/// log₂ β in eighths for the eight classes of a code's magnitude, and the index of the lowest step."
    )?;
    writeln!(out, "pub const TRAINED: [([i8; 8], u8); {}] = [", rows.len())?;
    for Row { steps, .. } in rows {
        writeln!(out, "    ({:?}, {}),", steps.multipliers, steps.lowest)?;
    }
    writeln!(out, "];")?;
    Ok(out)
}

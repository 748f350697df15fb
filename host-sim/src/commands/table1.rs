//! `bunraku table1`: the paper's Table 1 for the trials that we have, with both encoders.

use anyhow::{Context, Result, bail};
use encoder::metrics::Evaluator;
use encoder::qmd::{self, Method, Parameters, Source};
use encoder::{Clip, import};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Reproduce Table 1 of the QMD paper on the CMU trials behind it.
///
/// Sizes are in KiB, with FDF = 6, b = 8 and one segment. The paper does not define DEF numerically; ours is the
/// mean distance over all joints and frames in cm after forward kinematics.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku table1 --motion ../shared/motion/cmu\n\nThe folder holds 16_46.amc, 16.asf and so on, from mocap.cs.cmu.edu. The exit code is 1 where a size is not the\npaper's or our encoder's error is above 1/20 of the faithful one's."
)]
pub struct Args {
    /// Folder of the CMU trials.
    #[arg(long, value_name = "FOLDER")]
    motion: PathBuf,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

/// A row of the paper's table, and the trial that has as many frames.
struct Trial {
    name: &'static str,
    subject: &'static str,
    number: &'static str,
    frames: usize,
    paper_def: f64,
    paper_kib: f64,
}

const fn trial(
    name: &'static str,
    subject: &'static str,
    number: &'static str,
    frames: usize,
    paper_def: f64,
    paper_kib: f64,
) -> Trial {
    Trial { name, subject, number, frames, paper_def, paper_kib }
}

const TRIALS: [Trial; 6] = [
    trial("jog", "16", "46", 136, 3.0, 11.9),
    trial("run_Leap", "49", "04", 251, 0.7, 20.9),
    trial("stride", "02", "02", 298, 1.4, 24.6),
    trial("walk", "02", "01", 343, 0.5, 28.1),
    trial("dance", "05", "03", 434, 20.0, 35.2),
    trial("sword play", "02", "07", 2251, 4.0, 177.2),
];

/// Our encoder's error is at most this part of the faithful one's.
const AIM: f64 = 1.0 / 20.0;

#[derive(serde::Serialize)]
struct Row {
    name: &'static str,
    trial: String,
    frames: usize,
    bytes: usize,
    formula_bytes: usize,
    paper_kib: f64,
    paper_def: f64,
    faithful_mean_joint_cm: f64,
    mean_joint_cm: f64,
    ratio: f64,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let rows: Vec<Row> = TRIALS.iter().map(|trial| row(&args.motion, trial)).collect::<Result<_>>()?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&rows)?);
    } else {
        println!(
            "                           |        size        |      DEF, mean cm a joint       |  paper"
        );
        println!("name       trial   frames  |   bytes  KiB paper | faithful       ours        ratio | DEF");
        for row in &rows {
            let kib = row.bytes as f64 / 1024.0;
            println!(
                "{:<10} {:<7} {:>6}  | {:>7} {kib:>6.2} {:>5.1} | {:>8.4} {:>10.5} {:>8.1} to 1 | {}",
                row.name,
                row.trial,
                row.frames,
                row.bytes,
                row.paper_kib,
                row.faithful_mean_joint_cm,
                row.mean_joint_cm,
                row.ratio,
                row.paper_def,
            );
        }
    }
    let size_is_off = |row: &Row| {
        row.bytes != row.formula_bytes || (row.bytes as f64 / 1024.0 - row.paper_kib).abs() > 0.051
    };
    let mut code = ExitCode::SUCCESS;
    for row in &rows {
        if size_is_off(row) {
            eprintln!(
                "bunraku: {} takes {} bytes, not the paper's {} KiB",
                row.trial, row.bytes, row.paper_kib
            );
            code = ExitCode::from(crate::FAILED);
        }
        if row.mean_joint_cm > AIM * row.faithful_mean_joint_cm {
            eprintln!(
                "bunraku: {}: the error is 1/{:.1} of the faithful one's, not 1/20",
                row.trial, row.ratio
            );
            code = ExitCode::from(crate::FAILED);
        }
    }
    Ok(code)
}

fn row(folder: &Path, trial: &Trial) -> Result<Row> {
    let name = format!("{}_{}", trial.subject, trial.number);
    let clip = import::load(
        &folder.join(format!("{name}.amc")),
        Some(&folder.join(format!("{}.asf", trial.subject))),
        None,
    )?;
    let (frames, m) = (clip.motion.frames(), clip.motion.channels);
    if frames != trial.frames {
        bail!("{name}.amc has {frames} frames, expected {} as in the paper's Table 1", trial.frames);
    }
    let (bytes, faithful) = measure(&clip, Method::FAITHFUL).with_context(|| name.clone())?;
    let (ours_bytes, ours) = measure(&clip, Method::ClosedLoop).with_context(|| name.clone())?;
    if bytes != ours_bytes {
        bail!("{name}: the encoders differ in size, {bytes} and {ours_bytes} bytes");
    }
    let fdf = usize::from(Parameters::TABLE_1.fixed_channels);
    Ok(Row {
        name: trial.name,
        trial: name,
        frames,
        bytes,
        formula_bytes: 1037 + 5 * m + frames * (4 * fdf + m - fdf),
        paper_kib: trial.paper_kib,
        paper_def: trial.paper_def,
        faithful_mean_joint_cm: faithful,
        mean_joint_cm: ours,
        ratio: faithful / ours,
    })
}

/// Bytes and mean joint error with the parameters of Table 1.
fn measure(clip: &Clip, method: Method) -> Result<(usize, f64)> {
    let bytes = Source::new(&clip.skeleton, &clip.motion)?.encode(Parameters::TABLE_1, method)?;
    let decoded = qmd::decode(&bytes)?;
    let error = Evaluator::new(&clip.skeleton, &clip.motion)?.mean_joint_cm(&decoded.samples);
    Ok((bytes.len(), error))
}

//! `bunraku table1`: the paper's Table 1 for the trials that we have, with both encoders.

use anyhow::{Context, Result, bail};
use decoder_core::Limits;
use decoder_core::mclip::{Clip as Packed, CodecId};
use encoder::mclip::{Encoded, Encoder, Encoding, Quality};
use encoder::qmd::{self, Method, Parameters};
use encoder::source::Source;
use mocap::metrics::Evaluator;
use mocap::{Clip, import};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Reproduce Table 1 of the QMD paper on the CMU trials behind it.
///
/// Sizes are in KiB, with FDF = 6, b = 8 and one segment. The paper does not define DEF numerically; ours is the
/// mean distance over all joints and frames in cm after forward kinematics.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku table1 --motion cmu\n  bunraku table1 --motion cmu --packed\n\nThe folder holds 16_46.amc, 16.asf and so on, from mocap.cs.cmu.edu. The exit code is 1 where a size is not the\npaper's or our encoder's error is above 1/20 of the faithful one's; with --packed, where a clip takes more than 20 %\nof the paper's bytes to have the faithful encoder's error, or more than 35 % to have 0.45 cm."
)]
pub struct Args {
    /// Folder of the CMU trials.
    #[arg(long, value_name = "FOLDER")]
    motion: PathBuf,
    /// Compare with QMD in packed and prefix-coded indices (.mclip): with the fewest bits an index that have no larger
    /// error than the faithful encoder, and with the fewest that have at most 0.45 cm.
    #[arg(long)]
    packed: bool,
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
    if args.packed {
        return packed(&args);
    }
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
            code = ExitCode::FAILURE;
        }
        if row.mean_joint_cm > AIM * row.faithful_mean_joint_cm {
            eprintln!(
                "bunraku: {}: the error is 1/{:.1} of the faithful one's, not 1/20",
                row.trial, row.ratio
            );
            code = ExitCode::FAILURE;
        }
    }
    Ok(code)
}

/// A trial's name and motion.
fn load(folder: &Path, trial: &Trial) -> Result<(String, Clip)> {
    let name = format!("{}_{}", trial.subject, trial.number);
    let clip = import::load(
        &folder.join(format!("{name}.amc")),
        Some(&folder.join(format!("{}.asf", trial.subject))),
        None,
    )?;
    let frames = clip.motion.frames();
    if frames != trial.frames {
        bail!("{name}.amc has {frames} frames, expected {} as in the paper's Table 1", trial.frames);
    }
    Ok((name, clip))
}

fn row(folder: &Path, trial: &Trial) -> Result<Row> {
    let (name, clip) = load(folder, trial)?;
    let (frames, m) = (clip.motion.frames(), clip.motion.channels);
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

/// The part of the paper's size that packed indices take at most, where their error is no larger than the faithful
/// encoder's.
const PACKED_AIM: f64 = 0.20;

/// The same, where their error is at most [`FINE_CM`].
const FINE_AIM: f64 = 0.35;

/// A mean joint error in cm that is hard to see.
const FINE_CM: f64 = 0.45;

/// A clip with packed indices.
#[derive(serde::Serialize)]
struct Point {
    /// The mean joint error that it had to keep to.
    limit_cm: f64,
    index_bits: u8,
    bytes: usize,
    header_bytes: usize,
    /// Of the paper's size.
    part: f64,
    most_part: f64,
    mean_joint_cm: f64,
}

#[derive(serde::Serialize)]
struct PackedRow {
    name: &'static str,
    trial: String,
    frames: usize,
    paper_bytes: usize,
    faithful_mean_joint_cm: f64,
    packed: Point,
    fine: Point,
}

fn packed(args: &Args) -> Result<ExitCode> {
    let rows: Vec<PackedRow> =
        TRIALS.iter().map(|trial| packed_row(&args.motion, trial)).collect::<Result<_>>()?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&rows)?);
    } else {
        println!(
            "                         paper's QMD |      at its error       |   at {FINE_CM} cm or less"
        );
        println!("name       trial      bytes       cm |  b   bytes     %     cm |  b   bytes     %     cm");
        let point = |point: &Point| {
            format!(
                "{:>2} {:>7} {:>5.1} {:>6.4}",
                point.index_bits,
                point.bytes,
                100.0 * point.part,
                point.mean_joint_cm
            )
        };
        for row in &rows {
            println!(
                "{:<10} {:<7} {:>8} {:>8.4} | {} | {}",
                row.name,
                row.trial,
                row.paper_bytes,
                row.faithful_mean_joint_cm,
                point(&row.packed),
                point(&row.fine),
            );
        }
    }
    let mut code = ExitCode::SUCCESS;
    for (row, point) in rows.iter().flat_map(|row| [(row, &row.packed), (row, &row.fine)]) {
        if point.part > point.most_part {
            eprintln!(
                "bunraku: {} takes {} bytes at {:.4} cm or less, {:.1} % of the paper's {}, expected at most {:.0} %",
                row.trial,
                point.bytes,
                point.limit_cm,
                100.0 * point.part,
                row.paper_bytes,
                100.0 * point.most_part,
            );
            code = ExitCode::FAILURE;
        }
    }
    Ok(code)
}

fn packed_row(folder: &Path, trial: &Trial) -> Result<PackedRow> {
    let (name, clip) = load(folder, trial)?;
    let (paper_bytes, faithful) = measure(&clip, Method::FAITHFUL).with_context(|| name.clone())?;
    let encoder = Encoder::new(&clip.skeleton, &clip.motion).with_context(|| name.clone())?;
    let evaluator = Evaluator::new(&clip.skeleton, &clip.motion)?;
    let encoding = Encoding::new(CodecId::Qmd);
    let mut found = (1..=encoding.most_bits())
        .map(|bits| anyhow::Ok((bits, encoder.measured(&encoding, Quality::Bits(bits), &evaluator)?)));
    let mut tried = Vec::new();
    let mut within = |limit_cm: f64, most_part: f64| -> Result<Point> {
        while tried.iter().all(|(_, encoded): &(u8, Encoded)| encoded.errors.mean_joint_cm > limit_cm) {
            tried.push(
                found
                    .next()
                    .with_context(|| format!("{name}: no number of bits has an error of {limit_cm} cm"))??,
            );
        }
        let smallest = tried
            .iter()
            .filter(|(_, encoded)| encoded.errors.mean_joint_cm <= limit_cm)
            .min_by_key(|(_, encoded)| encoded.bytes.len());
        let (index_bits, encoded) = smallest.context("one was found above")?;
        let bytes = encoded.bytes.len();
        Ok(Point {
            limit_cm,
            index_bits: *index_bits,
            bytes,
            header_bytes: Packed::parse(&encoded.bytes, Limits::MAX)?.header_bytes(),
            part: bytes as f64 / paper_bytes as f64,
            most_part,
            mean_joint_cm: encoded.errors.mean_joint_cm,
        })
    };
    let (packed, fine) = (within(faithful, PACKED_AIM)?, within(FINE_CM, FINE_AIM)?);
    Ok(PackedRow {
        name: trial.name,
        trial: name,
        frames: trial.frames,
        paper_bytes,
        faithful_mean_joint_cm: faithful,
        packed,
        fine,
    })
}

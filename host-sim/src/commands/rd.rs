//! `bunraku rd`: rate against distortion, codec by codec.

use super::codec;
use super::number::{above_zero, recorded_rate};
use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use decoder_core::mclip::{CodecId, EntropyId};
use encoder::mclip::{Encoder, Encoding, Target, decode};
use host_sim::files;
use host_sim::plot::chart::Chart;
use host_sim::rd::curve::Curve;
use host_sim::rd::figure::{self, Figure};
use host_sim::rd::sweep::{self, Point};
use host_sim::rd::{self, Named, trace};
use indicatif::{ProgressBar, ProgressStyle};
use mocap::import;
use mocap::metrics::{self, Evaluator};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// Encode motions over a range of qualities, and show size against error, clip by clip and pooled.
///
/// With --csv, --svg or --png every codec is swept over its bits and its steps; --figure picks a graph of the documents
/// instead; --trace shows one channel over time. Without any of these, each codec is encoded to the mean joint errors of
/// --errors, and pooled ratios are of all samples as float32 to all bytes; codecs whose quality is a number of bits
/// (mulaw, qmd) then come as near as they can. docs/RD.md says more.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bunraku rd cmu/*.amc --codecs dpcm,adpcm --errors 0.1,0.25\n  bunraku rd 02_01.amc --fps 30 --svg rd.svg --csv rd.csv\n  bunraku rd cmu/*.amc --fps 30 --figure 7-8 --png adaptive.png\n  bunraku rd cmu/*.amc --fps 30 --psnr 30\n  bunraku rd 02_01.amc --fps 30 --figure 7-2 --trace lfemur.rx --svg hip.svg"
)]
pub struct Args {
    /// The recordings: .bvh, .amc, .glb, .csv or .json.
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// The skeleton of all AMC; each takes that of its subject from its folder (02.asf for 02_01.amc) unless given.
    #[arg(long, value_name = "S.asf")]
    skeleton: Option<PathBuf>,
    /// Sample the motions at this rate first; they stay as recorded unless given.
    #[arg(long, value_name = "F", value_parser = recorded_rate)]
    fps: Option<f64>,
    /// Take the first frames only, counted after --fps.
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// The codecs, separated by commas; for --errors those whose steps are free (pcm, dpcm, adpcm), dpcm for --trace, all
    /// for a sweep unless given.
    #[arg(long, value_delimiter = ',', value_parser = codec::codec())]
    codecs: Vec<CodecId>,
    /// Entropy stages, separated by commas, each with a curve of its own; the smallest unless given.
    #[arg(long, value_delimiter = ',', value_parser = codec::entropy())]
    entropy: Vec<EntropyId>,
    /// Mean joint errors in cm, separated by commas.
    #[arg(
        long, value_name = "CM", value_delimiter = ',', value_parser = above_zero, default_values = ["0.1", "0.25"],
        conflicts_with_all = ["csv", "svg", "png", "figure", "trace"]
    )]
    errors: Vec<f64>,
    /// Bring the methods of sections 7.2 to 7.6 of the waveform-coding document to this PSNR, and tell their order.
    #[arg(
        long, value_name = "DB", value_parser = above_zero,
        conflicts_with_all = ["codecs", "entropy", "errors", "csv", "svg", "png", "figure", "trace"]
    )]
    psnr: Option<f64>,
    /// A graph of the waveform-coding document (7-…) or of the QMD paper (5, 6).
    #[arg(long, value_enum, conflicts_with = "codecs")]
    figure: Option<FigureName>,
    /// In figures 5 and 6, use the paper's encoder, whose errors add up, instead of ours.
    #[arg(long, requires = "figure")]
    faithful: bool,
    /// Show this channel over time: recorded, decoded, and the error.
    #[arg(long, value_name = "CHANNEL")]
    trace: Option<String>,
    /// Bits of a code in a trace, separated by commas.
    #[arg(
        long, value_name = "BITS", value_delimiter = ',', default_values = ["3", "6"], requires = "trace",
        value_parser = clap::value_parser!(u8).range(1..=16)
    )]
    bits: Vec<u8>,
    /// Write every point as a row; docs/RD.md explains the columns.
    #[arg(long, value_name = "OUT.csv")]
    csv: Option<PathBuf>,
    /// Draw the curves.
    #[arg(long, value_name = "OUT.svg")]
    svg: Option<PathBuf>,
    /// Draw the curves as pixels.
    #[arg(long, value_name = "OUT.png")]
    png: Option<PathBuf>,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FigureName {
    /// Direct quantisation of a channel (with --trace).
    #[value(name = "7-2")]
    Direct,
    /// Direct quantisation: PSNR against rate, motion by motion.
    #[value(name = "7-3")]
    DirectRate,
    /// Predictive coding of a channel (with --trace).
    #[value(name = "7-5")]
    Predictive,
    /// Predictive coding: PSNR against rate.
    #[value(name = "7-6")]
    PredictiveRate,
    /// Adaptive predictive coding of a channel (with --trace).
    #[value(name = "7-7")]
    Adaptive,
    /// Adaptive predictive coding: PSNR against rate.
    #[value(name = "7-8")]
    AdaptiveRate,
    /// QMD: size of the file against FDF, for b from 8 to 11.
    #[value(name = "5")]
    QmdSize,
    /// QMD: error against FDF, for b from 8 to 11.
    #[value(name = "6")]
    QmdError,
}

impl FigureName {
    const fn figure(self) -> Figure {
        match self {
            Self::Direct | Self::DirectRate => Figure::Direct,
            Self::Predictive | Self::PredictiveRate => Figure::Predictive,
            Self::Adaptive | Self::AdaptiveRate => Figure::Adaptive,
            Self::QmdSize => Figure::QmdSize,
            Self::QmdError => Figure::QmdError,
        }
    }

    const fn is_trace(self) -> bool {
        matches!(self, Self::Direct | Self::Predictive | Self::Adaptive)
    }
}

#[derive(serde::Serialize)]
struct Row {
    codec: &'static str,
    target_cm: f64,
    clip: String,
    bytes: u64,
    bits_per_s: f64,
    ratio_f32: f64,
    mean_joint_cm: f64,
    rms_deg: f64,
    psnr_db: Option<f64>,
}

#[derive(serde::Serialize)]
struct Pooled {
    codec: &'static str,
    target_cm: f64,
    clips: usize,
    bytes: u64,
    ratio_f32: f64,
}

pub fn run(args: Args) -> Result<ExitCode> {
    if let Some(figure) = args.figure
        && figure.is_trace() != args.trace.is_some()
    {
        usage(if figure.is_trace() {
            "this figure shows a channel over time: name one with --trace, for instance --trace lfemur.rx"
        } else {
            "this figure is not of one channel: figures 7-2, 7-5 and 7-7 go with --trace"
        });
    }
    let motions = args.inputs.iter().map(|path| load(path, &args)).collect::<Result<Vec<_>>>()?;
    if let Some(db) = args.psnr {
        return super::rd_psnr::run(&motions, db, args.json);
    }
    if let Some(channel) = &args.trace {
        return traced(&args, &motions, channel);
    }
    if args.figure.is_some() || args.csv.is_some() || args.svg.is_some() || args.png.is_some() {
        return swept(&args, &motions);
    }
    targets(&args, &motions)
}

/// Encodes to the errors that were asked for.
fn targets(args: &Args, motions: &[Named]) -> Result<ExitCode> {
    let free = || CodecId::ALL.into_iter().filter(|&codec| Encoding::new(codec).has_free_steps()).collect();
    let codecs: Vec<CodecId> = if args.codecs.is_empty() { free() } else { args.codecs.clone() };
    let (mut rows, mut pooled) = (Vec::new(), Vec::new());
    for codec in codecs {
        let encoding = Encoding::new(codec);
        let codec = codec.name();
        for &target_cm in &args.errors {
            let (mut samples, mut bytes) = (0, 0);
            for Named { name, clip } in motions {
                let evaluator = Evaluator::new(&clip.skeleton, &clip.motion)?;
                let encoder = Encoder::new(&clip.skeleton, &clip.motion).with_context(|| name.clone())?;
                let encoded = encoder.encode_to(&encoding, Target::Error(target_cm), &evaluator)?;
                let size = encoded.bytes.len() as u64;
                let decoded = decode(&encoded.bytes)?;
                let report = metrics::compare(&clip.skeleton, &clip.motion, &decoded, size)?;
                samples += clip.motion.samples.len();
                bytes += size;
                rows.push(Row {
                    codec,
                    target_cm,
                    clip: name.clone(),
                    bytes: size,
                    bits_per_s: encoder.rate(&encoded.bytes),
                    ratio_f32: report.ratio_f32,
                    mean_joint_cm: report.mean_joint_cm,
                    rms_deg: report.rms_deg,
                    psnr_db: report.psnr_db,
                });
            }
            let ratio_f32 = (samples * 4) as f64 / bytes as f64;
            pooled.push(Pooled { codec, target_cm, clips: motions.len(), bytes, ratio_f32 });
        }
    }
    if args.json {
        println!("{:#}", serde_json::json!({ "clips": rows, "pooled": pooled }));
        return Ok(ExitCode::SUCCESS);
    }
    println!("codec  target cm  clip          bytes    bits/s   ratio   mean cm  RMS deg   PSNR dB");
    for row in &rows {
        println!(
            "{:<6} {:>9} {:>9.9} {:>10} {:>9.0} {:>7.2} {:>9.4} {:>8.4} {:>9}",
            row.codec,
            row.target_cm,
            row.clip,
            row.bytes,
            row.bits_per_s,
            row.ratio_f32,
            row.mean_joint_cm,
            row.rms_deg,
            row.psnr_db.map_or("-".to_owned(), |psnr| format!("{psnr:.2}")),
        );
    }
    for row in &pooled {
        println!(
            "{:<6} {:>9} all {:>5} {:>10} {:>17.2}",
            row.codec, row.target_cm, row.clips, row.bytes, row.ratio_f32
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// Sweeps qualities.
fn swept(args: &Args, motions: &[Named]) -> Result<ExitCode> {
    let curves = curves(args, &CodecId::ALL);
    let bar = ProgressBar::new(sweep::len(motions, &curves) as u64);
    bar.set_style(ProgressStyle::with_template("{wide_bar} {pos} of {len} encodes, {eta} left")?);
    bar.enable_steady_tick(Duration::from_millis(200));
    let points = sweep::sweep_all(motions, &curves, &|| bar.inc(1))?;
    bar.finish_and_clear();
    if let Some(path) = &args.csv {
        files::write(path, |file| sweep::write_csv(&points, file))?;
    }
    let what = args.figure.map_or("rate and distortion", |figure| figure.figure().title());
    let title = title(what, motions);
    draw(args, || match args.figure {
        Some(figure) => figure.figure().chart(&title, &points),
        None => figure::overview(&title, &points),
    })?;
    if args.json {
        println!("{:#}", serde_json::json!({ "points": points }));
    } else if matches!(args.figure, Some(FigureName::QmdSize | FigureName::QmdError)) {
        println!("curve                clip       FDF      bytes   mean cm");
        for point in &points {
            let Point { curve, clip, fdf, bytes, mean_joint_cm, .. } = point;
            println!("{curve:<20} {clip:<9} {:>4} {bytes:>10} {mean_joint_cm:>9.5}", fdf.unwrap_or(0));
        }
    } else {
        let rate = |point: &Point| match args.figure {
            Some(figure) => figure.figure().rate(point),
            None => point.bits_per_s,
        };
        println!("kbit/s at a PSNR of    {}", LEVELS.map(|db| format!("{db:>6} dB")).join(" "));
        for line in figure::groups(&points) {
            let points: Vec<(f64, f64)> =
                line.iter().filter_map(|point| Some((rate(point) / 1000.0, point.psnr_db?))).collect();
            let rates = LEVELS.map(f64::from).map(|db| match sweep::rate_at(&points, db) {
                Some(rate) => format!("{rate:>9.2}"),
                // All of it is better, or none of it comes to that.
                None => match points.first().filter(|least| least.1 > db) {
                    Some(least) => format!("{:>9}", format!("<{:.2}", least.0)),
                    None => format!("{:>9}", "-"),
                },
            });
            println!("{:<22} {}  {}", line[0].curve, rates.join(" "), line[0].clip);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// PSNR at which a sweep reports rates.
const LEVELS: [u8; 5] = [20, 25, 30, 35, 40];

/// Shows a channel over time.
fn traced(args: &Args, motions: &[Named], channel: &str) -> Result<ExitCode> {
    let [named] = motions else {
        bail!("found {} motions, expected one for the trace of a channel", motions.len());
    };
    let trace = trace::trace(named, channel, &curves(args, &[CodecId::Dpcm]), &args.bits)?;
    if let Some(path) = &args.csv {
        files::write(path, |file| trace.write_csv(file))?;
    }
    let title = title(channel, motions);
    draw(args, || trace.chart(&title))?;
    let errors: Vec<_> = trace.errors().collect();
    if args.json {
        println!("{:#}", serde_json::json!({ "channel": channel, "unit": trace.unit, "errors": errors }));
        return Ok(ExitCode::SUCCESS);
    }
    println!("{channel} of {}, {}\ncurve                  bits       RMS     worst", named.name, trace.unit);
    for error in &errors {
        println!("{:<22} {:>4} {:>9.4} {:>9.4}", error.curve, error.bits, error.rms, error.worst);
    }
    Ok(ExitCode::SUCCESS)
}

/// The curves that were asked for.
fn curves(args: &Args, otherwise: &[CodecId]) -> Vec<Curve> {
    let codecs = if args.codecs.is_empty() { otherwise } else { &args.codecs };
    let curves: Vec<Curve> = match args.figure {
        Some(figure) => figure.figure().curves(args.faithful),
        None => codecs.iter().flat_map(|codec| Curve::of(*codec)).collect(),
    };
    if args.entropy.is_empty() {
        return curves;
    }
    let with = |curve: Curve| -> Vec<Curve> {
        match curve.has_entropy() {
            true => args.entropy.iter().map(|&entropy| curve.clone().with_entropy(entropy)).collect(),
            false => vec![curve],
        }
    };
    curves.into_iter().flat_map(with).collect()
}

/// A drawing as PNG.
#[cfg(feature = "png")]
fn pixels(svg: &str) -> Result<Vec<u8>> {
    host_sim::plot::png::of_svg(svg)
}

/// A drawing as PNG, which a program without that library does not make.
#[cfg(not(feature = "png"))]
fn pixels(_: &str) -> Result<Vec<u8>> {
    bail!("this bunraku was built without the feature png: build it with that, or write an SVG (--svg)")
}

/// Writes the pictures that were asked for.
fn draw(args: &Args, chart: impl Fn() -> Chart) -> Result<()> {
    if args.svg.is_none() && args.png.is_none() {
        return Ok(());
    }
    let svg = chart().svg()?;
    if let Some(path) = &args.svg {
        files::write(path, |file| Ok(file.write_all(svg.as_bytes())?))?;
    }
    if let Some(path) = &args.png {
        let png = pixels(&svg)?;
        files::write(path, |file| Ok(file.write_all(&png)?))?;
    }
    Ok(())
}

/// What is shown, of which motions, and their rate.
fn title(what: &str, motions: &[Named]) -> String {
    let rate = motions.first().map_or(0.0, |named| named.clip.motion.fps);
    let rate = match motions.iter().all(|named| named.clip.motion.fps == rate) {
        true => format!(" at {rate} fps"),
        false => String::new(),
    };
    match motions {
        [named] => format!("{what}: {}{rate}", named.name),
        _ => format!("{what}: {} motions{rate}", motions.len()),
    }
}

/// Ends the command with what was wrong about its arguments.
fn usage(message: &str) -> ! {
    <Args as clap::Args>::augment_args(clap::Command::new("bunraku rd"))
        .error(clap::error::ErrorKind::ArgumentConflict, message)
        .exit()
}

/// A motion as it is to be encoded.
fn load(path: &Path, args: &Args) -> Result<Named> {
    let mut named = named(path, args.skeleton.as_deref())?;
    if let Some(fps) = args.fps {
        named = rd::resample(named, fps)?;
    }
    if let Some(frames) = args.frames {
        let motion = &mut named.clip.motion;
        motion.samples.truncate(frames as usize * motion.channels);
    }
    Ok(named)
}

/// A motion; an AMC with this skeleton, or with that of its subject.
pub fn named(path: &Path, skeleton: Option<&Path>) -> Result<Named> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    if name.contains('*') && !path.exists() {
        bail!("no file has a name like {}: is the folder there?", path.display());
    }
    let is_amc = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("amc"));
    let of_subject = || path.with_file_name(name.split_once('_').unwrap_or_default().0).with_extension("asf");
    let skeleton = match skeleton {
        Some(skeleton) => Some(skeleton.to_owned()),
        None if is_amc && !name.contains('_') => {
            bail!("{}: expected --skeleton, or a name like 02_01.amc next to 02.asf", path.display())
        }
        None => is_amc.then(of_subject),
    };
    Ok(Named { clip: import::load(path, skeleton.as_deref(), None)?, name })
}

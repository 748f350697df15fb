//! `bunraku rd`: rate against distortion, codec by codec.

use super::encode::{Codec, positive};
use anyhow::{Context, Result, bail};
use encoder::import;
use encoder::mclip::{Encoder, Settings, Target, decode};
use encoder::metrics::{self, Evaluator};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Encode motions with every codec to the same errors, and report size and error, clip by clip and pooled.
///
/// An AMC takes the skeleton of its subject from its folder: 02.asf for 02_01.amc. Each codec has its smallest entropy stage.
/// Pooled ratios are of all samples as float32 to all bytes. Codecs whose quality is a number of bits (mulaw, qmd) come
/// as near to an error as they can.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  bunraku rd cmu/*.amc --codecs dpcm,adpcm --errors 0.1,0.25")]
pub struct Args {
    /// The motions: .amc or .bvh.
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// The codecs, separated by commas.
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["pcm", "dpcm", "adpcm"])]
    codecs: Vec<Codec>,
    /// Mean joint errors in cm, separated by commas.
    #[arg(long, value_name = "CM", value_delimiter = ',', value_parser = positive, default_values = ["0.1", "0.25"])]
    errors: Vec<f64>,
    /// Sample the motions at so many frames per second first.
    #[arg(long, value_parser = positive)]
    fps: Option<f64>,
    /// Bring the document's methods (sections 7.2 to 7.6) to this PSNR instead, and tell their order.
    #[arg(long, value_name = "DB", value_parser = positive, conflicts_with_all = ["codecs", "errors"])]
    psnr: Option<f64>,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
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
    if let Some(db) = args.psnr {
        let motions = args.inputs.iter().map(|path| {
            let (name, clip) = load(path)?;
            let named = host_sim::rd::Named { name, clip };
            args.fps.map_or(Ok(named.clone()), |fps| host_sim::rd::resample(named, fps))
        });
        return super::rd_psnr::run(&motions.collect::<Result<Vec<_>>>()?, db, args.json);
    }
    let clips = args.inputs.iter().map(|path| load(path)).collect::<Result<Vec<_>>>()?;
    let (mut rows, mut pooled) = (Vec::new(), Vec::new());
    for codec in &args.codecs {
        let settings = Settings::new(codec.id());
        let codec = codec.id().name();
        for &target_cm in &args.errors {
            let (mut samples, mut bytes) = (0, 0);
            for (name, clip) in &clips {
                let evaluator = Evaluator::new(&clip.skeleton, &clip.motion)?;
                let encoder = Encoder::new(&clip.skeleton, &clip.motion).with_context(|| name.clone())?;
                let encoded = encoder.encode_to(&settings, Target::Error(target_cm), &evaluator);
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
            pooled.push(Pooled { codec, target_cm, clips: clips.len(), bytes, ratio_f32 });
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

/// A motion and its name; an AMC with the skeleton of its subject.
pub fn load(path: &Path) -> Result<(String, encoder::Clip)> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let is_amc = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("amc"));
    let skeleton = match name.split_once('_') {
        Some((subject, _)) if is_amc => Some(path.with_file_name(subject).with_extension("asf")),
        None if is_amc => bail!("{}: expected a name like 02_01.amc, next to 02.asf", path.display()),
        _ => None,
    };
    Ok((name, import::load(path, skeleton.as_deref(), None)?))
}

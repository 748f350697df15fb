//! `bunraku encode`: motion capture in, a compressed clip out.

use super::input::{self, Quality};
use anyhow::{Context, Result};
use clap::ValueEnum;
use encoder::qmd::{self, Parameters};
use host_sim::files;
use std::path::PathBuf;
use std::process::ExitCode;

/// Encode motion capture (AMC with its ASF, or BVH) into a clip.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  bunraku encode 02_01.amc --skeleton 02.asf --codec qmd -o walk.qmd")]
pub struct Args {
    /// The motion: .amc or .bvh.
    input: PathBuf,
    #[command(flatten)]
    source: input::Source,
    /// The codec.
    #[arg(long, value_enum, default_value_t = Codec::Qmd)]
    codec: Codec,
    #[command(flatten)]
    quality: Quality,
    /// Frames of a segment, each with a table of its own (QMD n_d); the whole clip unless given.
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(1..))]
    segment: Option<u32>,
    /// Where the clip goes.
    #[arg(short, long, value_name = "OUT.qmd")]
    output: PathBuf,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Codec {
    /// Look-up tables of differences between frames.
    Qmd,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let Codec::Qmd = args.codec;
    let clip = args.source.load(&args.input)?;
    let parameters = Parameters {
        index_bits: args.quality.bits,
        fixed_channels: args.quality.fixed_channels(clip.motion.channels),
        segment_frames: args.segment.unwrap_or(u32::MAX),
    };
    let bytes = qmd::encode(&clip, parameters, args.quality.method())
        .with_context(|| format!("cannot encode {}", args.input.display()))?;
    files::write(&args.output, |file| Ok(file.write_all(&bytes)?))?;
    let (frames, channels) = (clip.motion.frames(), clip.motion.channels);
    let ratio = (frames * channels * 4) as f64 / bytes.len() as f64;
    if args.json {
        let report = serde_json::json!({
            "output": args.output, "frames": frames, "channels": channels, "fps": clip.motion.fps,
            "bytes": bytes.len(), "ratio_f32": ratio,
        });
        println!("{report:#}");
    } else {
        println!(
            "{}: {frames} frames of {channels} channels at {} fps in {} bytes, {ratio:.2} times smaller than float32",
            args.output.display(),
            clip.motion.fps,
            bytes.len(),
        );
    }
    Ok(ExitCode::SUCCESS)
}

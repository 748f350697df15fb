//! `bunraku decode`: a compressed clip in, motion capture out.

use super::input;
use anyhow::{Context, Result, bail};
use encoder::{export, import};
use host_sim::files;
use std::path::PathBuf;
use std::process::ExitCode;

/// Decode a clip into AMC, BVH or CSV.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  bunraku decode walk.qmd --skeleton 02.asf -o walk.amc")]
pub struct Args {
    /// The clip: .qmd.
    clip: PathBuf,
    /// The skeleton that the clip was encoded with: .asf, or .bvh for its hierarchy.
    #[arg(long, value_name = "S.asf|S.bvh")]
    skeleton: PathBuf,
    /// Frames per second, where the clip does not say.
    #[arg(long, value_name = "F")]
    fps: Option<f64>,
    /// Where the motion goes; its extension says the format.
    #[arg(short, long, value_name = "OUT.amc|.bvh|.csv")]
    output: PathBuf,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let format = export::Format::of(&args.output)
        .with_context(|| format!("{}: expected a name in .amc, .bvh or .csv", args.output.display()))?;
    let skeleton = import::skeleton(&args.skeleton)?;
    let bytes = files::read(&args.clip)?;
    let mut motion =
        encoder::qmd::decode(&bytes).with_context(|| format!("{} is not a QMD clip", args.clip.display()))?;
    let (found, expected) = (motion.channels, skeleton.channels.len());
    if found != expected {
        bail!(
            "{} has {found} channels, but {} has {expected}",
            args.clip.display(),
            args.skeleton.display()
        );
    }
    if let Some(fps) = args.fps {
        motion.fps = fps;
    } else if motion.fps == 0.0 {
        motion.fps = import::DEFAULT_FPS;
    }
    let frames = motion.frames();
    motion.wrap_angles(&skeleton);
    files::write(&args.output, |file| Ok(export::write(file, format, &skeleton, &motion)?))?;
    println!("{}: {frames} frames of {found} channels", args.output.display());
    Ok(ExitCode::SUCCESS)
}

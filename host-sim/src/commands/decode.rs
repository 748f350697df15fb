//! `bunraku decode`: a compressed clip in, motion capture out.

use anyhow::{Context, Result, bail};
use host_sim::files;
use host_sim::puppet::channels;
use mocap::export;
use mocap::import::{self, amc};
use std::path::PathBuf;
use std::process::ExitCode;

/// Decode a clip into AMC, BVH, CSV, or JSON as the Blender Servo Animation add-on writes it.
///
/// A clip that was made for a puppet has only some of the skeleton's channels; the others become 0.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  bunraku decode walk.qmd --skeleton 02.asf -o walk.amc")]
pub struct Args {
    /// The clip: .qmd or .mclip.
    clip: PathBuf,
    /// The skeleton that the clip was encoded with: .asf, or .bvh for its hierarchy.
    #[arg(long, value_name = "S.asf|S.bvh")]
    skeleton: PathBuf,
    /// Unit of the lengths in a BVH skeleton, as for `bunraku encode`; guessed unless given.
    #[arg(long, value_name = "UNIT")]
    unit: Option<import::Unit>,
    /// Frames per second, where the clip does not say.
    #[arg(long, value_name = "F")]
    fps: Option<f64>,
    /// Where the motion goes; its extension says the format.
    #[arg(short, long, value_name = "OUT.amc|.bvh|.csv|.json")]
    output: PathBuf,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let extension = args.output.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if !["amc", "bvh", "csv", "json"].contains(&extension.as_str()) {
        let output = args.output.display();
        bail!("{output}: found the extension {extension:?}, expected amc, bvh, csv or json");
    }
    let skeleton = import::read_skeleton(&args.skeleton, args.unit)?;
    let bytes = files::read(&args.clip)?;
    let mut motion = super::input::decode(&args.clip, &bytes)?;
    let found = motion.channels;
    motion = channels::on_skeleton(&args.clip, &bytes, &motion, &skeleton)?;
    if let Some(fps) = args.fps {
        motion.fps = fps;
    } else if motion.fps == 0.0 {
        motion.fps = amc::DEFAULT_FPS;
    }
    let frames = motion.frames();
    files::write(&args.output, |mut file| {
        match extension.as_str() {
            "amc" => export::amc::write(&mut file, &skeleton, &motion, export::amc::Rotations::Wrapped),
            "bvh" => {
                motion.wrap_angles(&skeleton);
                export::bvh::write(&mut file, &skeleton, &motion)
            }
            "json" => export::servo_json::write(&mut file, &skeleton, &motion),
            _ => export::csv::write(&mut file, &skeleton, &motion),
        }
        .with_context(|| format!("cannot write {}", args.output.display()))
    })?;
    println!("{}: {frames} frames of {found} channels", args.output.display());
    Ok(ExitCode::SUCCESS)
}

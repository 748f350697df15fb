//! `bunraku info`: what a clip's bytes say.

use anyhow::{Context, Result};
use decoder_core::Limits;
use decoder_core::qmd::Clip;
use host_sim::files;
use std::path::PathBuf;
use std::process::ExitCode;

/// Print what a clip holds, and the memory that a decoder needs for it.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  bunraku info walk.qmd --json")]
pub struct Args {
    /// The clip: .qmd.
    clip: PathBuf,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let bytes = files::read(&args.clip)?;
    let clip = Clip::parse(&bytes, Limits::MAX)
        .with_context(|| format!("{} is not a QMD clip", args.clip.display()))?;
    let layout = clip.layout();
    let fps = (layout.rate_centihertz > 0).then(|| f64::from(layout.rate_centihertz) / 100.0);
    let highest = clip.levels().iter().max().copied().unwrap_or(0);
    let pose_bytes = clip.channels() * 4;
    let table_bytes = layout.table_bytes();
    if args.json {
        let report = serde_json::json!({
            "codec": "qmd", "bytes": bytes.len(), "frames": clip.frames(), "channels": clip.channels(),
            "fps": fps, "fdf": layout.fixed_channels, "index_bits": layout.index_bits,
            "segments": clip.segments(), "row_bytes": layout.row_bytes(), "levels": clip.levels(),
            "pose_bytes": pose_bytes, "table_bytes": table_bytes,
        });
        println!("{report:#}");
        return Ok(ExitCode::SUCCESS);
    }
    println!("{}: QMD, {} bytes", args.clip.display(), bytes.len());
    match fps {
        Some(fps) => {
            println!("  {} frames at {fps} fps, {:.2} s", clip.frames(), f64::from(clip.frames()) / fps);
        }
        None => println!("  {} frames, rate not recorded", clip.frames()),
    }
    println!(
        "  {} channels, of which {} fixed (FDF); levels 1 to {highest}",
        clip.channels(),
        layout.fixed_channels
    );
    println!("  {} bits an index (b), {} bytes a frame", layout.index_bits, layout.row_bytes());
    println!("  {} segments, each with a table of {} entries", clip.segments(), clip.table_len());
    println!(
        "  a decoder needs {pose_bytes} bytes for the pose, and is faster with {table_bytes} more for the table"
    );
    Ok(ExitCode::SUCCESS)
}

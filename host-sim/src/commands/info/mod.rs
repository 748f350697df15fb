//! `bunraku info`: what a file holds, be it a recording, a skeleton, a puppet or a compressed clip.

mod clip;
mod motion;
mod puppet;

use super::input::{Source, is_clip};
use anyhow::Result;
use mocap::import;
use std::path::PathBuf;
use std::process::ExitCode;

/// Print what a file holds: a recording, a skeleton (.asf), a puppet (.toml) or a clip (.qmd, .mclip).
///
/// Of a recording: each channel's range, greatest speed, whole turns and jumps by a turn, the joints whose three angles
/// flip, how tall the figure is, and whether frame 0 is a T-pose that was put in front. Of a clip: its size, and the
/// memory that a decoder needs for it.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bunraku info walk.bvh\n  bunraku info 02_01.amc --skeleton 02.asf\n  bunraku info walk.qmd --json"
)]
pub struct Args {
    /// The recording, skeleton, puppet or clip.
    file: PathBuf,
    #[command(flatten)]
    source: Source,
    /// List the channels of a .mclip, and of a recording also those that stand still.
    #[arg(long)]
    channels: bool,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let Args { file, source, channels, json } = args;
    let is = |extension: &str| file.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension));
    if is_clip(&file) {
        clip::print(&file, channels, json)?;
    } else if is("toml") {
        puppet::print(&file, json)?;
    } else if is("asf") {
        motion::print_skeleton(&file, &import::load_skeleton(&file)?, json);
    } else {
        motion::print(&file, &source.load(&file)?, channels, json);
    }
    Ok(ExitCode::SUCCESS)
}

//! `bunraku puppet`: checks a puppet.toml, finds its servos on a port, and measures its joints.

mod calibrate;
mod check;
mod scan;

use anyhow::{Result, anyhow};
use encoder::skeleton::Skeleton;
use host_sim::puppet::Puppet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Check a puppet.toml, find its servos on real ports, and measure its joints by hand.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku puppet check puppets/cmu-12.toml --clip walk.mclip\n  bunraku puppet scan --puppet puppets/cmu-12.toml --on /dev/ttyUSB0"
)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    Check(check::Args),
    Scan(scan::Args),
    Calibrate(calibrate::Args),
}

pub fn run(args: Args) -> Result<ExitCode> {
    match args.command {
        Command::Check(args) => check::run(args),
        Command::Scan(args) => scan::run(args),
        Command::Calibrate(args) => calibrate::run(args),
    }
}

/// The skeleton in `given`, or the one that the puppet names.
pub fn skeleton(puppet: &Puppet, path: &Path, given: Option<PathBuf>) -> Result<Skeleton> {
    let skeleton = given.or_else(|| puppet.skeleton()).ok_or_else(|| {
        anyhow!("{} names no skeleton, expected the key \"skeleton\" or --skeleton", path.display())
    })?;
    Ok(encoder::import::load_skeleton(&skeleton)?)
}

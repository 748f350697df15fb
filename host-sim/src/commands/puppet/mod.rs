//! `bunraku puppet`: writes a first puppet.toml, checks one, finds its servos on a port, and measures its joints.

mod calibrate;
mod check;
mod new;
mod scan;

use anyhow::Result;
use std::process::ExitCode;

/// Write a first puppet.toml, check one, find its servos on real ports, and measure its joints by hand.
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
    New(new::Args),
    Check(check::Args),
    Scan(scan::Args),
    Calibrate(calibrate::Args),
}

pub fn run(args: Args) -> Result<ExitCode> {
    match args.command {
        Command::New(args) => new::run(args),
        Command::Check(args) => check::run(args),
        Command::Scan(args) => scan::run(args),
        Command::Calibrate(args) => calibrate::run(args),
    }
}

//! `bunraku puppet`: writes a first puppet.toml, checks one, finds its servos on a port, gives them ids, moves and measures its
//! joints.

mod calibrate;
mod check;
mod jog;
mod new;
mod on_port;
mod scan;
mod set_id;

pub use scan::kind as kind_that_reads;

use anyhow::Result;
use std::process::ExitCode;

/// Write a first puppet.toml, check one, find its servos on real ports, give them ids, and move and measure its joints.
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
    Jog(jog::Args),
    SetId(set_id::Args),
}

pub fn run(args: Args) -> Result<ExitCode> {
    match args.command {
        Command::New(args) => new::run(args),
        Command::Check(args) => check::run(args),
        Command::Scan(args) => scan::run(args),
        Command::Calibrate(args) => calibrate::run(args),
        Command::Jog(args) => jog::run(args),
        Command::SetId(args) => set_id::run(args),
    }
}

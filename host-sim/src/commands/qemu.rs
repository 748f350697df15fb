//! `bunraku qemu`: run an image.

use anyhow::Result;
use host_sim::{board, qemu};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Run an image for a QEMU board and print its log: what `cargo run` in a board's folder does.
///
/// The image ends itself by semihosting; an exit code other than 0 is a failure. Nothing is connected to its UART.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku qemu --machine mps2-an386 target/thumbv7em-none-eabi/debug/qemu-mps2"
)]
pub struct Args {
    /// The image: an ELF file.
    image: PathBuf,
    /// QEMU's name of the board.
    #[arg(long, default_value = board::MACHINE)]
    machine: String,
    /// Give up after so many seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    timeout: u64,
    /// Argument for the image's semihosting command line; may be repeated.
    #[arg(long = "arg", value_name = "ARGUMENT")]
    arguments: Vec<String>,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let arguments: Vec<&str> = args.arguments.iter().map(String::as_str).collect();
    let image = qemu::Image { path: &args.image, machine: &args.machine, arguments: &arguments };
    qemu::run(&image, None, Duration::from_secs(args.timeout), &mut |line| println!("{line}"))?;
    Ok(ExitCode::SUCCESS)
}

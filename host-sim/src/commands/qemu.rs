//! `bunraku qemu`: run an image.

use anyhow::Result;
use host_sim::{board, qemu};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::virtual_bus::VirtualBus;

/// Run an image for a QEMU board and print its log: what `cargo run` in a board's folder does.
///
/// The image ends itself by semihosting; an exit code other than 0 is a failure. Virtual Dynamixel X servos can be connected to
/// its UART.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku qemu --machine mps2-an386 target/thumbv7em-none-eabi/debug/qemu-mps2"
)]
pub struct Args {
    /// The image: an ELF file.
    image: PathBuf,
    /// QEMU's name of the board.
    #[arg(long, default_value = board::QEMU_MACHINE)]
    machine: String,
    /// Give up after so many seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    timeout: u64,
    /// Connect virtual servos to the UART, with ids from 1 on.
    #[arg(long, value_name = "COUNT", default_value_t = 0, value_parser = clap::value_parser!(u8).range(..=252))]
    servos: u8,
    /// Argument for the image's semihosting command line; may be repeated.
    #[arg(long = "arg", value_name = "ARGUMENT")]
    arguments: Vec<String>,
}

/// What passes for the servos at most from one piece of a packet to the next.
const LONGEST_GAP: Duration = Duration::from_millis(20);

pub fn run(args: Args) -> Result<ExitCode> {
    let arguments: Vec<&str> = args.arguments.iter().map(String::as_str).collect();
    let image = qemu::Image { path: &args.image, machine: &args.machine, arguments: &arguments };
    let ids: Vec<u8> = (1..=args.servos).collect();
    // QEMU gives packets in parts, whenever it comes to it.
    let mut servos =
        DynamixelServos::new(&DynamixelConfig { byte_gap_us: 1_000_000, ..DynamixelConfig::with_ids(&ids) })?;
    let (mut last, mut now) = (Instant::now(), Duration::ZERO);
    let mut device = |bytes: &[u8]| {
        // A host that had other things to do must not set off the servos' watchdogs.
        now += last.elapsed().min(LONGEST_GAP);
        last = Instant::now();
        servos.receive(bytes, u64::try_from(now.as_micros()).unwrap_or(u64::MAX), &mut |_| {})
    };
    let device: Option<&mut qemu::Device<'_>> = if ids.is_empty() { None } else { Some(&mut device) };
    qemu::run_image(&image, device, Duration::from_secs(args.timeout), &mut |line| println!("{line}"))?;
    Ok(ExitCode::SUCCESS)
}

//! `bunraku play`: a clip on a puppet of virtual servos.

use anyhow::{Context, Result, anyhow, bail};
use clap::ValueEnum;
use host_sim::board;
use host_sim::clip::Clip;
use host_sim::files;
use host_sim::play::{self, Recording, seconds};
use host_sim::puppet::{Map, Puppet};
use host_sim::rp2040js;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Play a clip on the virtual servos of a puppet, and log every goal position that they are told.
///
/// On the host, the firmware's player runs in this program; on qemu and sim, it runs on a Cortex-M4 board, and on rp2040 on a
/// Raspberry Pi Pico, whose image is built for the clip and the puppet. All logs are the same. sim and rp2040 count cycles, so they
/// say how long the core was awake.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku play walk.qmd --puppet puppets/cmu-12.toml --skeleton 02.asf --on qemu --log walk.csv"
)]
pub struct Args {
    /// The clip: .qmd or .mclip.
    clip: PathBuf,
    /// The puppet: which servo follows which channel.
    #[arg(long, value_name = "PUPPET.toml")]
    puppet: PathBuf,
    /// Where the player runs.
    #[arg(long, value_enum, default_value_t = On::Host)]
    on: On,
    /// The skeleton whose channels the clip has (.asf, .bvh), instead of the one that the puppet names.
    #[arg(long, value_name = "S.asf")]
    skeleton: Option<PathBuf>,
    /// Where the log goes: time in seconds, servo id, goal position (4096 a turn).
    #[arg(long, value_name = "OUT.csv")]
    log: Option<PathBuf>,
    /// Frames per second to play at, instead of the clip's own rate.
    #[arg(long, value_name = "F")]
    fps: Option<f64>,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
enum On {
    /// In this program.
    Host,
    /// On QEMU's mps2-an386, a Cortex-M4.
    Qemu,
    /// On the simulated Cortex-M4, which counts cycles.
    Sim,
    /// On a Raspberry Pi Pico in the emulator rp2040js, which counts cycles too.
    Rp2040,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let bytes = files::read(&args.clip)?;
    let name = args.clip.display();
    let clip = Clip::parse(&args.clip, &bytes)?;
    let centihertz = rate(&args.clip, &clip, args.fps)?;
    let map = map(&args.clip, &clip, &args.puppet, args.skeleton)?;

    let log = &mut |line: &str| eprintln!("{line}");
    let played = match args.on {
        On::Host => play::on_host(&clip, &map, centihertz).map(|recording| (recording, None)),
        On::Qemu => play::on_qemu(&clip, &bytes, &map, centihertz, log).map(|recording| (recording, None)),
        On::Sim => play::on_sim(&clip, &bytes, &map, centihertz, log).map(|(recording, usage)| {
            (recording, Some(Spent::of(usage.cycles, usage.asleep, board::QEMU_CLOCK_HZ)))
        }),
        On::Rp2040 => play::on_rp2040(&clip, &bytes, &map, centihertz, log).map(|(recording, figures)| {
            eprintln!(
                "the bus changed its direction at most {:.1} µs after a packet",
                figures.turnaround_nanos as f64 / 1e3
            );
            let cycles = (u128::from(figures.nanos) * u128::from(rp2040js::CLOCK_HZ) / 1_000_000_000) as u64;
            let asleep = cycles.saturating_sub(figures.cycles);
            (recording, Some(Spent::of(cycles, asleep, rp2040js::CLOCK_HZ)))
        }),
    };
    let (recording, spent) = played.with_context(|| format!("cannot play {name}"))?;
    if let Some(log) = &args.log {
        write_log(log, &recording)?;
    }
    let servos = map.joints().len();
    let duration = map.tick_micros(recording.ticks);
    if args.json {
        let report = serde_json::json!({
            "on": args.on, "ticks": recording.ticks, "servos": servos, "servo_hz": map.tick_hz(),
            "seconds": duration as f64 / 1e6, "goals": recording.goals.len(), "log": args.log,
            "cycles": spent.map(|spent| spent.cycles), "cycles_asleep": spent.map(|spent| spent.asleep),
            "awake": spent.map(|spent| spent.awake),
        });
        println!("{report:#}");
    } else {
        println!(
            "{name}: {} ticks at {} Hz on {servos} servos, {} s",
            recording.ticks,
            map.tick_hz(),
            seconds(duration)
        );
        if let Some(spent) = spent {
            println!(
                "  {} cycles at {} MHz, of which {} awake: {:.3} %, {:.0} cycles a tick",
                spent.cycles,
                spent.clock_hz / 1_000_000,
                spent.cycles - spent.asleep,
                100.0 * spent.awake,
                (spent.cycles - spent.asleep) as f64 / f64::from(recording.ticks.max(1)),
            );
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// How a core's cycles were spent.
#[derive(Clone, Copy)]
struct Spent {
    cycles: u64,
    asleep: u64,
    clock_hz: u32,
    /// The part in which it was not asleep.
    awake: f64,
}

impl Spent {
    fn of(cycles: u64, asleep: u64, clock_hz: u32) -> Self {
        Self { cycles, asleep, clock_hz, awake: 1.0 - asleep as f64 / cycles as f64 }
    }
}

/// The rate to play at in hundredths of a hertz, or 0 for the clip's own.
pub fn rate(path: &Path, clip: &Clip<'_>, fps: Option<f64>) -> Result<u16> {
    let centihertz = fps.map_or(Ok(0), centihertz)?;
    if centihertz == 0 && clip.rate_centihertz() == 0 {
        bail!("{} does not say its frame rate: give one with --fps", path.display());
    }
    Ok(centihertz)
}

/// The joint map of a puppet for the clip at `path`.
pub fn map(path: &Path, clip: &Clip<'_>, puppet: &Path, skeleton: Option<PathBuf>) -> Result<Map> {
    let file = Puppet::read(puppet)?;
    let skeleton = skeleton.or_else(|| file.skeleton()).ok_or_else(|| {
        anyhow!("{} names no skeleton, expected the key \"skeleton\" or --skeleton", puppet.display())
    })?;
    let skeleton = encoder::import::load_skeleton(&skeleton)?;
    let (found, expected) = (clip.channels(), skeleton.channels.len());
    if found != expected {
        bail!("{} has {found} channels, expected {expected} as in the skeleton", path.display());
    }
    file.map(&skeleton)
}

fn centihertz(fps: f64) -> Result<u16> {
    let rate = (fps * 100.0).round();
    if !(1.0..=f64::from(u16::MAX)).contains(&rate) {
        bail!("--fps is {fps}, expected 0.01 to 655.35");
    }
    Ok(rate as u16)
}

/// Writes what the servos were told, a line for every goal.
pub fn write_log(path: &Path, recording: &Recording) -> Result<()> {
    files::write(path, |file| Ok(recording.write_csv(file)?))
}

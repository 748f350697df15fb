//! `bunraku play`: a clip on a puppet of virtual or real servos.

use super::joints;
use anyhow::{Context, Result, bail};
use host_sim::board;
use host_sim::clip::Clip;
use host_sim::files;
use host_sim::play::{self, Recording, seconds};
use host_sim::ports;
use host_sim::puppet::channels;
use host_sim::rp2040js;
use puppet_file::{Map, Puppet};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Play a clip on the servos of a puppet, virtual or real, and log every goal position that they are told.
///
/// On the host, the firmware's player runs in this program; on qemu and sim, it runs on a Cortex-M4 board, and on rp2040 on a
/// Raspberry Pi Pico, whose image is built for the clip and the puppet. All logs are the same. sim and rp2040 count cycles, so they
/// say how long the core was awake. On a port the same player drives real servos in real time; Ctrl-C stops it smoothly and brings
/// the puppet home.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku play walk.qmd --puppet puppets/cmu-12.toml --skeleton 02.asf --on qemu --log walk.csv\n  \
        bunraku play walk.qmd --puppet puppets/cmu-12.toml --skeleton 02.asf --on /dev/ttyUSB0"
)]
pub struct Args {
    /// The clip: .qmd or .mclip.
    clip: PathBuf,
    /// The puppet: which servo follows which channel.
    #[arg(long, value_name = "PUPPET.toml")]
    puppet: PathBuf,
    /// Where the player runs: host (this program), qemu (its mps2-an386, a Cortex-M4), sim (the simulated Cortex-M4, which
    /// counts cycles), rp2040 (a Raspberry Pi Pico in the emulator rp2040js, which counts them too), or the serial port of
    /// real servos (NAME=PORT,NAME=PORT for a puppet with several buses).
    #[arg(long, value_name = "host|qemu|sim|rp2040|PORT", default_value = "host")]
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

#[derive(Clone, serde::Serialize)]
#[serde(rename_all = "lowercase")]
enum On {
    Host,
    Qemu,
    Sim,
    Rp2040,
    Port(String),
}

impl From<&str> for On {
    fn from(text: &str) -> Self {
        match text {
            "host" => Self::Host,
            "qemu" => Self::Qemu,
            "sim" => Self::Sim,
            "rp2040" => Self::Rp2040,
            port => Self::Port(port.to_owned()),
        }
    }
}

pub fn run(args: Args) -> Result<ExitCode> {
    let bytes = files::read(&args.clip)?;
    let name = args.clip.display();
    let clip = Clip::parse(&args.clip, &bytes)?;
    let centihertz = rate(&args.clip, &clip, args.fps)?;
    let puppet = Puppet::read(&args.puppet)?;
    let channels = channels::of_played(&args.clip, &clip, &puppet, args.skeleton)?;
    let map = puppet.map(channels.clone())?;

    let rate = if centihertz > 0 { centihertz } else { clip.rate_centihertz() };
    let log = &mut |line: &str| eprintln!("{line}");
    let mut live = None;
    let played = match &args.on {
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
        On::Port(port) => {
            let buses = ports::open(&map, &ports::paths(port, &puppet.bus_names(), |_| true)?)?;
            let asked = asked_to_end()?;
            clip.decode(|frames| {
                ports::play(frames, &map, rate, buses, &ports::ComputerClock::start(), asked, log)
            })
            .map(|played| {
                let recording = played.recording.clone();
                live = Some(played);
                (recording, None)
            })
        }
    };
    let joints = joints::Table::of_clip(&args.clip, &clip, rate, &puppet, &map, &channels)?;
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
            "late_ticks": live.as_ref().map(|live| live.late),
            "longest_bus_ms": live.as_ref().map(|live| live.longest.as_secs_f64() * 1e3),
            "state": live.as_ref().map(|live| format!("{:?}", live.state)),
            "joints": joints,
        });
        println!("{report:#}");
    } else {
        println!(
            "{name}: {} ticks at {} Hz on {servos} servos, {} s",
            recording.ticks,
            map.tick_hz(),
            seconds(duration)
        );
        if let Some(live) = live {
            println!(
                "  the buses took {:.2} ms of a tick at most, {} ticks began late; the puppet ends {:?}",
                live.longest.as_secs_f64() * 1e3,
                live.late,
                live.state
            );
        }
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
        println!("The whole clip, as the player tells the servos:");
        joints.print();
    }
    Ok(ExitCode::SUCCESS)
}

/// Counts how often Ctrl-C was pressed, or somebody asked this program to end by a signal.
pub fn asked_to_end() -> Result<&'static AtomicUsize> {
    static ASKED: AtomicUsize = AtomicUsize::new(0);
    let note = || {
        ASKED.fetch_add(1, Ordering::Relaxed);
    };
    ctrlc::set_handler(note).context("cannot take Ctrl-C")?;
    Ok(&ASKED)
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
    let puppet = Puppet::read(puppet)?;
    Ok(puppet.map(channels::of_played(path, clip, &puppet, skeleton)?)?)
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

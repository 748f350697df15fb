//! `bunraku play`: clips on a puppet of virtual or real servos.

use super::input::Length;
use super::joints::Table;
use super::number::{played_rate, seconds, speed};
use super::play_report::{Progress, Spent, print, report};
use anyhow::{Context, Result, anyhow, bail, ensure};
use firmware::clock::Speed;
use host_sim::board;
use host_sim::clip::Clip;
use host_sim::files;
use host_sim::play::{self, Note, Performance, Recording};
use host_sim::ports::{self, Clock, ComputerClock, InstantClock, Played, Told, virtual_buses};
use host_sim::puppet::channels;
use host_sim::puppet_servos;
use host_sim::rp2040js;
use host_sim::settings;
use host_sim::show::{PlayedShow, Program, Summary, show_page};
use host_sim::signals::asked_to_end;
use puppet_file::{Map, Puppet};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicUsize;

/// Play clips on the servos of a puppet, virtual or real, and log every goal position that they are told.
///
/// Several clips are played one behind the other; each fades into the next, as long as the puppet's `fade` says.
///
/// On the host, the firmware's player runs in this program; on qemu and sim, it runs on a Cortex-M4 board, and on rp2040 on a
/// Raspberry Pi Pico, whose image is built for the clip and the puppet. All logs are the same. sim and rp2040 count cycles, so they
/// say how long the core was awake. On a port the same player drives real servos in real time; Ctrl-C stops it smoothly and brings
/// the puppet home.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bunraku play walk.qmd --puppet puppets/cmu-12.toml --skeleton 02.asf --on qemu --log walk.csv\n  \
        bunraku play walk.qmd --puppet puppets/cmu-12.toml --skeleton 02.asf --on /dev/ttyUSB0\n  \
        bunraku play wave.mclip bow.mclip --puppet my-puppet.toml --on /dev/ttyUSB0 --loop --speed 0.5"
)]
pub struct Args {
    /// The clips, in their order: .qmd or .mclip.
    #[arg(required = true, value_name = "CLIP")]
    clips: Vec<PathBuf>,
    /// The puppet: which servo follows which channel.
    #[arg(long, value_name = "PUPPET.toml")]
    puppet: PathBuf,
    /// Where the player runs: host (this program), qemu (its mps2-an386, a Cortex-M4), sim (the simulated Cortex-M4, which
    /// counts cycles), rp2040 (a Raspberry Pi Pico in the emulator rp2040js, which counts them too), or the serial port of
    /// real servos (NAME=PORT,NAME=PORT for a puppet with several buses).
    #[arg(long, value_name = "host|qemu|sim|rp2040|PORT", default_value = "host")]
    on: On,
    /// The skeleton whose channels the clips have (.asf, .bvh), instead of the one that the puppet names.
    #[arg(long, value_name = "S.asf")]
    skeleton: Option<PathBuf>,
    /// Play the clips so often; without a number until Ctrl-C (on a port). The last fades into the first.
    #[arg(long = "loop", value_name = "TIMES", num_args = 0..=1, require_equals = true, default_missing_value = "0")]
    times: Option<u32>,
    /// Play so many times as fast as recorded, 0.25 to 4; within the puppet's limits, which may keep it from following.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = speed)]
    speed: f64,
    /// Begin so many seconds into the first clip; with --loop, each time.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = seconds)]
    from: f64,
    /// Let the servos go in the end: a puppet that they hold up falls. Not where a fault ended it, since then the puppet's `on_fault`
    /// says what happens.
    #[arg(long)]
    torque_off: bool,
    /// Where the log goes, also when playing fails: time in seconds, bus, servo id, goal position (in the servo's units).
    #[arg(long, value_name = "OUT.csv")]
    log: Option<PathBuf>,
    /// Write one page with each servo's way, as `bunraku show` does (host, or a port).
    #[arg(long, value_name = "PAGE.html")]
    html: Option<PathBuf>,
    /// Frames per second to play at, instead of each clip's own rate.
    #[arg(long, value_name = "F", value_parser = played_rate)]
    fps: Option<f64>,
    #[command(flatten)]
    length: Length,
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

/// What playing came to, wherever it was.
struct Outcome {
    recording: Recording,
    notes: Vec<Note>,
    /// What only playing in real time has.
    live: Option<Played>,
    /// What only a board that counts cycles has.
    spent: Option<Spent>,
    failed: Option<anyhow::Error>,
}

impl Outcome {
    const fn of(recording: Recording, spent: Option<Spent>) -> Self {
        Self { recording, notes: Vec::new(), live: None, spent, failed: None }
    }
}

impl From<Played> for Outcome {
    fn from(live: Played) -> Self {
        Self {
            recording: live.recording.clone(),
            notes: live.notes.clone(),
            failed: live.failed.clone().map(|why| anyhow!(why)),
            live: Some(live),
            spent: None,
        }
    }
}

pub fn run(args: Args) -> Result<ExitCode> {
    let bytes = args.clips.iter().map(|path| files::read(path)).collect::<Result<Vec<_>>>()?;
    let headers = args.clips.iter().zip(&bytes).map(|(path, bytes)| Clip::headers(path, bytes));
    let clips = headers.collect::<Result<Vec<_>>>()?;
    let puppet = Puppet::read(&args.puppet)?;
    // Names before frames: a clip of another puppet is refused at once, however long it is.
    let map = map_of(&args, &clips, &puppet)?;
    let performance = performance(&args, &clips)?;
    check_length(&args, &performance, &map)?;
    args.clips.iter().zip(&clips).try_for_each(|(path, clip)| clip.check(path, args.length.long))?;
    let one = args.clips[0].display();
    let name = if clips.len() == 1 { one.to_string() } else { format!("{} clips", clips.len()) };
    check_place(&args, &map)?;

    let (clip, bytes_of_one, centihertz) = (&clips[0], &bytes[0], performance.centihertz);
    let log = &mut |line: &str| eprintln!("{line}");
    let played = match &args.on {
        On::Host => on_host(&args, &performance, &map),
        On::Qemu => {
            let played = play::on_qemu(clip, bytes_of_one, &map, centihertz, log);
            played.map(|recording| Outcome::of(recording, None))
        }
        On::Sim => play::on_sim(clip, bytes_of_one, &map, centihertz, log).map(|(recording, usage)| {
            Outcome::of(recording, Some(Spent::of(usage.cycles, usage.asleep, board::QEMU_CLOCK_HZ)))
        }),
        On::Rp2040 => {
            play::on_rp2040(clip, bytes_of_one, &map, centihertz, log).map(|(recording, figures)| {
                eprintln!(
                    "the bus changed its direction at most {:.1} µs after a packet",
                    figures.turnaround_nanos as f64 / 1e3
                );
                let cycles =
                    (u128::from(figures.nanos) * u128::from(rp2040js::CLOCK_HZ) / 1_000_000_000) as u64;
                let asleep = cycles.saturating_sub(figures.cycles);
                Outcome::of(recording, Some(Spent::of(cycles, asleep, rp2040js::CLOCK_HZ)))
            })
        }
        On::Port(port) => {
            let mut buses = ports::open_each(&map, &ports::paths(port, &puppet.bus_names(), |_| true)?)?;
            let say = &mut |line: &str| eprintln!("bunraku: {line}");
            ports::block_on(settings::check_before_arming(&mut buses, &map, &puppet, port, say))?;
            let buses = ports::join(&map, buses)?;
            let (asked, progress) = (asked_to_end()?, Progress::new(&performance));
            let clock = ComputerClock::start();
            let played =
                ports::play(&performance, &map, buses, &clock, asked, &mut |told| progress.show(told));
            progress.end();
            played.map(Outcome::from)
        }
    };
    let outcome = played.with_context(|| format!("cannot play {name}"))?;
    // What there is of a log says best what went wrong.
    if let Some(log) = &args.log {
        write_log(log, &outcome.recording, &puppet.bus_names())?;
    }
    if args.json {
        let on = serde_json::to_value(&args.on)?;
        let log = serde_json::to_value(&args.log)?;
        let failed = outcome.failed.as_ref().map(|why| format!("{why:#}"));
        let figures = report(&map, &outcome.recording, outcome.live.as_ref(), outcome.spent);
        let joints = serde_json::to_value(tables(&args, &clips, centihertz, &puppet, &map)?)?;
        let more = [("on", on), ("log", log), ("failed", failed.into()), ("joints", joints)];
        println!("{:#}", figures.with(more));
    } else if outcome.failed.is_none() {
        print(&name, &map, &outcome.recording, outcome.live.as_ref(), outcome.spent);
        let tables = tables(&args, &clips, centihertz, &puppet, &map)?;
        for (path, table) in args.clips.iter().zip(tables) {
            println!(
                "{}, the whole of it, as the player tells the servos at the clip's speed:",
                path.display()
            );
            table.print();
        }
    }
    if let Some(page) = &args.html {
        write_page(page, &args, &map, &puppet, bytes, &outcome)?;
    }
    match outcome.failed {
        Some(why) => Err(why.context(format!("cannot play {name} to its end"))),
        None => Ok(ExitCode::SUCCESS),
    }
}

/// The map of clips that all have the same channels.
fn map_of(args: &Args, clips: &[Clip<'_>], puppet: &Puppet) -> Result<Map> {
    let channels = channels::of_played(&args.clips[0], &clips[0], puppet, args.skeleton.clone())?;
    for (path, clip) in args.clips.iter().zip(clips).skip(1) {
        channels::check_clip(path, clip, &channels)?;
    }
    Ok(puppet.map(channels)?)
}

/// The joints in each clip.
fn tables(
    args: &Args,
    clips: &[Clip<'_>],
    centihertz: u16,
    puppet: &Puppet,
    map: &Map,
) -> Result<Vec<Table>> {
    let channels = channels::of_played(&args.clips[0], &clips[0], puppet, args.skeleton.clone())?;
    let table = |(path, clip): (&PathBuf, &Clip<'_>)| {
        let rate = if centihertz > 0 { centihertz } else { clip.rate_centihertz() };
        Table::of_clip(path, clip, rate, puppet, map, &channels)
    };
    args.clips.iter().zip(clips).map(table).collect()
}

/// What is asked of the player.
fn performance<'c>(args: &Args, clips: &'c [Clip<'c>]) -> Result<Performance<'c>> {
    let mut centihertz = 0;
    for (path, clip) in args.clips.iter().zip(clips) {
        centihertz = rate(path, clip, args.fps)?;
    }
    let first = if centihertz > 0 { centihertz } else { clips[0].rate_centihertz() };
    let start = (args.from * f64::from(first) / 100.0).round();
    ensure!(
        (0.0..f64::from(clips[0].frames())).contains(&start),
        "--from is {} s, expected 0 to less than {:.2} s, where {} ends",
        args.from,
        f64::from(clips[0].frames()) * 100.0 / f64::from(first),
        args.clips[0].display()
    );
    Ok(Performance {
        clips: args.clips.iter().map(|path| path.display().to_string()).zip(clips).collect(),
        centihertz,
        times: args.times.unwrap_or(1),
        start: start as u32,
        speed: Speed::new((args.speed * 256.0).round() as u16),
        torque_off: args.torque_off,
    })
}

/// Goals that are told and noted down without being asked for: an hour and a half of 20 servos at 50 Hz.
const MOST_GOALS: f64 = 6e6;

/// Refuses what would take hours off a port, where time is not that of this machine and all goals are kept.
fn check_length(args: &Args, performance: &Performance<'_>, map: &Map) -> Result<()> {
    if args.length.long || matches!(args.on, On::Port(_)) {
        return Ok(());
    }
    let of_clip = |clip: &&Clip<'_>| {
        let rate = if performance.centihertz > 0 { performance.centihertz } else { clip.rate_centihertz() };
        f64::from(clip.frames()) * 100.0 / f64::from(rate)
    };
    let once: f64 = performance.clips.iter().map(|(_, clip)| of_clip(clip)).sum();
    let seconds = once * f64::from(performance.times) / args.speed;
    let goals = seconds * f64::from(map.settings().tick_hz) * map.joints().len() as f64;
    ensure!(
        goals <= MOST_GOALS,
        "{seconds:.0} s at {} Hz are {goals:.0} goals for {} servos, expected at most {MOST_GOALS:.0}: --long takes them all",
        map.settings().tick_hz,
        map.joints().len()
    );
    Ok(())
}

/// Whether what is asked can be done where it is asked.
fn check_place(args: &Args, map: &Map) -> Result<()> {
    if args.html.is_some()
        && let Some(blind) = map.buses().iter().find(|bus| !bus.kind.reads())
    {
        bail!(
            "--html shows where the servos were, and those of the kind \"{}\" do not say that",
            blind.kind.name()
        );
    }
    match args.on {
        On::Port(_) => Ok(()),
        On::Host if args.times == Some(0) => {
            bail!("--loop has no end on the host: say how often, for instance --loop=3")
        }
        On::Host => Ok(()),
        On::Qemu | On::Sim | On::Rp2040 => {
            let plain = args.times.is_none() && args.speed == 1.0 && args.from == 0.0;
            ensure!(
                plain && args.clips.len() == 1 && !args.torque_off && args.html.is_none(),
                "a board plays one clip, once and as it is: play several, or with --loop, --speed, --from, --torque-off or --html, \
                 on host or on a port; `bunraku show` plays several on qemu and sim"
            );
            Ok(())
        }
    }
}

/// Virtual servos in this program, as fast as it goes.
fn on_host(args: &Args, performance: &Performance<'_>, map: &Map) -> Result<Outcome> {
    // The player's own virtual servos come to rest with what they were told last; only the others are let go.
    if play::has_servos_for(map) && !args.torque_off {
        let play::Performed { recording, notes, failed } = play::perform(performance, map)?;
        return Ok(Outcome { recording, notes, live: None, spent: None, failed });
    }
    let (clock, served) = (InstantClock::default(), puppet_servos::read(&args.puppet)?);
    let now = || clock.now();
    let buses = virtual_buses::open(map, &served, &now)?;
    let played = ports::play(performance, map, buses, &clock, &AtomicUsize::new(0), &mut |told| {
        if let Told::Line(line) = told
            && line.contains(' ')
        {
            eprintln!("{line}");
        }
    })?;
    Ok(Outcome { live: None, ..Outcome::from(played) })
}

/// Writes the page of what was played.
fn write_page(
    path: &Path,
    args: &Args,
    map: &Map,
    puppet: &Puppet,
    bytes: Vec<Vec<u8>>,
    outcome: &Outcome,
) -> Result<()> {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let names = args.clips.iter().map(|clip| stem(clip));
    let title = names.clone().collect::<Vec<_>>().join(", ");
    let clips = names.zip(&args.clips).zip(bytes).map(|((name, path), bytes)| (name, path.clone(), bytes));
    let program = Program::of_clips(title, map.clone(), puppet, clips.collect());
    // The page counts ticks in which goals were sent.
    let mut recording = outcome.recording.clone();
    recording.ticks = recording.present.len() as u32;
    for (goal, taken) in recording.goals.iter_mut().enumerate() {
        taken.time_us = map.tick_micros((goal / map.joints().len()) as u32);
    }
    let played = PlayedShow { recording, notes: outcome.notes.clone(), costs: Vec::new() };
    let on = if matches!(args.on, On::Port(_)) { "port" } else { "host" };
    let page = show_page(&program, &played, &Summary::new(&program, &played, on));
    files::write(path, |file| Ok(file.write_all(page.as_bytes())?))
}

/// The rate to play at in hundredths of a hertz, or 0 for the clip's own.
pub fn rate(path: &Path, clip: &Clip<'_>, fps: Option<f64>) -> Result<u16> {
    let centihertz = fps.map_or(0, |fps| (fps * 100.0).round() as u16);
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

/// Writes what the servos were told, a line for every goal.
pub fn write_log(path: &Path, recording: &Recording, buses: &[String]) -> Result<()> {
    files::write(path, |file| Ok(recording.write_csv(file, buses)?))
}

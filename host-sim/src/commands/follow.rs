//! `bunraku follow`: live frames on a puppet of virtual or real servos.

use super::number::seconds_of_silence;
use super::play::write_log;
use anyhow::{Context, Result, bail};
use host_sim::live_frames::{self, Listener, Say};
use host_sim::play::seconds;
use host_sim::ports::{self, Clock, ComputerClock, Told, virtual_buses};
use host_sim::puppet::joint_names::JointNames;
use host_sim::puppet_servos;
use host_sim::settings;
use host_sim::signals::asked_to_end;
use puppet_file::Puppet;
use std::io::Write;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::mpsc::Receiver;

/// Follow the live mode of the Blender add-on Servo Animation: its frames move a puppet, within the puppet's limits.
///
/// With --listen, choose the method "Web Socket" in the add-on's live mode, and the host and port that are printed here; any path
/// will do. A program of your own may also connect by TCP and send the same frames: `<`, id, position high, position low, `>`. One
/// client at a time is followed; when it is gone the pose is held until the next one comes.
///
/// Positions are goals of the servos (the add-on's "position min" and "max": goals as `bunraku puppet check` shows them), ids those of the
/// puppet. Nothing jumps: the player finds its servos, waits for the first frame, eases to the pose, and follows with the velocity and
/// acceleration that the puppet allows. Ctrl-C brings it home slowly. When no frame comes for as long as --lost says, that is a lost link:
/// the puppet does what its `on_fault` says, and this ends with 1. The add-on sends what changes only, so --lost 0 is for scenes that
/// stand still.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bunraku follow puppets/cmu-12.toml --listen 127.0.0.1:4000 --lost 0 --on /dev/ttyUSB0\n  \
        bunraku follow puppets/cmu-12.toml --from tcp:192.168.1.20:4000 --on host",
    group = clap::ArgGroup::new("source").required(true).args(["from", "listen"])
)]
pub struct Args {
    /// The puppet.
    #[arg(value_name = "PUPPET.toml")]
    puppet: PathBuf,
    /// Wait here for whoever connects and sends frames, by WebSocket or TCP. Port 0 is any free one; which one is printed.
    #[arg(long, value_name = "ADDRESS:PORT")]
    listen: Option<SocketAddr>,
    /// Listen on an address that other computers reach. Whoever reaches it can move the puppet: there is no password.
    #[arg(long, requires = "listen")]
    other_computers: bool,
    /// Where frames come from: a serial port, `tcp:HOST:PORT` to connect to, or `pty`: a pseudo terminal, whose path is printed.
    #[arg(long, value_name = "PORT|tcp:HOST:PORT|pty")]
    from: Option<String>,
    /// Where the servos are: host (virtual ones in this program), or their serial port (NAME=PORT,NAME=PORT for a puppet with several
    /// buses).
    #[arg(long, value_name = "host|PORT", default_value = "host")]
    on: String,
    /// Bits per second of the serial port that frames come from.
    #[arg(long, value_name = "BAUD", default_value_t = 115_200)]
    baud: u32,
    /// Seconds of silence after which the link is lost, up to 60; 0: never.
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0, value_parser = seconds_of_silence)]
    lost: f64,
    /// Where the log goes, also when following fails: time in seconds, bus, servo id, goal position.
    #[arg(long, value_name = "OUT.csv")]
    log: Option<PathBuf>,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

/// Says what happens on the way.
const SAY: Say = |line| eprintln!("{line}");

pub fn run(args: Args) -> Result<ExitCode> {
    if !(0.0..=60.0).contains(&args.lost) {
        bail!("--lost is {}, expected 0 to 60 seconds", args.lost);
    }
    let lost_millis = (args.lost * 1000.0).ceil() as u16;
    let path = &args.puppet;
    let puppet = Puppet::read(path)?;
    let map = puppet.map(puppet.channels()?)?;
    let bus_names = puppet.bus_names();
    let names = JointNames::of(&puppet, &map);
    let clock = ComputerClock::start();
    let say = &mut |told: Told<'_>| {
        if let Told::Line(line) = told {
            SAY(line);
        }
    };
    let (played, counters) = if args.on == "host" {
        let served = puppet_servos::read(path)?;
        let now = || clock.now();
        let buses = virtual_buses::open(&map, &served, &now).context("--on host")?;
        ports::follow(&listen(&args)?, lost_millis, (&map, &names), buses, &clock, asked_to_end()?, say)
    } else {
        let paths = ports::paths(&args.on, &bus_names, |_| true)?;
        let mut buses = ports::open_each(&map, &paths)?;
        let warn = &mut |line: &str| eprintln!("bunraku: {line}");
        ports::block_on(settings::check_before_arming(&mut buses, &map, &puppet, &args.on, warn))?;
        let buses = ports::join(&map, buses)?;
        ports::follow(&listen(&args)?, lost_millis, (&map, &names), buses, &clock, asked_to_end()?, say)
    }?;
    if let Some(log) = &args.log {
        write_log(log, &played.recording, &bus_names)?;
    }
    let (ticks, servos) = (played.recording.ticks, map.joints().len());
    let state = format!("{:?}", played.state);
    if args.json {
        let report = serde_json::json!({
            "ticks": ticks, "servos": servos, "servo_hz": map.tick_hz(), "goals": played.recording.goals.len(),
            "frames": counters.frames, "foreign_frames": counters.foreign, "skipped_bytes": counters.skipped(),
            "late_ticks": played.late.ticks, "longest_bus_ms": played.longest.as_secs_f64() * 1e3, "state": state,
            "failed": played.failed,
        });
        println!("{report:#}");
    } else {
        let summary = format!(
            "{} frames followed, {} for others, {} bytes of none; {ticks} ticks at {} Hz on {servos} servos, {} s, {} of them \
             late; the puppet ends {state}",
            counters.frames,
            counters.foreign,
            counters.skipped(),
            map.tick_hz(),
            seconds(map.tick_micros(ticks)),
            played.late.ticks
        );
        // What goes with an error goes where errors go.
        if played.failed.is_some() {
            SAY(&summary);
        } else {
            println!("{summary}");
        }
    }
    if let Some(failed) = played.failed {
        bail!("cannot follow {} any longer: {failed}", source(&args));
    }
    Ok(ExitCode::SUCCESS)
}

/// Where frames come from, as it was given.
fn source(args: &Args) -> String {
    let listened = args.listen.map(|address| format!("whoever connects to {address}"));
    args.from.clone().or(listened).unwrap_or_default()
}

/// Opens where frames come from.
fn listen(args: &Args) -> Result<Receiver<Vec<u8>>> {
    if let Some(address) = args.listen {
        if !address.ip().is_loopback() {
            if !args.other_computers {
                bail!(
                    "--listen {address} can be reached from other computers, and whoever reaches it can move the puppet: listen on \
                     127.0.0.1:{}, or add --other-computers if that is what you want",
                    address.port()
                );
            }
            SAY(&format!("whoever reaches {address} can move the puppet: there is no password"));
        }
        let listener = Listener::bind(address)?;
        let address = listener.address().context("cannot say which port is listened on")?;
        print(&address.to_string())?;
        SAY(&format!(
            "in the add-on's live mode: method Web Socket, host {}, port {}, path /",
            address.ip(),
            address.port()
        ));
        return Ok(listener.start(SAY));
    }
    let from = args.from.as_deref().context("expected --from or --listen")?;
    if from == "pty" {
        let (path, frames) = live_frames::read_pty(SAY)?;
        print(&path.display().to_string())?;
        return Ok(frames);
    }
    live_frames::read_port(from, args.baud, SAY)
}

/// Says at once where frames may be sent to.
fn print(line: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush()).context("cannot write to standard output")
}

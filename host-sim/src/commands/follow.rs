//! `bunraku follow`: live frames on a puppet of virtual or real servos.

use super::play::{asked_to_end, write_log};
use anyhow::{Context, Result, bail};
use firmware::follow::Counters;
use firmware::map::BusKind;
use host_sim::link::port::Port;
use host_sim::play::{self, seconds};
use host_sim::ports::{self, Clock, ComputerClock, Played};
use puppet_file::{Map, Puppet};
use std::io::{ErrorKind, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::AtomicUsize;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::Duration;
#[cfg(unix)]
use virtual_servos::config::ServoConfig;
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::hobby::HobbyBoard;
use virtual_servos::serve::Pty;
use virtual_servos::virtual_bus::VirtualBus;

/// Follow the live mode of the Blender add-on Servo Animation: its frames move a puppet, within the puppet's limits.
///
/// Positions are goals of the servos (the add-on's "position min" and "max": goals as `bunraku puppet check` shows them), ids those of the
/// puppet. Nothing jumps: the player finds its servos, waits for the first frame, eases to the pose, and follows with the velocity and
/// acceleration that the puppet allows. Ctrl-C brings it home slowly. When no frame comes for as long as --lost says, that is a lost link:
/// the puppet does what its `on_fault` says, and this ends with 1. The add-on sends what changes only, so --lost 0 is for scenes that
/// stand still.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku follow --puppet puppets/cmu-12.toml --from pty --on /dev/ttyUSB0\n  /dev/pts/4\n\n\
        Then choose /dev/pts/4 as the serial port of the add-on's live mode."
)]
pub struct Args {
    /// The puppet.
    #[arg(long, value_name = "PUPPET.toml")]
    puppet: PathBuf,
    /// Where frames come from: a serial port, `tcp:HOST:PORT` to connect to, or `pty`: a pseudo terminal, whose path is printed.
    #[arg(long, value_name = "PORT|tcp:HOST:PORT|pty")]
    from: String,
    /// Where the servos are: host (virtual ones in this program), or their serial port (NAME=PORT,NAME=PORT for a puppet with several
    /// buses).
    #[arg(long, value_name = "host|PORT", default_value = "host")]
    on: String,
    /// Bits per second of the serial port that frames come from.
    #[arg(long, value_name = "BAUD", default_value_t = 115_200)]
    baud: u32,
    /// Seconds of silence after which the link is lost, up to 60; 0: never.
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0)]
    lost: f64,
    /// Where the log goes: time in seconds, servo id, goal position.
    #[arg(long, value_name = "OUT.csv")]
    log: Option<PathBuf>,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<ExitCode> {
    if !(0.0..=60.0).contains(&args.lost) {
        bail!("--lost is {}, expected 0 to 60 seconds", args.lost);
    }
    let lost_millis = (args.lost * 1000.0).ceil() as u16;
    let puppet = Puppet::read(&args.puppet)?;
    let map = puppet.map(puppet.channels()?)?;
    let say = &mut |line: &str| eprintln!("{line}");
    let (played, counters) = if args.on == "host" {
        let asked = asked_to_end()?;
        on_host(&listen(&args.from, args.baud)?, lost_millis, &map, asked, say)
    } else {
        let paths = ports::paths(&args.on, &puppet.bus_names(), |_| true)?;
        let buses = ports::open(&map, &paths)?;
        let asked = asked_to_end()?;
        ports::follow(
            &listen(&args.from, args.baud)?,
            lost_millis,
            &map,
            buses,
            &ComputerClock::start(),
            asked,
            say,
        )
    }
    .with_context(|| format!("cannot follow {} any longer", args.from))?;
    if let Some(log) = &args.log {
        write_log(log, &played.recording)?;
    }
    let (ticks, servos) = (played.recording.ticks, map.joints().len());
    let state = format!("{:?}", played.state);
    if args.json {
        let report = serde_json::json!({
            "ticks": ticks, "servos": servos, "servo_hz": map.tick_hz(), "goals": played.recording.goals.len(),
            "frames": counters.frames, "foreign_frames": counters.foreign, "late_ticks": played.late,
            "longest_bus_ms": played.longest.as_secs_f64() * 1e3, "state": state,
        });
        println!("{report:#}");
    } else {
        println!(
            "{} frames followed, {} for others; {ticks} ticks at {} Hz on {servos} servos, {} s, {} of them late; the puppet ends {state}",
            counters.frames,
            counters.foreign,
            map.tick_hz(),
            seconds(map.tick_micros(ticks)),
            played.late
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// Virtual servos in this program, in real time.
fn on_host(
    input: &Receiver<Vec<u8>>,
    lost_millis: u16,
    map: &Map,
    asked: &AtomicUsize,
    say: &mut dyn FnMut(&str),
) -> Result<(Played, Counters)> {
    let on_line = map.buses().iter().position(|bus| bus.kind == BusKind::Dynamixel);
    let joints = map.joints().iter().filter(|joint| Some(usize::from(joint.bus)) == on_line);
    let servos = joints.map(|joint| ServoConfig { position: joint.home, ..ServoConfig::new(joint.id) });
    let mut servos = DynamixelServos::new(&DynamixelConfig {
        servos: servos.collect(),
        ..DynamixelConfig::with_ids(&[])
    })?;
    let clock = ComputerClock::start();
    let hear = |bytes: &[u8]| {
        let now_us = u64::try_from(clock.now().as_micros()).unwrap_or(u64::MAX);
        servos.receive(bytes, now_us, &mut |_| {})
    };
    let bus = play::virtual_bus(map, &HobbyBoard::default(), hear).context("--on host")?;
    ports::follow(input, lost_millis, map, bus, &clock, asked, say)
}

/// Reads where frames come from, in a thread of its own, until it ends.
fn listen(from: &str, baud: u32) -> Result<Receiver<Vec<u8>>> {
    let (sender, receiver) = channel();
    if from == "pty" {
        listen_to_pty(sender)?;
        return Ok(receiver);
    }
    let mut port = Port::open(from, baud).with_context(|| format!("cannot open {from}"))?;
    let from = from.to_owned();
    thread::spawn(move || {
        let mut bytes = [0; 1024];
        loop {
            let sent = match port.read(&mut bytes, Duration::from_secs(1)) {
                Ok(count) => sender.send(bytes[..count].to_vec()),
                Err(error) => {
                    eprintln!("bunraku: {from}: {error}: no more frames will come");
                    return;
                }
            };
            if sent.is_err() {
                return;
            }
        }
    });
    Ok(receiver)
}

#[cfg(unix)]
fn listen_to_pty(sender: Sender<Vec<u8>>) -> Result<()> {
    let mut pty = Pty::open()?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", pty.path().display())
        .and_then(|()| out.flush())
        .context("cannot write to standard output")?;
    thread::spawn(move || {
        let mut bytes = [0; 1024];
        loop {
            match pty.read_now(&mut bytes) {
                Ok(count) if sender.send(bytes[..count].to_vec()).is_err() => return,
                Ok(_) => {}
                Err(error) if [ErrorKind::WouldBlock, ErrorKind::Interrupted].contains(&error.kind()) => {
                    thread::sleep(Duration::from_millis(1));
                }
                Err(error) => {
                    eprintln!("bunraku: the pseudo terminal failed: {error}: no more frames will come");
                    return;
                }
            }
        }
    });
    Ok(())
}

#[cfg(not(unix))]
fn listen_to_pty(_: Sender<Vec<u8>>) -> Result<()> {
    bail!("this system has no pseudo terminals: give a serial port, or tcp:HOST:PORT");
}

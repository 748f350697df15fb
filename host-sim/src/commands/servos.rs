//! `bunraku servos`: virtual servos for any client.

use anyhow::{Context, bail};
use firmware::map::BusKind;
use host_sim::files;
use host_sim::puppet_servos::{self, ServedBus};
use host_sim::settings;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Instant;
use virtual_servos::config::ConfigError;
use virtual_servos::serve;
use virtual_servos::virtual_bus::{Disturbance, Event};

/// Serve virtual servos, on one port for each bus of a puppet: a pseudo terminal or a TCP port.
///
/// There are Dynamixel X (protocol 2.0), AX and MX (1.0), Feetech STS and SCS, and a receiver of Blender's live frames.
///
/// Prints the port to connect to (NAME=PORT,NAME=PORT for several buses, as `--on` of other commands takes it) and answers until
/// it is stopped with Ctrl-C.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  bunraku servos --config puppet.toml --listen pty\n  \
    bunraku servos --ids 1-6 --kind sts\n  \
    bunraku servos --ids 1-2 --set 1:operating-mode=1 --set 2:firmware-version=40\n\n\
    Then open the port that is printed, such as /dev/pts/3, with any client at any baud rate.")]
pub struct Args {
    /// The puppet: one servo for the id of each joint, of the joint's model, at the joint's home
    #[arg(long, value_name = "PUPPET.TOML", required_unless_present = "ids")]
    config: Option<PathBuf>,
    /// Servos with these ids without a puppet, for instance 1-6 or 1,2,7
    #[arg(long, value_name = "IDS", value_parser = ids, conflicts_with = "config")]
    ids: Option<Ids>,
    /// What servos without a puppet speak: dynamixel, dynamixel1, sts or scs
    #[arg(long, value_parser = super::puppet::kind_that_reads, default_value = "dynamixel", conflicts_with = "config")]
    kind: BusKind,
    /// What a servo is set to from the start, whatever it would take itself: its id, a register (by its name in the manual with "-"
    /// for spaces, or by its address) and the value. So servos can be given wrong modes, limits, models and old firmware
    #[arg(long, value_name = "ID:REGISTER=VALUE", value_parser = preset)]
    set: Vec<Preset>,
    /// Where clients connect: `pty` or `tcp:HOST:PORT` (port 0 takes a free one, else several buses take the ports from it on)
    #[arg(long, value_name = "LINE", default_value = "pty")]
    listen: Listen,
    /// What happens to the servos, by seconds since they were started: `[[event]]` with `at` and `what`, for instance
    /// at = 5.0, what = "turn", servo = 3, position = 1000 (or restart, silence, cut, set), and `bus` where there are several
    #[arg(long, value_name = "EVENTS.TOML")]
    events: Option<PathBuf>,
    /// Where it is written what the servos are told: time in seconds, bus, servo, goal position
    #[arg(long, value_name = "OUT.csv")]
    log: Option<PathBuf>,
    /// Print the port and the ids as JSON
    #[arg(long)]
    json: bool,
}

/// Ids of servos.
#[derive(Clone)]
pub struct Ids(Vec<u8>);

/// Parses ids and ranges of them.
fn ids(text: &str) -> Result<Ids, String> {
    let mut ids = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        match (first.trim().parse::<u8>(), last.trim().parse::<u8>()) {
            (Ok(first), Ok(last)) if first <= last && last <= 252 => ids.extend(first..=last),
            _ => {
                return Err(format!("found \"{part}\", expected ids of 0 to 252, for instance 1-6 or 1,2,7"));
            }
        }
    }
    Ok(Ids(ids))
}

/// What a servo is set to from the start.
#[derive(Clone, Debug)]
pub struct Preset {
    servo: u8,
    register: String,
    value: i64,
}

/// Parses what a servo is set to.
fn preset(text: &str) -> Result<Preset, String> {
    let parts = text.split_once(':').and_then(|(servo, rest)| Some((servo, rest.split_once('=')?)));
    let parsed = parts.and_then(|(servo, (register, value))| {
        let (servo, value) = (servo.trim().parse().ok()?, value.trim().parse().ok()?);
        Some(Preset { servo, register: register.trim().to_owned(), value })
    });
    parsed.ok_or_else(|| "expected ID:REGISTER=VALUE, for instance 1:operating-mode=1 or 1:11=1".to_owned())
}

impl Preset {
    /// As something that happens at the start to a servo on this kind of bus.
    fn disturbance(&self, kind: BusKind) -> anyhow::Result<Disturbance> {
        let address = settings::address_of(kind, &self.register).with_context(|| {
            let names = settings::register_names(kind).collect::<Vec<_>>().join(", ");
            format!(
                "--set: a servo on \"{}\" has no register \"{}\", expected an address or one of {names}",
                kind.name(),
                self.register
            )
        })?;
        Ok(Disturbance::Set { servo: self.servo, address, value: self.value })
    }
}

/// What to do where there is no pseudo terminal.
pub const NO_PTY: &str = "no pseudo terminal; --listen tcp:127.0.0.1:0 does without";

/// Where clients connect.
#[derive(Clone)]
pub enum Listen {
    /// A pseudo terminal.
    Pty,
    /// A TCP port.
    Tcp(String),
}

impl FromStr for Listen {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.strip_prefix("tcp:") {
            Some(address) => Ok(Self::Tcp(address.to_owned())),
            None if text == "pty" => Ok(Self::Pty),
            None => Err("expected pty or tcp:HOST:PORT"),
        }
    }
}

/// A port that is open.
enum Port {
    #[cfg(unix)]
    Pty(Box<serve::Pty>),
    Tcp(serve::Tcp),
}

impl Port {
    /// The `number`th port.
    fn open(listen: &Listen, number: u16) -> anyhow::Result<Self> {
        match listen {
            #[cfg(unix)]
            Listen::Pty => Ok(Self::Pty(Box::new(serve::Pty::open().context(NO_PTY)?))),
            #[cfg(not(unix))]
            Listen::Pty => bail!(NO_PTY),
            Listen::Tcp(address) => {
                let apart =
                    address.rsplit_once(':').and_then(|(host, port)| Some((host, port.parse::<u16>().ok()?)));
                let address = match apart {
                    Some((host, port)) if port > 0 => format!("{host}:{}", port.saturating_add(number)),
                    _ => address.clone(),
                };
                Ok(Self::Tcp(serve::Tcp::bind(&address)?))
            }
        }
    }

    fn name(&self) -> anyhow::Result<String> {
        Ok(match self {
            #[cfg(unix)]
            Self::Pty(pty) => pty.path().display().to_string(),
            Self::Tcp(tcp) => tcp.address()?.to_string(),
        })
    }

    fn serve(&mut self, served: serve::Served) -> Result<(), serve::ServeError> {
        match self {
            #[cfg(unix)]
            Self::Pty(pty) => pty.serve(served),
            Self::Tcp(tcp) => tcp.serve(served, |client, error| {
                eprintln!("bunraku: the client {client} is gone: {error}");
            }),
        }
    }
}

/// Serves until the process is stopped.
///
/// # Errors
/// A sentence about the puppet, a port or a line.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let log = args.log.as_deref().map(open_log).transpose()?;
    let mut events = args.events.as_deref().map(puppet_servos::read_events).transpose()?.unwrap_or_default();
    let mut open = Vec::new();
    let power_on = Instant::now();
    let mut presets = args.set.clone();
    let source = args.config.as_ref().map_or_else(|| "--ids".to_owned(), |path| path.display().to_string());
    let buses = match (&args.config, args.ids) {
        (Some(config), _) => puppet_servos::read(config)?,
        (None, ids) => {
            vec![puppet_servos::without_puppet(args.kind, &ids.map(|ids| ids.0).unwrap_or_default())]
        }
    };
    for bus in buses {
        let named = || format!("{source} does not describe servos");
        let Some(mut servos) = bus.virtual_bus(serve::BYTE_GAP_US).with_context(named)? else {
            eprintln!(
                "bunraku: the bus \"{}\" ({}) hangs on a board's pins: left out",
                bus.name,
                bus.kind.name()
            );
            continue;
        };
        for preset in std::mem::take(&mut presets) {
            let disturbance = preset.disturbance(bus.kind);
            match bus.servos.iter().any(|(servo, _)| servo.id == preset.servo) {
                true => servos.schedule(0, disturbance?)?,
                false => presets.push(preset),
            }
        }
        // An event without a bus is for the first one that has its servo, and a cut is for all.
        let mut left = Vec::new();
        for (at_us, name, disturbance) in events {
            let here = name.as_ref().is_none_or(|name| *name == bus.name);
            let all = name.is_none() && disturbance.servo().is_none();
            if !(here && servos.schedule(at_us, disturbance).is_ok()) || all {
                left.push((at_us, name, disturbance));
            }
        }
        events = left;
        let tap = tap(log.clone(), &bus.name);
        let served = serve::Served { bus: servos, power_on, tap };
        open.push((Port::open(&args.listen, u16::try_from(open.len())?)?, bus, served));
    }
    if open.is_empty() {
        bail!("{source}: all servos hang on a board's pins, and none on a port");
    }
    if let Some(preset) = presets.first() {
        return Err(ConfigError::Absent(preset.servo)).context("--set");
    }
    if let Some(path) = &args.events {
        for (_, name, disturbance) in events {
            match (disturbance.servo(), name) {
                (Some(servo), None) => {
                    return Err(ConfigError::Absent(servo)).with_context(|| path.display().to_string());
                }
                (servo, Some(name)) => {
                    let servo = servo.map_or(String::new(), |servo| format!(" with a servo {servo}"));
                    bail!("{}: there is no bus \"{name}\"{servo} for something to happen to", path.display());
                }
                (None, None) => {}
            }
        }
    }
    announce(&open, args.json)?;
    // The first port that fails ends this program, and the others with it.
    let (sender, ended) = std::sync::mpsc::channel();
    for (mut port, _, served) in open {
        let sender = sender.clone();
        thread::spawn(move || sender.send(port.serve(served)));
    }
    ended.recv().context("no port is served")??;
    Ok(ExitCode::SUCCESS)
}

fn announce(open: &[(Port, ServedBus, serve::Served)], json: bool) -> anyhow::Result<()> {
    let mut ports = Vec::new();
    for (port, bus, _) in open {
        let ids: Vec<u8> = bus.servos.iter().map(|(servo, _)| servo.id).collect();
        ports.push((bus, port.name()?, ids));
    }
    let port = match ports.as_slice() {
        [(_, port, _)] => port.clone(),
        several => {
            several.iter().map(|(bus, port, _)| format!("{}={port}", bus.name)).collect::<Vec<_>>().join(",")
        }
    };
    let mut out = std::io::stdout().lock();
    if json {
        let ids: Vec<u8> = ports.iter().flat_map(|(.., ids)| ids).copied().collect();
        let bus = |(bus, port, ids): &(&ServedBus, String, Vec<u8>)| serde_json::json!({ "name": bus.name, "kind": bus.kind.name(), "port": port, "ids": ids });
        let buses: Vec<_> = ports.iter().map(bus).collect();
        writeln!(out, "{}", serde_json::json!({ "port": port, "ids": ids, "buses": buses }))?;
    } else {
        writeln!(out, "{port}")?;
    }
    Ok(out.flush()?)
}

/// What all buses write to.
type Log = Arc<Mutex<File>>;

fn open_log(path: &Path) -> anyhow::Result<Log> {
    Ok(Arc::new(Mutex::new(files::create(path, b"time_s,bus,servo,goal_position\n")?)))
}

/// Writes goals to the log. Nothing is kept back, since this program ends by being stopped.
fn tap(log: Option<Log>, bus: &str) -> Box<dyn FnMut(Event) + Send> {
    let Some(log) = log else { return Box::new(|_| {}) };
    let bus = bus.to_owned();
    let mut failed = false;
    Box::new(move |event| {
        let Event::Goal { time_us, id, position } = event else { return };
        let Ok(mut file) = log.lock() else { return };
        let line = format!("{},{bus},{id},{position}\n", host_sim::play::seconds(time_us));
        if let (Err(error), false) = (file.write_all(line.as_bytes()), failed) {
            eprintln!("bunraku: cannot write the log: {error}");
            failed = true;
        }
    })
}

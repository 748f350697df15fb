//! `bunraku servos`: virtual servos for any Dynamixel client.

use anyhow::Context;
use host_sim::servos::{Bus, BusConfig, config, serve};
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::str::FromStr;

/// Virtual Dynamixel X-series servos (protocol 2.0) on a serial port or a TCP port.
///
/// Prints the port to connect to and answers until it is stopped with Ctrl-C.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  bunraku servos --config puppet.toml --listen pty\n  \
    /dev/pts/3\n\nThen open /dev/pts/3 with any client, such as ROBOTIS' dynamixel-sdk, at any baud rate.")]
pub struct Args {
    /// The puppet: one servo for the id of each joint
    #[arg(long, value_name = "PUPPET.TOML")]
    config: PathBuf,
    /// Where clients connect: `pty` or `tcp:HOST:PORT` (port 0 takes a free one)
    #[arg(long, value_name = "LINE", default_value = "pty")]
    listen: Listen,
    /// What happens to the servos, by seconds since they were started: `[[event]]` with `at` and `what`, for instance
    /// at = 5.0, what = "turn", servo = 3, position = 1000 (or restart, silence, cut)
    #[arg(long, value_name = "EVENTS.TOML")]
    events: Option<PathBuf>,
    /// Print the port and the ids as JSON
    #[arg(long)]
    json: bool,
}

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

/// Serves until the process is stopped.
///
/// # Errors
/// A sentence about the puppet, the port or the line.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let Args { config: path, listen, events, json } = args;
    let config = BusConfig { byte_gap_us: serve::BYTE_GAP_US, ..config::read(&path)? };
    let mut bus =
        Bus::new(&config).with_context(|| format!("{} does not describe servos", path.display()))?;
    if let Some(events) = events {
        for (at_us, deed) in config::read_events(&events)? {
            bus.schedule(at_us, deed).with_context(|| events.display().to_string())?;
        }
    }
    let announce = |port: &str| -> std::io::Result<()> {
        let mut out = std::io::stdout().lock();
        if json {
            let ids: Vec<u8> = config.servos.iter().map(|servo| servo.id).collect();
            writeln!(out, "{}", serde_json::json!({ "port": port, "ids": ids }))?;
        } else {
            writeln!(out, "{port}")?;
        }
        out.flush()
    };
    match listen {
        Listen::Pty => serve_pty(bus, announce)?,
        Listen::Tcp(address) => {
            let mut tcp = serve::Tcp::bind(&address)?;
            announce(&tcp.address()?.to_string())?;
            tcp.serve(bus)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(unix)]
fn serve_pty(bus: Bus, announce: impl Fn(&str) -> std::io::Result<()>) -> anyhow::Result<()> {
    let mut pty = serve::Pty::open()?;
    announce(&pty.path().display().to_string())?;
    pty.serve(bus)
}

#[cfg(not(unix))]
fn serve_pty(_: Bus, _: impl Fn(&str) -> std::io::Result<()>) -> anyhow::Result<()> {
    anyhow::bail!("this system has no pseudo terminals; use --listen tcp:127.0.0.1:0")
}

//! `bunraku device`: a puppet's controller on virtual servos.

use super::servos::{Listen, NO_PTY};
use anyhow::{Result, bail};
use host_sim::device::{self, Config, Key, Listener};
use host_sim::link::key_file;
use host_sim::puppet::channels;
use puppet_file::Puppet;
use std::cell::Cell;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::PathBuf;
use std::process::ExitCode;

/// Run a puppet's controller on virtual servos, in real time: the firmware's own code, with clips in a file instead of flash.
///
/// Prints the port for `bunraku push`, `stream` and `monitor`, and runs until it is stopped with Ctrl-C.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku device --puppet puppets/cmu-12.toml --skeleton 02.asf --flash puppet.flash --listen tcp:127.0.0.1:4100\n  \
    tcp:127.0.0.1:4100"
)]
pub struct Args {
    /// The puppet: which servo follows which channel.
    #[arg(long, value_name = "PUPPET.toml")]
    puppet: PathBuf,
    /// The skeleton whose channels the clips have (.asf, .bvh), instead of the one that the puppet names.
    #[arg(long, value_name = "S.asf")]
    skeleton: Option<PathBuf>,
    /// The file that holds the flash; without, clips are forgotten at the end.
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
    /// Size of the flash in KiB.
    #[arg(long, value_name = "KIB", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(12..=65_536))]
    flash_kib: u32,
    /// Where hosts connect: `pty` or `tcp:HOST:PORT` (port 0 takes a free one).
    #[arg(long, value_name = "LINE", default_value = "pty")]
    listen: Listen,
    /// The file with the key that hosts need: 16 to 64 bytes, and a line's end. Beyond this computer one is needed, or --without-key.
    #[arg(long, value_name = "FILE")]
    key_file: Option<PathBuf>,
    /// Listen for other computers without a key: whoever reaches the port moves the puppet.
    #[arg(long, conflicts_with = "key_file")]
    without_key: bool,
    /// What the device is called.
    #[arg(long, default_value = "virtual")]
    name: String,
    /// The clip that plays while no other one does.
    #[arg(long, value_name = "CLIP")]
    idle: Option<u16>,
    /// The clip that a trigger plays.
    #[arg(long, value_name = "CLIP")]
    trigger: Option<u16>,
    /// Time in ms without a block after which a stream that is not at its end is lost; a block may be a second of motion.
    #[arg(long, value_name = "MS", default_value_t = 2000)]
    stream_lost: u16,
    /// Print the port as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs until the process is stopped.
///
/// # Errors
/// A sentence about the puppet, the flash or the port.
pub fn run(args: Args) -> Result<ExitCode> {
    let puppet = Puppet::read(&args.puppet)?;
    let map = puppet.map(channels::of_clips(&puppet, args.skeleton)?)?;
    let listener = match &args.listen {
        Listen::Tcp(address) => Listener::tcp(address)?,
        Listen::Pty => pty()?,
    };
    let port = listener.name()?;
    let key = args.key_file.as_deref().map(key_file::read).transpose()?;
    if key.is_none() && !listener.is_private()? {
        if !args.without_key {
            bail!(
                "{port} is open to other computers: give hosts a key (--key-file FILE), listen on 127.0.0.1, or say \
                 --without-key"
            );
        }
        eprintln!("warning: whoever reaches {port} moves the puppet and writes its clips: there is no key");
    }
    let default = Config::default();
    let config = Config {
        name: args.name,
        flash: args.flash,
        flash_kib: args.flash_kib as usize,
        idle_clip: args.idle,
        trigger_clip: args.trigger,
        stream: firmware::stream::Settings { lost_millis: args.stream_lost, ..default.stream },
        key: key.map(|key| Key { lock: Box::leak(Box::new(key)), seed: seed() }),
    };
    let line = if args.json {
        serde_json::json!({ "port": port, "servos": map.joints().len(), "servo_hz": map.tick_hz() })
            .to_string()
    } else {
        port
    };
    // Once it runs: whoever reads the port finds a device there.
    let told = Cell::new(false);
    let ended = || {
        if !told.replace(true) {
            println!("{line}");
        }
        false
    };
    device::run_device(&map, &config, listener, &ended)?;
    Ok(ExitCode::SUCCESS)
}

/// What nobody outside of this process knows, and another one each time.
fn seed() -> u64 {
    RandomState::new().build_hasher().finish()
}

#[cfg(unix)]
fn pty() -> Result<Listener> {
    Ok(Listener::Pty(Box::new(anyhow::Context::context(virtual_servos::serve::Pty::open(), NO_PTY)?)))
}

#[cfg(not(unix))]
fn pty() -> Result<Listener> {
    anyhow::bail!(NO_PTY)
}

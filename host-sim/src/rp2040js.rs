//! Runs an image for the Raspberry Pi Pico on the emulator rp2040js, with servos on its UART 0 and a host on its UART 1.
//!
//! What rp2040js lacks is written at the top of rp2040js.mjs, which runs in Node.js.

use crate::qemu_log::Log;
use crate::signals::Folder;
use anyhow::{Context, Result, anyhow, bail};
use std::io::{ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use thumb_cycles::{Board, Image, Memory};
use virtual_servos::hobby::Pins;

/// What Node.js runs.
const SCRIPT: &str = include_str!("rp2040js.mjs");

/// Where the flash is.
const FLASH: u32 = 0x1000_0000;

/// The chip's clock in hertz, as embassy sets it up.
pub const CLOCK_HZ: u32 = 125_000_000;

/// Where `cargo xtask setup` puts the npm package.
pub fn package() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/npm/node_modules/rp2040js")
}

/// How a run went.
#[derive(Clone, Copy, Debug, serde::Deserialize, serde::Serialize)]
pub struct Figures {
    /// Cycles in which the core was awake.
    pub cycles: u64,
    /// Instructions executed.
    pub instructions: u64,
    /// Simulated time.
    pub nanos: u64,
    /// The longest time from the end of a packet to the change of direction.
    pub turnaround_nanos: u64,
}

/// What is on the other end of a UART: takes bytes, gives the bytes that it answers.
pub type Device<'d> = dyn FnMut(&[u8]) -> Vec<u8> + 'd;

/// What is on the other end of the host's line, once a simulated millisecond; none ends the simulation.
pub type Host<'d> = dyn FnMut(&[u8]) -> Option<Vec<u8>> + 'd;

/// Who looks at the pins of hobby servos after each tick.
pub type Watcher<'d> = dyn FnMut(&Pins) + 'd;

/// What is around the Pico.
pub struct World<'w, 'd> {
    /// Takes what was sent on the bus when the line falls silent, and gives the answer.
    pub servos: &'w mut Device<'d>,
    /// Is shown the pins of hobby servos after each tick.
    pub pins: &'w mut Watcher<'d>,
    /// With a host, a watchdog that is not fed starts the chip again, which the log is told; without one it is the end.
    pub host: Option<&'w mut Host<'d>>,
    /// Simulated time after which the core is in an endless loop with its interrupts masked, until the watchdog bites; with a host only.
    pub hang: Option<Duration>,
}

/// Runs an image until it logs that the puppet rests or, with a host, until that ends it. `package` is the folder of the npm
/// package rp2040js. `log` gets every line that the image logs.
///
/// # Errors
/// A sentence that says what is missing or went wrong: no Node.js, no package, an error in the image's log (with a host that is
/// not the end), no end within `limit` of simulated time.
pub fn run(
    elf: &[u8],
    package: &Path,
    world: World<'_, '_>,
    limit: Duration,
    log: &mut dyn FnMut(&str),
) -> Result<Figures> {
    if !package.join("package.json").is_file() {
        bail!("{} is not the npm package rp2040js: run `cargo xtask setup`", package.display());
    }
    let image = Image::parse(elf)?;
    let rtt =
        image.symbol("_SEGGER_RTT").ok_or_else(|| anyhow!("the image has no log: no symbol _SEGGER_RTT"))?;
    let mut memory = Memory::new(Board::rp2040().regions)?;
    image.load_into(&mut memory)?;
    let folder = Folder::new()?;
    let (flash, script) = (folder.path().join("flash.bin"), folder.path().join("rp2040js.mjs"));
    let bytes = memory.bytes(FLASH, IMAGE_BYTES).ok_or_else(|| anyhow!("the board has no flash"))?;
    std::fs::write(&flash, bytes).context("cannot write a temporary file")?;
    std::fs::write(&script, SCRIPT).context("cannot write a temporary file")?;
    // A file and not a pipe: nobody reads it before the end.
    let mut complaints = tempfile::tempfile().context("cannot create a temporary file")?;
    let child = Command::new("node")
        .arg(script)
        .args([package, &flash])
        .args([rtt.to_string(), limit.as_secs().to_string()])
        .args(world.host.is_some().then_some("host"))
        .args(world.hang.filter(|_| world.host.is_some()).map(|hang| hang.as_millis().to_string()))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(complaints.try_clone().context("cannot write a temporary file")?)
        .spawn()
        .context("cannot start node, which runs rp2040js (Debian's package nodejs)")?;
    let mut emulator = Emulator { child, log: Log::new(elf)?, rests: false, failed: None };
    let figures = emulator.serve(world, log);
    drop(emulator);
    figures.map_err(|error| {
        let mut said = String::new();
        let read = complaints.rewind().and_then(|()| complaints.read_to_string(&mut said));
        let said = if read.is_ok() { thrown(&said) } else { None };
        match said {
            Some(said) => error.context(said.to_owned()),
            None => error,
        }
    })
}

/// Bytes of the Pico's flash that are the image's. The others, for clips, are erased.
const IMAGE_BYTES: usize = 1 << 20;

/// What a script that failed said about it.
fn thrown(said: &str) -> Option<&str> {
    said.lines().find_map(|line| line.strip_prefix("Error: ")).or_else(|| said.lines().last())
}

/// Node.js, which does not outlive this.
struct Emulator {
    child: Child,
    log: Log,
    rests: bool,
    /// The first error in the log.
    failed: Option<String>,
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // An error means that it is gone already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Emulator {
    /// Serves messages until the end.
    fn serve(&mut self, world: World<'_, '_>, log: &mut dyn FnMut(&str)) -> Result<Figures> {
        let World { servos, pins, mut host, .. } = world;
        let (Some(mut from), Some(mut to)) = (self.child.stdout.take(), self.child.stdin.take()) else {
            bail!("node has no pipes");
        };
        loop {
            let message = match read(&mut from) {
                Ok(message) => message,
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => bail!("rp2040js has ended early"),
                Err(error) => return Err(error).context("cannot read from rp2040js"),
            };
            let answer = match message {
                (0 | 4, _) if self.rests && host.is_none() => None,
                (0, bytes) => Some(servos(&bytes)),
                (1, bytes) => {
                    self.hear(&bytes, log)?;
                    match self.failed.take() {
                        Some(failed) if host.is_none() => bail!("the board logs: {failed}"),
                        _ => continue,
                    }
                }
                (5, bytes) => {
                    log(&String::from_utf8_lossy(&bytes));
                    continue;
                }
                (2, bytes) => return serde_json::from_slice(&bytes).context("rp2040js' figures"),
                (4, bytes) => {
                    pins(&Pins::parse(&bytes).context("rp2040js tells of its pins something else")?);
                    Some(Vec::new())
                }
                (_, bytes) => host.as_mut().and_then(|host| host(&bytes)),
            };
            let length = match &answer {
                Some(answer) => u32::try_from(answer.len())?,
                None => u32::MAX,
            };
            to.write_all(&length.to_le_bytes())
                .and_then(|()| to.write_all(&answer.unwrap_or_default()))
                .context("cannot write to rp2040js")?;
        }
    }

    fn hear(&mut self, bytes: &[u8], log: &mut dyn FnMut(&str)) -> Result<()> {
        let Self { log: decoder, rests, failed, .. } = self;
        decoder.take(bytes, &mut |line| {
            log(line);
            *rests |= line.starts_with("info: rests after");
            if failed.is_none() {
                *failed = line.strip_prefix("error: ").map(str::to_owned);
            }
        })
    }
}

/// A message: its kind and its bytes.
fn read(from: &mut impl Read) -> std::io::Result<(u8, Vec<u8>)> {
    let mut head = [0; 5];
    from.read_exact(&mut head)?;
    let [kind, length @ ..] = head;
    let mut bytes = Vec::new();
    let length = u64::from(u32::from_le_bytes(length));
    if from.take(length).read_to_end(&mut bytes)? as u64 != length {
        return Err(ErrorKind::UnexpectedEof.into());
    }
    Ok((kind, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_whole_or_refused() {
        let bytes = [1, 2, 0, 0, 0, 7, 8, 0, 0, 0, 0, 0];
        let mut from = &bytes[..];
        assert_eq!(read(&mut from).unwrap(), (1, vec![7, 8]));
        assert_eq!(read(&mut from).unwrap(), (0, vec![]));
        assert_eq!(read(&mut &bytes[..6]).unwrap_err().kind(), ErrorKind::UnexpectedEof);
    }

    #[test]
    fn a_folder_without_the_package_is_named() {
        let path = Path::new("no/such");
        let world = World { servos: &mut |_| Vec::new(), pins: &mut |_| {}, host: None, hang: None };
        let error = run(b"", path, world, Duration::ZERO, &mut |_| {});
        assert!(error.unwrap_err().to_string().contains("no/such"));
    }

    #[test]
    fn what_a_script_throws_is_found_in_what_it_says() {
        let said =
            "file:///rp2040js.mjs:9\n  throw new Error()\n\nError: the watchdog was not fed\n    at x\n";
        assert_eq!(thrown(said), Some("the watchdog was not fed"));
    }
}

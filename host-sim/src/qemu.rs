//! Runs an image under QEMU: its log, its exit code, and the device on its UART.

use crate::files;
use crate::qemu_log::Log;
use anyhow::{Context, Result, bail};
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

/// The emulator.
const PROGRAM: &str = "qemu-system-arm";

/// How often something that cannot be waited for is looked at.
const POLL: Duration = Duration::from_millis(5);

/// What is on the other end of UART 0: takes bytes, gives the bytes that it answers.
pub type Device<'d> = dyn FnMut(&[u8]) -> Vec<u8> + Send + 'd;

/// An image and the machine that it is for.
#[derive(Clone, Debug)]
pub struct Image<'a> {
    /// The ELF file.
    pub path: &'a Path,
    /// QEMU's name of the board, for instance `mps2-an386`.
    pub machine: &'a str,
    /// What the image gets as its semihosting command line.
    pub arguments: &'a [&'a str],
}

/// Runs an image to its end, which it has to say by semihosting.
///
/// `log` gets every line that the image writes to semihosting's standard output, defmt decoded. Simulated time goes
/// by with the instructions that are executed (64 ns each), not with the time of this machine, so runs are alike.
///
/// # Errors
/// A sentence that says what is missing or went wrong: no QEMU, an exit code other than 0, no end within `limit`.
pub fn run_image(
    image: &Image<'_>,
    device: Option<&mut Device<'_>>,
    limit: Duration,
    log: &mut dyn FnMut(&str),
) -> Result<()> {
    let elf = files::read(image.path)?;
    let mut decoder = Log::new(&elf).with_context(|| image.path.display().to_string())?;
    let listener = TcpListener::bind("127.0.0.1:0").context("cannot listen for QEMU's UART")?;
    let port = listener.local_addr().context("cannot listen for QEMU's UART")?.port();
    let serial =
        if device.is_some() { format!("tcp:127.0.0.1:{port},nodelay=on") } else { "null".to_owned() };
    let mut child = start(image, &serial)?;
    let (stdout, stderr) = (child.0.stdout.take(), child.0.stderr.take());
    let ended = AtomicBool::new(false);
    let deadline = Instant::now() + limit;
    let mut last_line = String::new();

    thread::scope(|scope| {
        let device = device.map(|device| scope.spawn(|| serve(&listener, device, &ended)));
        let complaints = scope.spawn(|| {
            let mut text = String::new();
            // What cannot be read cannot be reported.
            let _ = stderr.map(|mut stderr| stderr.read_to_string(&mut text));
            text
        });
        let (sender, receiver) = channel();
        scope.spawn(move || {
            let mut stdout = stdout?;
            let mut buffer = [0; 4096];
            loop {
                match stdout.read(&mut buffer) {
                    Ok(0) | Err(_) => return None::<()>,
                    Ok(count) => sender.send(buffer[..count].to_vec()).ok()?,
                }
            }
        });
        let mut timed_out = false;
        let read = loop {
            let left = deadline.saturating_duration_since(Instant::now());
            match receiver.recv_timeout(left) {
                Ok(bytes) => {
                    let result = decoder.take(&bytes, &mut |line| {
                        log(line);
                        line.clone_into(&mut last_line);
                    });
                    if result.is_err() {
                        break result;
                    }
                }
                Err(RecvTimeoutError::Disconnected) => break Ok(()),
                Err(RecvTimeoutError::Timeout) => {
                    timed_out = true;
                    break Ok(());
                }
            }
        };
        if timed_out || read.is_err() {
            child.stop();
        }
        let status = child.wait(deadline);
        ended.store(true, Ordering::Relaxed);
        let served = device.map_or(Ok(()), |device| joined(device.join()));
        let complaints = joined(complaints.join());
        read?;
        let Some(status) = status.filter(|_| !timed_out) else {
            bail!("{} did not end within {} s{}", image.path.display(), limit.as_secs(), after(&last_line));
        };
        if !status.success() {
            bail!(
                "{} ended with {status}{}{}",
                image.path.display(),
                after(&last_line),
                after(complaints.trim())
            );
        }
        served
    })
}

/// `: what was said`, if anything was.
fn after(said: &str) -> String {
    if said.is_empty() { String::new() } else { format!(": {said}") }
}

/// A thread's result; its panic goes on here.
fn joined<T>(result: thread::Result<T>) -> T {
    result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// QEMU, which does not outlive this.
struct Machine(Child);

impl Machine {
    fn stop(&mut self) {
        // An error means that it is gone already.
        let _ = self.0.kill();
    }

    /// Its exit status, if it ends before `deadline`.
    fn wait(&mut self, deadline: Instant) -> Option<ExitStatus> {
        loop {
            if let Ok(Some(status)) = self.0.try_wait() {
                return Some(status);
            }
            if Instant::now() >= deadline {
                return None;
            }
            thread::sleep(POLL);
        }
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        self.stop();
        let _ = self.0.wait();
    }
}

fn start(image: &Image<'_>, serial: &str) -> Result<Machine> {
    let mut semihosting = "enable=on,target=native".to_owned();
    for argument in image.arguments {
        // QEMU's own escape for a comma in a value.
        semihosting.push_str(&format!(",arg={}", argument.replace(',', ",,")));
    }
    let child = Command::new(PROGRAM)
        .args(["-machine", image.machine, "-display", "none", "-monitor", "none", "-serial", serial])
        .args(["-icount", "shift=6,sleep=off", "-semihosting-config", &semihosting, "-kernel"])
        .arg(image.path)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    match child {
        Ok(child) => Ok(Machine(child)),
        Err(error) if error.kind() == ErrorKind::NotFound => bail!(
            "{PROGRAM} is not installed (Debian, Ubuntu: apt-get install --no-install-recommends {PROGRAM})"
        ),
        Err(error) => Err(error).with_context(|| format!("cannot start {PROGRAM}")),
    }
}

/// Connects the device to QEMU's UART, until QEMU closes it.
fn serve(listener: &TcpListener, device: &mut Device<'_>, ended: &AtomicBool) -> Result<()> {
    let context = "QEMU's UART";
    listener.set_nonblocking(true).context(context)?;
    let mut stream = loop {
        match listener.accept() {
            Ok((stream, _)) => break stream,
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                if ended.load(Ordering::Relaxed) {
                    return Ok(());
                }
                thread::sleep(POLL);
            }
            Err(error) => return Err(error).context(context),
        }
    };
    stream.set_nonblocking(false).context(context)?;
    // Packets are short, and the board waits for their answers.
    stream.set_nodelay(true).context(context)?;
    exchange(&mut stream, device).context(context)
}

fn exchange(stream: &mut TcpStream, device: &mut Device<'_>) -> std::io::Result<()> {
    let mut buffer = [0; 4096];
    loop {
        match stream.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(count) => stream.write_all(&device(&buffer[..count]))?,
            // How the other end's exit may look.
            Err(error) if error.kind() == ErrorKind::ConnectionReset => return Ok(()),
            Err(error) => return Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_image_is_refused() {
        let image = Image { path: Path::new("Cargo.toml"), machine: "mps2-an386", arguments: &[] };
        let error = run_image(&image, None, Duration::from_secs(1), &mut |_| {}).unwrap_err();
        assert!(format!("{error:#}").contains("Cargo.toml"), "{error:#}");
    }
}

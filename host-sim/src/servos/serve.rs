//! A bus on a pseudo terminal or a TCP port, in real time.
//!
//! Clients time out within tens of milliseconds, so a thread blocks on reading and answers at once; the servos are
//! simulated up to now whenever bytes arrive, which makes a clock of their own unnecessary.

use super::{Event, Wire};
use anyhow::Context;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Patience of a served bus in microseconds: operating systems and networks may cut a packet in two.
pub const BYTE_GAP_US: u64 = 20_000;

/// Servos that are served.
pub struct Served {
    /// What they hang on.
    pub wire: Box<dyn Wire>,
    /// Since when they have power.
    pub power_on: Instant,
    /// Is told of every goal position and every refusal.
    pub tap: Box<dyn FnMut(Event) + Send>,
}

impl Served {
    /// Servos whose power comes on now, of whom nobody takes notes.
    #[must_use]
    pub fn new(wire: Box<dyn Wire>) -> Self {
        Self { wire, power_on: Instant::now(), tap: Box::new(|_| {}) }
    }
}

/// Answers on `line` until it ends.
///
/// # Errors
/// What reading or writing says.
fn answer(served: &mut Served, line: &mut (impl Read + Write)) -> std::io::Result<()> {
    let Served { wire, power_on, tap } = served;
    let mut bytes = [0; 4096];
    loop {
        let count = match line.read(&mut bytes) {
            Ok(0) => return Ok(()),
            Ok(count) => count,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        let now_us = u64::try_from(power_on.elapsed().as_micros()).unwrap_or(u64::MAX);
        let reply = wire.receive(&bytes[..count], now_us, tap);
        line.write_all(&reply)?;
    }
}

/// A pseudo terminal whose other end is a serial port to clients.
#[cfg(unix)]
pub struct Pty {
    controller: Controller,
    path: PathBuf,
}

#[cfg(unix)]
impl Pty {
    /// Opens a pseudo terminal in raw mode.
    ///
    /// # Errors
    /// A sentence when the system has none.
    pub fn open() -> anyhow::Result<Self> {
        use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
        use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
        let open = || -> Result<_, std::io::Error> {
            let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
            grantpt(&controller)?;
            unlockpt(&controller)?;
            let path = PathBuf::from(ptsname(&controller, Vec::new())?.to_string_lossy().into_owned());
            let port = std::fs::File::options().read(true).write(true).open(&path)?;
            let mut mode = tcgetattr(&port)?;
            mode.make_raw();
            tcsetattr(&port, OptionalActions::Now, &mode)?;
            let flags = rustix::fs::fcntl_getfl(&controller)?;
            rustix::fs::fcntl_setfl(&controller, flags | rustix::fs::OFlags::NONBLOCK)?;
            Ok(Self { controller: Controller { controller: controller.into(), port }, path })
        };
        open().context("cannot open a pseudo terminal; --listen tcp:127.0.0.1:0 does without")
    }

    /// Where clients find the serial port.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads what has come, without waiting.
    ///
    /// # Errors
    /// [`ErrorKind::WouldBlock`] where nothing has; what the system says.
    pub fn read_now(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        self.controller.unlock()?;
        self.controller.controller.read(bytes)
    }

    /// Answers clients for ever.
    ///
    /// # Errors
    /// A sentence when the pseudo terminal fails.
    pub fn serve(&mut self, mut served: Served) -> anyhow::Result<()> {
        answer(&mut served, &mut self.controller)
            .with_context(|| format!("the pseudo terminal {} failed", self.path.display()))
    }
}

/// The servos' end of a pseudo terminal. Reading waits; what a client does not read is lost in the end, as on a wire,
/// so that one who never reads cannot stop the bus.
#[cfg(unix)]
struct Controller {
    controller: std::fs::File,
    /// The clients' end, held open so that a client may close it and come back.
    port: std::fs::File,
}

#[cfg(unix)]
impl Controller {
    /// A client that took the port for itself and died would lock out the next one.
    fn unlock(&self) -> std::io::Result<()> {
        Ok(rustix::termios::ioctl_tiocnxcl(&self.port)?)
    }
}

#[cfg(unix)]
impl Read for Controller {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        use rustix::event::{PollFd, PollFlags, poll};
        poll(&mut [PollFd::new(&self.controller, PollFlags::IN)], None)?;
        self.unlock()?;
        match self.controller.read(bytes) {
            Err(error) if error.kind() == ErrorKind::WouldBlock => Err(ErrorKind::Interrupted.into()),
            result => result,
        }
    }
}

#[cfg(unix)]
impl Write for Controller {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self.controller.write(bytes) {
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(bytes.len()),
            result => result,
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.controller.flush()
    }
}

#[cfg(unix)]
impl Write for Pty {
    /// What nobody reads is lost, as on a wire.
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.controller.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.controller.flush()
    }
}

/// A TCP port; one client at a time, as on a serial line.
pub struct Tcp(TcpListener);

impl Tcp {
    /// Listens on `address` (`host:port`; port 0 is any free one).
    ///
    /// # Errors
    /// A sentence when the address is none or taken.
    pub fn bind(address: &str) -> anyhow::Result<Self> {
        Ok(Self(TcpListener::bind(address).with_context(|| format!("cannot listen on tcp:{address}"))?))
    }

    /// The address that clients connect to.
    ///
    /// # Errors
    /// What the system says.
    pub fn address(&self) -> std::io::Result<SocketAddr> {
        self.0.local_addr()
    }

    /// Answers one client after the other for ever; the servos stay as the last one left them.
    ///
    /// # Errors
    /// A sentence when no client can be accepted; a client that fails only ends itself.
    pub fn serve(&mut self, mut served: Served) -> anyhow::Result<()> {
        loop {
            let (mut client, address) = self.0.accept().context("cannot accept a client")?;
            let ended = client.set_nodelay(true).and_then(|()| answer(&mut served, &mut client));
            if let Err(error) = ended {
                eprintln!("bunraku: the client {address} is gone: {error}");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::servos::{Bus, BusConfig};
    use std::net::TcpStream;
    use std::time::Duration;

    const PING: [u8; 10] = [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4E];
    const PONG: usize = 14;

    fn bus() -> Served {
        let config = BusConfig { byte_gap_us: BYTE_GAP_US, ..BusConfig::with_ids(&[1]) };
        Served::new(Box::new(Bus::new(&config).unwrap()))
    }

    fn ping(line: &mut (impl Read + Write)) {
        line.write_all(&PING).unwrap();
        let mut pong = [0; PONG];
        line.read_exact(&mut pong).unwrap();
        assert_eq!(pong[..8], [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x07, 0x00, 0x55]);
    }

    #[test]
    fn tcp_serves_one_client_after_the_other() {
        let mut tcp = Tcp::bind("127.0.0.1:0").unwrap();
        let address = tcp.address().unwrap();
        std::thread::spawn(move || tcp.serve(bus()));
        for _ in 0..3 {
            let mut client = TcpStream::connect(address).unwrap();
            client.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
            ping(&mut client);
        }
    }

    #[test]
    fn an_address_that_is_none_is_named() {
        let error = format!("{:#}", Tcp::bind("nowhere").err().unwrap());
        assert!(error.contains("tcp:nowhere"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn a_client_that_never_reads_does_not_stop_the_bus() {
        let mut pty = Pty::open().unwrap();
        let path = pty.path().to_owned();
        std::thread::spawn(move || pty.serve(bus()));
        let open = || std::fs::File::options().read(true).write(true).open(&path).unwrap();
        let mut deaf = open();
        for _ in 0..20_000 {
            deaf.write_all(&PING).unwrap();
        }
        drop(deaf);
        let mut client = open();
        rustix::termios::tcflush(&client, rustix::termios::QueueSelector::IOFlush).unwrap();
        // Answers to the deaf client may still be on their way: look for ours behind them.
        client.write_all(&PING).unwrap();
        let mut pong = [0; PONG];
        client.read_exact(&mut pong).unwrap();
    }
}

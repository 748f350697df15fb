//! A bus on a pseudo terminal or a TCP port, in real time.
//!
//! Clients time out within tens of milliseconds, so a thread blocks on reading and answers at once; the servos are
//! simulated up to now whenever bytes arrive, which makes a clock of their own unnecessary.

use crate::virtual_bus::{Event, VirtualBus};
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::time::Instant;
use thiserror::Error;

/// Patience of a served bus in microseconds: operating systems and networks may cut a packet in two.
pub const BYTE_GAP_US: u64 = 20_000;

/// Why servos cannot be served.
#[derive(Debug, Error)]
pub enum ServeError {
    /// The system gives no pseudo terminal.
    #[error("cannot open a pseudo terminal")]
    OpenPty(#[source] std::io::Error),
    /// A pseudo terminal failed.
    #[error("the pseudo terminal {} failed", path.display())]
    Pty {
        /// Where clients found it.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// An address is none, or is taken.
    #[error("cannot listen on tcp:{address}")]
    Listen {
        /// The address.
        address: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// No client can be accepted.
    #[error("cannot accept a client")]
    Accept(#[source] std::io::Error),
}

/// Servos that are served.
pub struct Served {
    /// The bus that they are on.
    pub bus: Box<dyn VirtualBus>,
    /// Since when they have power.
    pub power_on: Instant,
    /// Is told of every goal position and every refusal.
    pub tap: Box<dyn FnMut(Event) + Send>,
}

impl Served {
    /// Servos whose power comes on now, of whom nobody takes notes.
    #[must_use]
    pub fn new(bus: Box<dyn VirtualBus>) -> Self {
        Self { bus, power_on: Instant::now(), tap: Box::new(|_| {}) }
    }
}

/// Answers on `line` until it ends.
///
/// # Errors
/// What reading or writing says.
fn answer(served: &mut Served, line: &mut (impl Read + Write)) -> std::io::Result<()> {
    let Served { bus, power_on, tap } = served;
    let mut bytes = [0; 4096];
    loop {
        let count = match line.read(&mut bytes) {
            Ok(0) => return Ok(()),
            Ok(count) => count,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        let now_us = u64::try_from(power_on.elapsed().as_micros()).unwrap_or(u64::MAX);
        let reply = bus.receive(&bytes[..count], now_us, tap);
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
    /// [`ServeError::OpenPty`] when the system has none.
    pub fn open() -> Result<Self, ServeError> {
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
        open().map_err(ServeError::OpenPty)
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
    /// [`ServeError::Pty`] when the pseudo terminal fails.
    pub fn serve(&mut self, mut served: Served) -> Result<(), ServeError> {
        answer(&mut served, &mut self.controller)
            .map_err(|source| ServeError::Pty { path: self.path.clone(), source })
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
    /// [`ServeError::Listen`] when the address is none or taken.
    pub fn bind(address: &str) -> Result<Self, ServeError> {
        let listener = TcpListener::bind(address);
        listener.map(Self).map_err(|source| ServeError::Listen { address: address.to_owned(), source })
    }

    /// The address that clients connect to.
    ///
    /// # Errors
    /// What the system says.
    pub fn address(&self) -> std::io::Result<SocketAddr> {
        self.0.local_addr()
    }

    /// Answers one client after the other for ever; the servos stay as the last one left them. `gone` is told of each
    /// client whose connection failed, and why.
    ///
    /// # Errors
    /// [`ServeError::Accept`] when no client can be accepted; a client that fails only ends itself.
    pub fn serve(
        &mut self,
        mut served: Served,
        mut gone: impl FnMut(SocketAddr, std::io::Error),
    ) -> Result<(), ServeError> {
        loop {
            let (mut client, address) = self.0.accept().map_err(ServeError::Accept)?;
            let ended = client.set_nodelay(true).and_then(|()| answer(&mut served, &mut client));
            if let Err(error) = ended {
                gone(address, error);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamixel_bus::{DynamixelConfig, DynamixelServos};
    use std::net::TcpStream;
    use std::time::Duration;

    const PING: [u8; 10] = [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4E];
    const PONG: usize = 14;

    fn bus() -> Served {
        let config = DynamixelConfig { byte_gap_us: BYTE_GAP_US, ..DynamixelConfig::with_ids(&[1]) };
        Served::new(Box::new(DynamixelServos::new(&config).unwrap()))
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
        std::thread::spawn(move || tcp.serve(bus(), |_, _| ()));
        for _ in 0..3 {
            let mut client = TcpStream::connect(address).unwrap();
            client.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
            ping(&mut client);
        }
    }

    #[test]
    fn an_address_that_is_none_is_named() {
        let error = Tcp::bind("nowhere").err().unwrap().to_string();
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

//! The hosts of a virtual device, on TCP connections or a pseudo terminal, none of which is ever waited for.

use anyhow::{Context, Result};
use firmware::link::session::Session;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
#[cfg(unix)]
use virtual_servos::serve::Pty;

/// Hosts that a device talks to at a time.
const HOSTS: usize = 4;

/// Bytes that are read in a tick, and wait, at most.
const INPUT: usize = 4096;

/// Where hosts come from.
pub enum Listener {
    /// Up to four connections.
    Tcp(TcpListener),
    /// One serial port.
    #[cfg(unix)]
    Pty(Box<Pty>),
}

impl Listener {
    /// Listens on `HOST:PORT`; port 0 takes a free one.
    ///
    /// # Errors
    /// A sentence with the address.
    pub fn tcp(address: &str) -> Result<Self> {
        let listener =
            TcpListener::bind(address).with_context(|| format!("cannot listen on tcp:{address}"))?;
        listener.set_nonblocking(true).context("cannot listen without waiting")?;
        Ok(Self::Tcp(listener))
    }

    /// What a host opens.
    ///
    /// # Errors
    /// What the system says.
    pub fn name(&self) -> Result<String> {
        match self {
            Self::Tcp(listener) => Ok(format!("tcp:{}", listener.local_addr()?)),
            #[cfg(unix)]
            Self::Pty(pty) => Ok(pty.path().display().to_string()),
        }
    }
}

/// A host, and what was said.
struct Host {
    connection: Connection,
    session: Session,
    input: Vec<u8>,
}

enum Connection {
    Tcp(TcpStream),
    /// The listener's own.
    Pty,
    /// A host that is gone and had to be there.
    Gone,
}

/// All hosts.
pub struct Hosts {
    listener: Listener,
    hosts: Vec<Host>,
}

impl Hosts {
    /// Nobody is there yet.
    pub fn new(listener: Listener) -> Self {
        let host = Host { connection: Connection::Pty, session: Session::new(), input: Vec::new() };
        let hosts = if matches!(listener, Listener::Tcp(_)) { Vec::new() } else { vec![host] };
        Self { listener, hosts }
    }

    /// Takes new hosts, reads what has come, gives each session its bytes, and sends what it has to say.
    pub fn serve(&mut self, mut serve: impl FnMut(&mut Session, &mut &[u8])) {
        self.accept();
        let Self { listener, hosts } = self;
        for host in hosts.iter_mut() {
            let mut buffer = [0; INPUT];
            let room = INPUT.saturating_sub(host.input.len());
            let read = match (&mut host.connection, &mut *listener) {
                (Connection::Tcp(stream), _) => stream.read(&mut buffer[..room]),
                #[cfg(unix)]
                (Connection::Pty, Listener::Pty(pty)) => pty.read_now(&mut buffer[..room]),
                _ => Err(ErrorKind::WouldBlock.into()),
            };
            let mut ended = matches!((&host.connection, &read), (Connection::Tcp(_), Ok(0)) if room > 0);
            match read {
                Ok(count) => host.input.extend(&buffer[..count]),
                Err(error) => ended |= !waits(error.kind()),
            }
            let mut rest = host.input.as_slice();
            serve(&mut host.session, &mut rest);
            let taken = host.input.len() - rest.len();
            host.input.drain(..taken);
            let outgoing = host.session.outgoing();
            let written = match (&mut host.connection, &mut *listener) {
                _ if outgoing.is_empty() => Ok(0),
                (Connection::Tcp(stream), _) => stream.write(outgoing),
                #[cfg(unix)]
                (Connection::Pty, Listener::Pty(pty)) => pty.write(outgoing),
                // Nobody reads it.
                _ => Ok(outgoing.len()),
            };
            match written {
                Ok(count) => host.session.sent(count),
                Err(error) => ended |= !waits(error.kind()),
            }
            if ended && matches!(host.connection, Connection::Tcp(_)) {
                host.connection = Connection::Gone;
                host.input.clear();
            }
        }
        // Who had to be there is missed until that is noticed.
        hosts.retain(|host| !matches!(host.connection, Connection::Gone) || host.session.is_held());
    }

    fn accept(&mut self) {
        let Listener::Tcp(listener) = &self.listener else { return };
        while let Ok((stream, _)) = listener.accept() {
            if stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true)).is_err() {
                continue;
            }
            let connection = Connection::Tcp(stream);
            // As on a serial line, where one host goes and another comes.
            if let Some(host) = self.hosts.iter_mut().find(|host| matches!(host.connection, Connection::Gone))
            {
                host.connection = connection;
            } else if self.hosts.len() < HOSTS {
                self.hosts.push(Host { connection, session: Session::new(), input: Vec::new() });
            }
        }
    }
}

fn waits(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

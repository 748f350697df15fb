//! The hosts of a virtual device, on TCP connections or a pseudo terminal, none of which is ever waited for.

use anyhow::{Context, Result};
use firmware::link::key::Lock;
use firmware::link::session::Session;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
#[cfg(unix)]
use virtual_servos::serve::Pty;

/// Hosts that a device has places for.
pub const HOSTS: u8 = 4;

/// Hosts besides them that can stop the puppet. Another one takes the turn of the one that came first.
pub const GUESTS: usize = 8;

/// Time in ms in which a connection has to begin a session, and after which one without a place ends.
pub const HELLO_MILLIS: u32 = 3_000;

/// Bytes that are read at once, and wait, at most.
const INPUT: usize = 4096;

/// How often a tick reads a line at most: 25 MB a second at 50 ticks.
const READS: usize = 128;

/// Where hosts come from.
pub enum Listener {
    /// Connections.
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

    /// Whether only programs on this computer can connect.
    ///
    /// # Errors
    /// What the system says.
    pub fn is_private(&self) -> Result<bool> {
        match self {
            Self::Tcp(listener) => Ok(listener.local_addr()?.ip().is_loopback()),
            #[cfg(unix)]
            Self::Pty(_) => Ok(true),
        }
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
    /// When it came, when it had a session last (or came), and when it took something last, in ms.
    came: u32,
    open: u32,
    read: u32,
    /// Whether it has a place; who has none only stops the puppet.
    seated: bool,
    /// How often bytes were looked at.
    #[cfg(test)]
    serves: u32,
}

enum Connection {
    Tcp(TcpStream),
    /// The listener's own.
    Pty,
    /// A host that is gone and had to be there.
    Gone,
}

/// What a line asks of hosts, and draws its challenges from.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// The key.
    pub lock: &'static dyn Lock,
    /// Drawn when the device was turned on.
    pub seed: u64,
}

/// All hosts.
pub struct Hosts {
    listener: Listener,
    key: Option<Key>,
    /// Connections so far.
    connections: u64,
    hosts: Vec<Host>,
}

impl Hosts {
    /// Nobody is there yet.
    pub fn new(listener: Listener, key: Option<Key>) -> Self {
        let mut hosts = Self { listener, key, connections: 0, hosts: Vec::new() };
        if !matches!(hosts.listener, Listener::Tcp(_)) {
            hosts.add(Connection::Pty, 0);
        }
        hosts
    }

    fn add(&mut self, connection: Connection, now: u32) {
        self.connections += 1;
        let locked = |key: Key| Session::locked(key.lock, key.seed.wrapping_add(self.connections));
        let session = self.key.map_or_else(Session::new, locked);
        self.hosts.push(Host {
            connection,
            session,
            input: Vec::new(),
            came: now,
            open: now,
            read: now,
            seated: false,
            #[cfg(test)]
            serves: 0,
        });
    }

    /// Takes new hosts, reads what has come, gives each session its bytes, and sends what it has to say. `now` is in ms of a clock
    /// that goes on, and may wrap.
    pub fn serve(&mut self, now: u32, mut serve: impl FnMut(&mut Session, &mut &[u8])) {
        self.accept(now);
        self.seat();
        let Self { listener, hosts, .. } = self;
        hosts.iter_mut().for_each(|host| host.serve(listener, now, &mut serve));
        // Places that become free are for those who wait, before their time is over too.
        self.end(now, true);
        self.seat();
        self.end(now, false);
    }

    fn accept(&mut self, now: u32) {
        let Listener::Tcp(listener) = &self.listener else { return };
        let mut streams = Vec::new();
        while streams.len() < GUESTS
            && let Ok((stream, _)) = listener.accept()
        {
            if stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true)).is_ok() {
                streams.push(stream);
            }
        }
        for stream in streams {
            let connection = Connection::Tcp(stream);
            // As on a serial line, where one host goes and another comes.
            if let Some(host) = self.hosts.iter_mut().find(|host| matches!(host.connection, Connection::Gone))
            {
                (host.connection, host.came, host.open, host.read) = (connection, now, now, now);
                continue;
            }
            let waiting = self.hosts.iter().filter(|host| !host.seated).count();
            let oldest = self.hosts.iter().position(|host| !host.seated);
            if waiting >= GUESTS
                && let Some(oldest) = oldest
            {
                self.hosts.remove(oldest);
            }
            self.add(connection, now);
        }
    }

    /// Ends the connections whose time is over, of those with a place or of the others.
    fn end(&mut self, now: u32, seated: bool) {
        for host in self.hosts.iter_mut().filter(|host| host.seated == seated) {
            if matches!(host.connection, Connection::Tcp(_)) && host.is_over(now) {
                host.hang_up();
            }
        }
        // Who had to be there is missed until that is noticed.
        self.hosts.retain(|host| !matches!(host.connection, Connection::Gone) || host.session.is_held());
    }

    /// Gives free places to those who have waited longest.
    fn seat(&mut self) {
        let mut free =
            usize::from(HOSTS).saturating_sub(self.hosts.iter().filter(|host| host.seated).count());
        for host in self.hosts.iter_mut().filter(|host| !host.seated) {
            host.seated = free > 0;
            free = free.saturating_sub(1);
            host.session.seat((!host.seated).then_some(HOSTS));
        }
    }
}

impl Host {
    /// Whether its place is for somebody else: it never said who it is, or there was nothing to hear or to tell for long.
    fn is_over(&self, now: u32) -> bool {
        let since = |time| now.wrapping_sub(time);
        let silent = since(self.came).min(self.session.silent(now)).min(since(self.read));
        match (self.seated, self.session.is_open()) {
            (true, true) => silent > self.session.idle_millis(),
            // Who begins another session has as long to prove the key as who came.
            (true, false) => since(self.open) > HELLO_MILLIS,
            (false, _) => since(self.came) > HELLO_MILLIS,
        }
    }

    fn hang_up(&mut self) {
        self.connection = Connection::Gone;
        self.input.clear();
        self.session.hang_up();
    }

    /// Reads until nothing is there, a request was answered, or a tick has no time for more: noise does not stand in the way of what
    /// comes behind it.
    fn serve(&mut self, listener: &mut Listener, now: u32, serve: &mut impl FnMut(&mut Session, &mut &[u8])) {
        if self.session.is_open() {
            self.open = now;
        }
        let before = self.session.outgoing().len();
        let mut ended = false;
        for _ in 0..READS {
            let mut buffer = [0; INPUT];
            let room = INPUT.saturating_sub(self.input.len());
            let read = match (&mut self.connection, &mut *listener) {
                (Connection::Tcp(stream), _) => stream.read(&mut buffer[..room]),
                #[cfg(unix)]
                (Connection::Pty, Listener::Pty(pty)) => pty.read_now(&mut buffer[..room]),
                _ => Err(ErrorKind::WouldBlock.into()),
            };
            let count = match read {
                Ok(0) => {
                    ended |= matches!(self.connection, Connection::Tcp(_)) && room > 0;
                    0
                }
                Ok(count) => count,
                Err(error) => {
                    ended |= !waits(error.kind());
                    0
                }
            };
            self.input.extend(&buffer[..count]);
            let mut rest = self.input.as_slice();
            serve(&mut self.session, &mut rest);
            #[cfg(test)]
            {
                self.serves += 1;
            }
            let taken = self.input.len() - rest.len();
            self.input.drain(..taken);
            if count == 0 || !self.input.is_empty() || self.session.outgoing().len() != before {
                break;
            }
        }
        let outgoing = self.session.outgoing();
        let written = match (&mut self.connection, &mut *listener) {
            _ if outgoing.is_empty() => Ok(0),
            (Connection::Tcp(stream), _) => stream.write(outgoing),
            #[cfg(unix)]
            (Connection::Pty, Listener::Pty(pty)) => pty.write(outgoing),
            // Nobody reads it.
            _ => Ok(outgoing.len()),
        };
        match written {
            Ok(count) => {
                if count > 0 {
                    self.read = now;
                }
                self.session.sent(count);
            }
            Err(error) => ended |= !waits(error.kind()),
        }
        if ended && matches!(self.connection, Connection::Tcp(_)) {
            self.hang_up();
        }
    }
}

fn waits(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests;

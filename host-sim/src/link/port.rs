//! Lines to a device. Nothing here waits longer than it says.

use serialport::SerialPort;
use std::io::{Error, ErrorKind, Read, Result, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// Time that opening a line and writing to it may take.
const LIMIT: Duration = Duration::from_secs(3);

/// A line to a device.
pub enum Port {
    /// A serial port or pseudo terminal.
    Serial(Box<dyn SerialPort>),
    /// A TCP connection.
    Tcp(TcpStream),
}

impl Port {
    /// Opens `tcp:HOST:PORT`, or the serial port of this name at `baud` bits per second.
    ///
    /// # Errors
    /// What the system says; within some seconds.
    pub fn open(name: &str, baud: u32) -> Result<Self> {
        let Some(address) = name.strip_prefix("tcp:") else {
            let port = serialport::new(name, baud).timeout(LIMIT).open()?;
            return Ok(Self::Serial(port));
        };
        let mut failed = Error::new(ErrorKind::NotFound, "there is no such host");
        for address in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, LIMIT) {
                Ok(stream) => {
                    stream.set_nodelay(true)?;
                    stream.set_write_timeout(Some(LIMIT))?;
                    return Ok(Self::Tcp(stream));
                }
                Err(error) => failed = error,
            }
        }
        Err(failed)
    }

    /// Reads what there is, waiting up to `limit` for it; 0 where nothing came.
    ///
    /// # Errors
    /// What the system says; [`ErrorKind::UnexpectedEof`] where the other end has closed the line.
    pub fn read(&mut self, bytes: &mut [u8], limit: Duration) -> Result<usize> {
        // 0 would mean for ever.
        let limit = limit.max(Duration::from_millis(1));
        let read = match self {
            Self::Serial(port) => {
                port.set_timeout(limit)?;
                port.read(bytes)
            }
            Self::Tcp(stream) => {
                stream.set_read_timeout(Some(limit))?;
                stream.read(bytes)
            }
        };
        match read {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            Err(error)
                if matches!(
                    error.kind(),
                    ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted
                ) =>
            {
                Ok(0)
            }
            read => read,
        }
    }

    /// Writes all of `bytes`.
    ///
    /// # Errors
    /// What the system says, after three seconds at most for every part that it takes.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        match self {
            Self::Serial(port) => {
                port.set_timeout(LIMIT)?;
                port.write_all(bytes)
            }
            Self::Tcp(stream) => stream.write_all(bytes),
        }
    }
}

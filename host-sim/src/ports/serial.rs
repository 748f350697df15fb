//! A serial port and the host's clock for the firmware's clients.

use anyhow::{Context, Result};
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use serialport::{ClearBuffer, SerialPort};
use std::future::{Future, poll_fn};
use std::io::{Read as _, Write as _};
use std::pin::pin;
use std::task::{Context as TaskContext, Poll, Waker};
use std::thread;
use std::time::{Duration, Instant};

/// How long the thread sleeps where nothing can go on.
const NAP: Duration = Duration::from_micros(50);

/// Time in which the system must take the bytes of a packet.
const WRITE_TIMEOUT: Duration = Duration::from_millis(200);

/// A serial port: reading never blocks, writing only until the bytes are out.
pub struct Serial(Box<dyn SerialPort>);

impl Serial {
    /// Opens the port at `path` at `baud` bits per second, 8N1, and drops what had come in.
    ///
    /// # Errors
    /// A sentence that names the port.
    pub fn open(path: &str, baud: u32) -> Result<Self> {
        let cannot = || format!("cannot open {path} at {baud} baud");
        let port = serialport::new(path, baud).timeout(WRITE_TIMEOUT).open().with_context(cannot)?;
        port.clear(ClearBuffer::Input).with_context(cannot)?;
        Ok(Self(port))
    }
}

fn failed(error: &std::io::Error) -> ErrorKind {
    match error.kind() {
        std::io::ErrorKind::TimedOut => ErrorKind::TimedOut,
        _ => ErrorKind::Other,
    }
}

impl ErrorType for Serial {
    type Error = ErrorKind;
}

impl Read for Serial {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ErrorKind> {
        poll_fn(|_| match self.0.bytes_to_read() {
            Ok(0) => Poll::Pending,
            Ok(_) => Poll::Ready(self.0.read(bytes).map_err(|error| failed(&error))),
            Err(_) => Poll::Ready(Err(ErrorKind::NotConnected)),
        })
        .await
    }
}

impl Write for Serial {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        self.0.write(bytes).map_err(|error| failed(&error))
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        self.0.flush().map_err(|error| failed(&error))
    }
}

/// The host's clock.
#[derive(Clone, Copy, Debug)]
pub struct RealTime;

impl DelayNs for RealTime {
    async fn delay_ns(&mut self, ns: u32) {
        until(Instant::now() + Duration::from_nanos(ns.into())).await;
    }
}

/// Returns at this time.
pub async fn until(end: Instant) {
    poll_fn(|_| if Instant::now() < end { Poll::Pending } else { Poll::Ready(()) }).await;
}

/// Runs to the end; the thread sleeps while nothing can go on.
pub fn block_on<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    loop {
        match future.as_mut().poll(&mut TaskContext::from_waker(Waker::noop())) {
            Poll::Ready(result) => return result,
            Poll::Pending => thread::sleep(NAP),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_that_is_none_is_named() {
        let error = format!("{:#}", Serial::open("/dev/no-such-port", 57_600).err().unwrap());
        assert!(error.starts_with("cannot open /dev/no-such-port at 57600 baud: "), "{error}");
    }

    #[test]
    fn time_passes() {
        let start = Instant::now();
        block_on(RealTime.delay_ms(3));
        assert!(start.elapsed() >= Duration::from_millis(3));
    }
}

//! UARTs whose driver calls a packet sent while its last bytes are still on their way to the line.

use embassy_futures::yield_now;
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::{ErrorType, Read, Write};

/// Bits on the line for a byte.
const BITS: u64 = 10;

/// A UART that knows whether it is still shifting bytes out.
pub trait Busy {
    /// Whether bytes are in its FIFO or on the line.
    fn busy(&self) -> bool;
}

/// Flushes until the line is idle, so that a half-duplex bus changes its direction neither too early nor a byte late: servos
/// with a return delay of 0 answer at once.
///
/// It sleeps for the time that the bytes take, and only then asks the UART again and again, at most two bytes' time at a stretch.
pub struct IdleLine<U> {
    uart: U,
    byte: Duration,
    /// When the first byte since the last flush was written, and how many there were.
    began: Instant,
    bytes: u32,
}

impl<U> IdleLine<U> {
    /// Over a UART at `baud` bits per second.
    pub fn new(uart: U, baud: u32) -> Self {
        let byte = Duration::from_micros(BITS * 1_000_000 / u64::from(baud.max(1)));
        Self { uart, byte, began: Instant::MIN, bytes: 0 }
    }
}

impl<U: ErrorType> ErrorType for IdleLine<U> {
    type Error = U::Error;
}

impl<U: Read> Read for IdleLine<U> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Self::Error> {
        self.uart.read(bytes).await
    }
}

impl<U: Write + Busy> Write for IdleLine<U> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        if self.bytes == 0 {
            self.began = Instant::now();
        }
        let count = self.uart.write(bytes).await?;
        self.bytes = self.bytes.saturating_add(u32::try_from(count).unwrap_or(u32::MAX));
        Ok(count)
    }

    async fn flush(&mut self) -> Result<(), Self::Error> {
        self.uart.flush().await?;
        // The UART cannot be through before that.
        let bytes = core::mem::take(&mut self.bytes);
        let through = self.began + self.byte * bytes;
        Timer::at(through).await;
        // Polling everything that waits takes longer than servos do, so the last bits are waited for on the spot.
        let late = through + self.byte * 2;
        while self.uart.busy() {
            if Instant::now() > late {
                yield_now().await;
            }
        }
        Ok(())
    }
}

//! The same buses for code without an executor, over blocking traits.
//!
//! ```
//! use embassy_futures::block_on;
//! use servo_wire::blocking::{Polled, PolledDelay};
//! use servo_wire::bus::{BusError, Goal, ServoBus};
//! use servo_wire::dynamixel::{DynamixelBus, DynamixelClient};
//! use servo_wire::port::{LineConfig, Port};
//!
//! /// Sends goals over a blocking UART; `direction` is high to send.
//! fn send<U, D, T>(uart: U, direction: D, timer: T, goals: &[Goal]) -> Result<(), BusError>
//! where
//!     U: embedded_io::Read + embedded_io::ReadReady + embedded_io::Write,
//!     D: embedded_hal::digital::OutputPin,
//!     T: embedded_hal::delay::DelayNs,
//! {
//!     let port = Port::new(Polled(uart), direction, PolledDelay::new(timer), LineConfig::uart(1_000_000));
//!     let mut bus: DynamixelBus<_, _, _> = DynamixelBus::new(DynamixelClient::new(port));
//!     block_on(bus.write_goals(goals))
//! }
//! ```

use core::future::poll_fn;
use core::task::Poll;
use embedded_hal::delay::DelayNs;
use embedded_io::{ErrorType, Read, ReadReady, Write};

/// A blocking serial port as an asynchronous one: it is asked again and again whether a byte is there.
#[derive(Clone, Copy, Debug)]
pub struct Polled<U>(pub U);

impl<U: ErrorType> ErrorType for Polled<U> {
    type Error = U::Error;
}

impl<U: Read + ReadReady> embedded_io_async::Read for Polled<U> {
    async fn read(&mut self, buf: &mut [u8]) -> Result<usize, Self::Error> {
        poll_fn(|context| match self.0.read_ready() {
            Ok(true) => Poll::Ready(self.0.read(buf)),
            Ok(false) => {
                context.waker().wake_by_ref();
                Poll::Pending
            }
            Err(error) => Poll::Ready(Err(error)),
        })
        .await
    }
}

impl<U: Write> embedded_io_async::Write for Polled<U> {
    async fn write(&mut self, buf: &[u8]) -> Result<usize, Self::Error> {
        self.0.write(buf)
    }

    async fn flush(&mut self) -> Result<(), Self::Error> {
        self.0.flush()
    }
}

/// A blocking delay as an asynchronous one: it waits in steps, and lets others run between them.
///
/// Time is counted in steps, so what runs between them makes a delay longer, never shorter.
#[derive(Clone, Copy, Debug)]
pub struct PolledDelay<D> {
    delay: D,
    step_ns: u32,
}

impl<D: DelayNs> PolledDelay<D> {
    /// Waits in steps of 10 µs, the time of a byte at 1 Mbit/s.
    pub const fn new(delay: D) -> Self {
        Self { delay, step_ns: 10_000 }
    }
}

impl<D: DelayNs> embedded_hal_async::delay::DelayNs for PolledDelay<D> {
    async fn delay_ns(&mut self, ns: u32) {
        let mut left = ns;
        poll_fn(|context| {
            if left == 0 {
                return Poll::Ready(());
            }
            let step = left.min(self.step_ns);
            self.delay.delay_ns(step);
            left = left.saturating_sub(step);
            context.waker().wake_by_ref();
            Poll::Pending
        })
        .await;
    }
}

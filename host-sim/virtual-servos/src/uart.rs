//! A line to virtual servos in this program, which answer at once: what they have not said by then they will not say.

use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{ErrorType, Read, Write};
use std::collections::VecDeque;
use std::convert::Infallible;
use std::future::pending;

/// The line; `hear` takes what is sent and gives what the servos answer.
pub struct InProcessUart<F> {
    hear: F,
    answers: VecDeque<u8>,
}

impl<F: FnMut(&[u8]) -> Vec<u8>> InProcessUart<F> {
    /// A silent line.
    pub const fn new(hear: F) -> Self {
        Self { hear, answers: VecDeque::new() }
    }
}

impl<F> ErrorType for InProcessUart<F> {
    type Error = Infallible;
}

impl<F: FnMut(&[u8]) -> Vec<u8>> Write for InProcessUart<F> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.answers.extend((self.hear)(bytes));
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl<F> Read for InProcessUart<F> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        if self.answers.is_empty() {
            pending::<()>().await;
        }
        let count = buffer.len().min(self.answers.len());
        for (to, from) in buffer.iter_mut().zip(self.answers.drain(..count)) {
            *to = from;
        }
        Ok(count)
    }
}

/// A timer whose time is over at once.
pub struct ZeroDelay;

impl DelayNs for ZeroDelay {
    async fn delay_ns(&mut self, _: u32) {}
}

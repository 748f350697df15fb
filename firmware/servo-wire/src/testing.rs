//! Pseudo-hardware of this crate's tests.

use embedded_hal_async::delay::DelayNs;

/// A timer whose time is over at once.
pub(crate) struct NoTime;

impl DelayNs for NoTime {
    async fn delay_ns(&mut self, _ns: u32) {}
}

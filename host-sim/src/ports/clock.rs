//! The clock that ticks are due by: this computer's, or one that a test moves on.

use super::serial;
use std::cell::Cell;
use std::time::{Duration, Instant};

/// A clock.
pub trait Clock {
    /// Time since a moment that stays the same.
    fn now(&self) -> Duration;

    /// Returns at this time, or later where whoever keeps the clock was busy.
    fn until(&self, time: Duration) -> impl Future<Output = ()>;
}

/// This computer's clock, from when it was made on.
#[derive(Clone, Copy, Debug)]
pub struct ComputerClock(Instant);

impl ComputerClock {
    /// A clock that begins at 0.
    #[must_use]
    pub fn start() -> Self {
        Self(Instant::now())
    }
}

/// Time that goes on at once, by as much as somebody waits for.
#[derive(Debug, Default)]
pub struct InstantClock(Cell<Duration>);

impl Clock for InstantClock {
    fn now(&self) -> Duration {
        self.0.get()
    }

    async fn until(&self, time: Duration) {
        self.0.set(self.0.get().max(time));
    }
}

impl Clock for ComputerClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }

    async fn until(&self, time: Duration) {
        serial::until(self.0 + time).await;
    }
}

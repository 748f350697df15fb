//! A clock that no machine is too slow for.

use host_sim::ports::Clock;
use std::cell::{Cell, RefCell};
use std::time::Duration;

/// Steps in which time goes on.
const STEP: Duration = Duration::from_millis(10);

/// Time that goes on at once, by as much as somebody waits for.
pub struct SimulatedClock<F> {
    now: Cell<Duration>,
    late: Cell<Duration>,
    each_step: RefCell<F>,
}

impl<F: FnMut(Duration)> SimulatedClock<F> {
    /// A clock at 0. `each_step` is told of the time after each 10 ms that somebody waits.
    pub fn new(each_step: F) -> Self {
        Self { now: Cell::default(), late: Cell::default(), each_step: RefCell::new(each_step) }
    }

    /// From now on whoever waits is woken so much too late, as by a machine that is busy.
    pub fn wake_late(&self, late: Duration) {
        self.late.set(late);
    }
}

impl<F: FnMut(Duration)> Clock for SimulatedClock<F> {
    fn now(&self) -> Duration {
        self.now.get()
    }

    async fn until(&self, time: Duration) {
        while self.now.get() < time {
            self.now.set((self.now.get() + STEP).min(time));
            (self.each_step.borrow_mut())(self.now.get());
        }
        self.now.set(self.now.get() + self.late.get());
    }
}

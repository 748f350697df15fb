//! Two buses as one.

use crate::bus::{BusError, Goal, Reading, ServoBus};

/// Two buses: the first `split` servos are on `first`, the rest on `second`. Nest for more.
///
/// A bus that fails never keeps the other from being served; the first error is returned after both had their turn.
#[derive(Debug)]
pub struct Both<A, B> {
    first: A,
    second: B,
    split: usize,
}

impl<A: ServoBus, B: ServoBus> Both<A, B> {
    /// Joins two buses. `split`: servos on `first`, 0 or more.
    pub const fn new(first: A, second: B, split: usize) -> Self {
        Self { first, second, split }
    }

    /// The two buses.
    pub fn into_parts(self) -> (A, B) {
        (self.first, self.second)
    }

    fn halves<'s>(&self, ids: &'s [u8]) -> (&'s [u8], &'s [u8]) {
        ids.split_at(self.split.min(ids.len()))
    }
}

/// One outcome of two: an error before none, but "cannot do that" only where neither could.
fn join(first: Result<(), BusError>, second: Result<(), BusError>) -> Result<(), BusError> {
    match (first, second) {
        (Err(BusError::Unsupported), other) | (other, Err(BusError::Unsupported)) => other,
        (first, second) => first.and(second),
    }
}

impl<A: ServoBus, B: ServoBus> ServoBus for Both<A, B> {
    fn reads(&self, index: usize) -> bool {
        match index.checked_sub(self.split) {
            None => self.first.reads(index),
            Some(index) => self.second.reads(index),
        }
    }

    async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let (first, second) = self.halves(ids);
        match index.checked_sub(self.split) {
            None => self.first.ping(first, index).await,
            Some(index) => self.second.ping(second, index).await,
        }
    }

    async fn set_torque(&mut self, ids: &[u8], index: usize, on: bool) -> Result<(), BusError> {
        let (first, second) = self.halves(ids);
        match index.checked_sub(self.split) {
            None => self.first.set_torque(first, index, on).await,
            Some(index) => self.second.set_torque(second, index, on).await,
        }
    }

    async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
        let (first, second) = goals.split_at(self.split.min(goals.len()));
        let first = self.first.write_goals(first).await;
        join(first, self.second.write_goals(second).await)
    }

    async fn read_all(&mut self, ids: &[u8], readings: &mut [Option<Reading>]) -> Result<(), BusError> {
        let (first_ids, second_ids) = self.halves(ids);
        let (first, second) = readings.split_at_mut(self.split.min(readings.len()));
        let first = self.first.read_all(first_ids, first).await;
        join(first, self.second.read_all(second_ids, second).await)
    }

    async fn reboot(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let (first, second) = self.halves(ids);
        match index.checked_sub(self.split) {
            None => self.first.reboot(first, index).await,
            Some(index) => self.second.reboot(second, index).await,
        }
    }

    async fn set_watchdog(&mut self, ids: &[u8], millis: u16) -> Result<(), BusError> {
        let (first, second) = self.halves(ids);
        let first = self.first.set_watchdog(first, millis).await;
        join(first, self.second.set_watchdog(second, millis).await)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::pin::pin;
    use core::task::{Context, Poll, Waker};

    /// Keeps what it was asked; answers with a fixed result, and reads positions `base + id`.
    #[derive(Default)]
    struct Log {
        base: i32,
        asked: Vec<(&'static str, Vec<u8>, usize)>,
        result: Option<BusError>,
    }

    impl Log {
        fn note(&mut self, what: &'static str, ids: &[u8], index: usize) -> Result<(), BusError> {
            self.asked.push((what, ids.to_vec(), index));
            self.result.map_or(Ok(()), Err)
        }
    }

    impl ServoBus for Log {
        fn reads(&self, index: usize) -> bool {
            index.is_multiple_of(2)
        }
        async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
            self.note("ping", ids, index)
        }
        async fn set_torque(&mut self, ids: &[u8], index: usize, on: bool) -> Result<(), BusError> {
            self.note(if on { "on" } else { "off" }, ids, index)
        }
        async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
            let ids: Vec<u8> = goals.iter().map(|goal| goal.id).collect();
            self.note("goals", &ids, goals.len())
        }
        async fn read_all(&mut self, ids: &[u8], readings: &mut [Option<Reading>]) -> Result<(), BusError> {
            for (&id, reading) in ids.iter().zip(readings.iter_mut()) {
                *reading = Some(Reading {
                    position: self.base + i32::from(id),
                    temperature: None,
                    millivolts: None,
                    load: None,
                    hardware_error: 0,
                    torque: None,
                });
            }
            self.note("read", ids, readings.len())
        }
        async fn reboot(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
            self.note("reboot", ids, index)
        }
        async fn set_watchdog(&mut self, ids: &[u8], millis: u16) -> Result<(), BusError> {
            self.note("watchdog", ids, millis.into())
        }
    }

    fn ready<T>(future: impl Future<Output = T>) -> T {
        match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(value) => value,
            Poll::Pending => panic!("nothing here waits"),
        }
    }

    fn log(base: i32, result: Option<BusError>) -> Log {
        Log { base, asked: Vec::new(), result }
    }

    const IDS: [u8; 5] = [4, 5, 6, 4, 9];

    #[test]
    fn each_servo_is_asked_on_its_bus() {
        let mut bus = Both::new(log(0, None), log(100, None), 3);
        for index in [0, 2, 3, 4] {
            ready(bus.ping(&IDS, index)).unwrap();
            ready(bus.set_torque(&IDS, index, true)).unwrap();
            ready(bus.reboot(&IDS, index)).unwrap();
        }
        assert_eq!([0, 1, 2, 3, 4].map(|index| bus.reads(index)), [true, false, true, true, false]);
        ready(bus.set_watchdog(&IDS, 200)).unwrap();
        let mut readings = [None; 5];
        ready(bus.read_all(&IDS, &mut readings)).unwrap();
        assert_eq!(readings.map(|reading| reading.unwrap().position), [4, 5, 6, 104, 109]);
        ready(bus.write_goals(&IDS.map(|id| Goal { id, position: 0 }))).unwrap();
        let (first, second) = bus.into_parts();
        let asked =
            |log: &Log| -> Vec<(&str, usize)> { log.asked.iter().map(|(w, _, i)| (*w, *i)).collect() };
        let [ping, on, reboot] = ["ping", "on", "reboot"];
        assert_eq!(
            asked(&first),
            [
                (ping, 0),
                (on, 0),
                (reboot, 0),
                (ping, 2),
                (on, 2),
                (reboot, 2),
                ("watchdog", 200),
                ("read", 3),
                ("goals", 3)
            ]
        );
        assert_eq!(
            asked(&second),
            [
                (ping, 0),
                (on, 0),
                (reboot, 0),
                (ping, 1),
                (on, 1),
                (reboot, 1),
                ("watchdog", 200),
                ("read", 2),
                ("goals", 2)
            ]
        );
        assert!(first.asked.iter().all(|(_, ids, _)| ids == &IDS[..3]));
        assert!(second.asked.iter().all(|(_, ids, _)| ids == &IDS[3..]));
    }

    #[test]
    fn one_bus_that_fails_leaves_the_other_served() {
        for (first, second, expected) in [
            (None, None, Ok(())),
            (Some(BusError::Port), None, Err(BusError::Port)),
            (None, Some(BusError::NoReply), Err(BusError::NoReply)),
            (Some(BusError::Port), Some(BusError::NoReply), Err(BusError::Port)),
            (Some(BusError::Unsupported), None, Ok(())),
            (None, Some(BusError::Unsupported), Ok(())),
            (Some(BusError::Unsupported), Some(BusError::Corrupt), Err(BusError::Corrupt)),
            (Some(BusError::Unsupported), Some(BusError::Unsupported), Err(BusError::Unsupported)),
        ] {
            let mut bus = Both::new(log(0, first), log(0, second), 3);
            assert_eq!(ready(bus.write_goals(&IDS.map(|id| Goal { id, position: 0 }))), expected);
            let mut readings = [None; 5];
            assert_eq!(ready(bus.read_all(&IDS, &mut readings)), expected);
            assert!(readings.iter().all(Option::is_some));
            assert_eq!(ready(bus.set_watchdog(&IDS, 0)), expected);
            let (first, second) = bus.into_parts();
            assert_eq!((first.asked.len(), second.asked.len()), (3, 3));
        }
    }

    #[test]
    fn a_split_beyond_the_servos_leaves_the_second_bus_empty() {
        let mut bus = Both::new(log(0, None), log(0, None), 9);
        let mut readings = [None; 5];
        ready(bus.read_all(&IDS, &mut readings)).unwrap();
        assert!(readings.iter().all(Option::is_some));
        assert_eq!(bus.into_parts().1.asked, [("read", vec![], 0)]);
    }
}

//! The buses of a puppet as one.

use crate::bus::{BusError, Goal, Reading, ServoBus};
use heapless::Vec;

/// Implements [`ServoBus`] for an enum whose variants hold one bus each, of different kinds.
///
/// The generic parameters stand in square brackets, with their bounds.
///
/// ```
/// use servo_wire::bus::ServoBus;
/// # use servo_wire::bus::{BusError, Goal};
/// # struct Silent;
/// # impl ServoBus for Silent {
/// #     async fn ping(&mut self, _: &[u8], _: usize) -> Result<(), BusError> { Err(BusError::NoReply) }
/// #     async fn set_torque(&mut self, _: &[u8], _: usize, _: bool) -> Result<(), BusError> { Ok(()) }
/// #     async fn write_goals(&mut self, _: &[Goal]) -> Result<(), BusError> { Ok(()) }
/// # }
/// enum ArmOrFace<A, F> {
///     Arm(A),
///     Face(F),
/// }
/// servo_wire::impl_servo_bus!([A: ServoBus, F: ServoBus] ArmOrFace<A, F> { Arm, Face });
///
/// let mut bus: ArmOrFace<Silent, Silent> = ArmOrFace::Face(Silent);
/// # let other: ArmOrFace<Silent, Silent> = ArmOrFace::Arm(Silent);
/// # assert!(!other.reads(0));
/// let found = embassy_futures::block_on(bus.ping(&[1], 0));
/// assert_eq!(found, Err(BusError::NoReply));
/// ```
#[macro_export]
macro_rules! impl_servo_bus {
    ([$($generics:tt)*] $bus:ty { $($kind:ident),+ $(,)? }) => {
        impl<$($generics)*> $crate::bus::ServoBus for $bus {
            fn reads(&self, index: usize) -> bool {
                match self {
                    $(Self::$kind(bus) => bus.reads(index),)+
                }
            }

            async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), $crate::bus::BusError> {
                match self {
                    $(Self::$kind(bus) => bus.ping(ids, index).await,)+
                }
            }

            async fn set_torque(
                &mut self,
                ids: &[u8],
                index: usize,
                on: bool,
            ) -> Result<(), $crate::bus::BusError> {
                match self {
                    $(Self::$kind(bus) => bus.set_torque(ids, index, on).await,)+
                }
            }

            async fn write_goals(
                &mut self,
                goals: &[$crate::bus::Goal],
            ) -> Result<(), $crate::bus::BusError> {
                match self {
                    $(Self::$kind(bus) => bus.write_goals(goals).await,)+
                }
            }

            async fn read_all(
                &mut self,
                ids: &[u8],
                readings: &mut [Option<$crate::bus::Reading>],
            ) -> Result<(), $crate::bus::BusError> {
                match self {
                    $(Self::$kind(bus) => bus.read_all(ids, readings).await,)+
                }
            }

            async fn reboot(&mut self, ids: &[u8], index: usize) -> Result<(), $crate::bus::BusError> {
                match self {
                    $(Self::$kind(bus) => bus.reboot(ids, index).await,)+
                }
            }

            async fn set_watchdog(
                &mut self,
                ids: &[u8],
                millis: u16,
            ) -> Result<(), $crate::bus::BusError> {
                match self {
                    $(Self::$kind(bus) => bus.set_watchdog(ids, millis).await,)+
                }
            }

            async fn disarm_watchdog(
                &mut self,
                ids: &[u8],
                index: usize,
            ) -> Result<(), $crate::bus::BusError> {
                match self {
                    $(Self::$kind(bus) => bus.disarm_watchdog(ids, index).await,)+
                }
            }
        }
    };
}

/// Up to `N` buses as one: the first servos are on the first bus, those behind them on the next.
///
/// A bus that fails never keeps another from being served: the first error is returned after all had their turn.
/// Buses of different kinds are joined as the variants of an enum, see [`impl_servo_bus`](crate::impl_servo_bus!).
#[derive(Debug)]
pub struct JoinedBuses<B, const N: usize> {
    /// Each bus, with the number of its servos.
    buses: Vec<(B, usize), N>,
}

impl<B: ServoBus, const N: usize> JoinedBuses<B, N> {
    /// Joins buses, each with the number of its servos, 0 or more.
    pub const fn new(buses: Vec<(B, usize), N>) -> Self {
        Self { buses }
    }

    /// The buses, each with the number of its servos.
    pub fn into_buses(self) -> Vec<(B, usize), N> {
        self.buses
    }

    /// The bus of the servo in this place, the ids on that bus, and the servo's place among them.
    fn bus_of<'i>(&mut self, ids: &'i [u8], index: usize) -> Result<(&mut B, &'i [u8], usize), BusError> {
        let (mut ids, mut index) = (ids, index);
        for (bus, servos) in &mut self.buses {
            let (own, later) = split(ids, *servos);
            match index.checked_sub(*servos) {
                None => return Ok((bus, own, index)),
                Some(behind) => (ids, index) = (later, behind),
            }
        }
        Err(BusError::TooMany)
    }
}

fn split<T>(slice: &[T], at: usize) -> (&[T], &[T]) {
    slice.split_at_checked(at).unwrap_or((slice, &[]))
}

/// One outcome of two: an error before none, but "cannot do that" only where neither could.
fn join(first: Result<(), BusError>, second: Result<(), BusError>) -> Result<(), BusError> {
    match (first, second) {
        (Err(BusError::Unsupported), other) | (other, Err(BusError::Unsupported)) => other,
        (first, second) => first.and(second),
    }
}

impl<B: ServoBus, const N: usize> ServoBus for JoinedBuses<B, N> {
    fn reads(&self, index: usize) -> bool {
        let mut index = index;
        for (bus, servos) in &self.buses {
            match index.checked_sub(*servos) {
                None => return bus.reads(index),
                Some(behind) => index = behind,
            }
        }
        false
    }

    async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let (bus, ids, index) = self.bus_of(ids, index)?;
        bus.ping(ids, index).await
    }

    async fn set_torque(&mut self, ids: &[u8], index: usize, on: bool) -> Result<(), BusError> {
        let (bus, ids, index) = self.bus_of(ids, index)?;
        bus.set_torque(ids, index, on).await
    }

    async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
        let (mut result, mut goals) = (Err(BusError::Unsupported), goals);
        for (bus, servos) in &mut self.buses {
            let (own, later) = split(goals, *servos);
            result = join(result, bus.write_goals(own).await);
            goals = later;
        }
        result
    }

    async fn read_all(&mut self, ids: &[u8], readings: &mut [Option<Reading>]) -> Result<(), BusError> {
        let (mut result, mut ids, mut readings) = (Err(BusError::Unsupported), ids, readings);
        for (bus, servos) in &mut self.buses {
            let (own, later) = split(ids, *servos);
            let (own_readings, later_readings) = readings.split_at_mut((*servos).min(readings.len()));
            result = join(result, bus.read_all(own, own_readings).await);
            (ids, readings) = (later, later_readings);
        }
        result
    }

    async fn reboot(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let (bus, ids, index) = self.bus_of(ids, index)?;
        bus.reboot(ids, index).await
    }

    async fn set_watchdog(&mut self, ids: &[u8], millis: u16) -> Result<(), BusError> {
        let (mut result, mut ids) = (Err(BusError::Unsupported), ids);
        for (bus, servos) in &mut self.buses {
            let (own, later) = split(ids, *servos);
            result = join(result, bus.set_watchdog(own, millis).await);
            ids = later;
        }
        result
    }

    async fn disarm_watchdog(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let (bus, ids, index) = self.bus_of(ids, index)?;
        bus.disarm_watchdog(ids, index).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embassy_futures::block_on;

    /// Keeps what it was asked; answers with a fixed result, and reads positions `base + id`.
    #[derive(Debug, Default)]
    struct Log {
        base: i32,
        asked: std::vec::Vec<(&'static str, std::vec::Vec<u8>, usize)>,
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
            let ids: std::vec::Vec<u8> = goals.iter().map(|goal| goal.id).collect();
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
        async fn disarm_watchdog(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
            self.note("disarm", ids, index)
        }
    }

    fn log(base: i32, result: Option<BusError>) -> Log {
        Log { base, asked: std::vec::Vec::new(), result }
    }

    fn joined(first: Log, second: Log, split: usize) -> JoinedBuses<Log, 2> {
        JoinedBuses::new(Vec::from_array([(first, split), (second, IDS.len().saturating_sub(split))]))
    }

    const IDS: [u8; 5] = [4, 5, 6, 4, 9];

    #[test]
    fn each_servo_is_asked_on_its_bus() {
        let mut bus = joined(log(0, None), log(100, None), 3);
        for index in [0, 2, 3, 4] {
            block_on(bus.ping(&IDS, index)).unwrap();
            block_on(bus.set_torque(&IDS, index, true)).unwrap();
            block_on(bus.reboot(&IDS, index)).unwrap();
        }
        block_on(bus.disarm_watchdog(&IDS, 4)).unwrap();
        assert_eq!([0, 1, 2, 3, 4].map(|index| bus.reads(index)), [true, false, true, true, false]);
        block_on(bus.set_watchdog(&IDS, 200)).unwrap();
        let mut readings = [None; 5];
        block_on(bus.read_all(&IDS, &mut readings)).unwrap();
        assert_eq!(readings.map(|reading| reading.unwrap().position), [4, 5, 6, 104, 109]);
        block_on(bus.write_goals(&IDS.map(|id| Goal { id, position: 0 }))).unwrap();
        let [(first, _), (second, _)] = bus.into_buses().into_array().unwrap();
        let asked = |log: &Log| -> std::vec::Vec<(&str, usize)> {
            log.asked.iter().map(|(w, _, i)| (*w, *i)).collect()
        };
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
                ("disarm", 1),
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
            let mut bus = joined(log(0, first), log(0, second), 3);
            assert_eq!(block_on(bus.write_goals(&IDS.map(|id| Goal { id, position: 0 }))), expected);
            let mut readings = [None; 5];
            assert_eq!(block_on(bus.read_all(&IDS, &mut readings)), expected);
            assert!(readings.iter().all(Option::is_some));
            assert_eq!(block_on(bus.set_watchdog(&IDS, 0)), expected);
            let [(first, _), (second, _)] = bus.into_buses().into_array().unwrap();
            assert_eq!((first.asked.len(), second.asked.len()), (3, 3));
        }
    }

    #[test]
    fn a_split_beyond_the_servos_leaves_the_second_bus_empty() {
        let mut bus = joined(log(0, None), log(0, None), 9);
        let mut readings = [None; 5];
        block_on(bus.read_all(&IDS, &mut readings)).unwrap();
        assert!(readings.iter().all(Option::is_some));
        assert_eq!(bus.into_buses()[1].0.asked, [("read", vec![], 0)]);
    }
}

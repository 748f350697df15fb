//! Reading all servos of a bus although some are silent.
//!
//! A silent servo costs a timeout, and in protocols with a joint read it keeps those behind it from answering. So it
//! is left out until it answers when asked alone.

use crate::bus::{BusError, MAX_SERVOS, Reading};
use heapless::Vec;

/// Exchanges a tick with servos that the joint read leaves out.
pub(crate) const PROBE_EXCHANGES: u32 = 8;

/// Exchanges that a servo costs which must be set up before it is read.
pub(crate) const SET_UP_EXCHANGES: u32 = 3;

/// How a protocol reads.
pub(crate) trait ServoReader {
    /// Whether the servo is set up for reading.
    fn is_set_up(&self, _index: usize) -> bool {
        true
    }

    /// Reads the servos at these places of `ids`, all set up; what answers is entered. May stop at the first that does
    /// not answer. As it is here, for protocols without a joint read: [`read_one_by_one`](Self::read_one_by_one).
    ///
    /// # Errors
    /// Why, when none answered.
    async fn read_together(
        &mut self,
        ids: &[u8],
        places: &[u8],
        readings: &mut [Option<Reading>],
    ) -> Result<(), BusError> {
        self.read_one_by_one(ids, places, readings).await
    }

    /// Reads them one after the other, up to the first that does not answer: silence costs a timeout, and the schedule
    /// decides who is asked again.
    ///
    /// # Errors
    /// Why, when none answered.
    async fn read_one_by_one(
        &mut self,
        ids: &[u8],
        places: &[u8],
        readings: &mut [Option<Reading>],
    ) -> Result<(), BusError> {
        let mut result = Err(BusError::TooMany);
        for index in places.iter().copied().map(usize::from) {
            let (Some(&id), Some(slot)) = (ids.get(index), readings.get_mut(index)) else { break };
            match self.read_alone(id, index).await {
                Ok(reading) => {
                    *slot = Some(reading);
                    result = Ok(());
                }
                Err(error) => return result.or(Err(error)),
            }
        }
        result
    }

    /// Reads one servo, after setting it up if it is not set up: [`SET_UP_EXCHANGES`] exchanges at most, else one.
    async fn read_alone(&mut self, id: u8, index: usize) -> Result<Reading, BusError>;
}

/// Which servos are read together in a tick, and which alone: by who answered last time.
#[derive(Debug)]
pub(crate) struct ReadSchedule {
    /// A bit for each servo that did not answer when it was asked alone.
    silent: u32,
    /// None answered a joint read: all are treated as silent.
    lost: bool,
    /// Where the next look for a servo that is left out starts.
    probe: usize,
}

const _: () = assert!(MAX_SERVOS <= u32::BITS as usize);

const fn bit(index: usize) -> u32 {
    1_u32.wrapping_shl(index as u32)
}

impl ReadSchedule {
    /// Nobody has been found silent.
    pub(crate) const fn new() -> Self {
        Self { silent: 0, lost: false, probe: 0 }
    }

    /// Notes that a servo answered.
    pub(crate) fn note_answer(&mut self, index: usize) {
        self.silent &= !bit(index);
        self.lost = false;
    }

    /// One joint read of the servos that answered last time. Where some are missing, those behind the first of them
    /// are read jointly again, since it may have kept them from answering, and it alone; if it keeps silent, the
    /// ticks to come leave it out. Where none answers at all, all are left out. Those left out are asked one by
    /// one: each tick until one keeps silent, [`PROBE_EXCHANGES`] at most.
    ///
    /// # Errors
    /// As [`ServoBus::read_all`](crate::bus::ServoBus::read_all).
    pub(crate) async fn read_all(
        &mut self,
        bus: &mut impl ServoReader,
        ids: &[u8],
        readings: &mut [Option<Reading>],
    ) -> Result<(), BusError> {
        readings.fill(None);
        if ids.len() > MAX_SERVOS || ids.len() != readings.len() {
            return Err(BusError::TooMany);
        }
        let mut joint = 0;
        let mut places: Vec<u8, MAX_SERVOS> = Vec::new();
        for index in 0..ids.len() {
            if !self.lost && self.silent & bit(index) == 0 && bus.is_set_up(index) {
                joint |= bit(index);
                // There is room for each of `ids`.
                let _ = places.push(index as u8);
            }
        }
        let mut result = Ok(());
        if !places.is_empty() {
            result = bus.read_together(ids, &places, readings).await;
            places.retain(|&place| readings.get(usize::from(place)).is_some_and(Option::is_none));
        }
        if let Some((&suspect, behind)) = places.split_first() {
            if !behind.is_empty() {
                let again = bus.read_together(ids, behind, readings).await;
                self.lost = result.is_err() && again.is_err();
            }
            result = result.and(self.look(bus, ids, suspect.into(), readings).await);
        } else {
            let mut left = PROBE_EXCHANGES;
            for _ in 0..ids.len() {
                let index = if self.probe < ids.len() { self.probe } else { 0 };
                self.probe = index.saturating_add(1);
                if joint & bit(index) != 0 {
                    continue;
                }
                let Some(rest) = left.checked_sub(if bus.is_set_up(index) { 1 } else { SET_UP_EXCHANGES })
                else {
                    self.probe = index;
                    break;
                };
                left = rest;
                if let Err(error) = self.look(bus, ids, index, readings).await {
                    result = result.and(Err(error));
                    break;
                }
            }
        }
        if readings.iter().any(Option::is_some) { Ok(()) } else { result }
    }

    /// Reads one servo and remembers whether it answered.
    async fn look(
        &mut self,
        bus: &mut impl ServoReader,
        ids: &[u8],
        index: usize,
        readings: &mut [Option<Reading>],
    ) -> Result<(), BusError> {
        let (Some(&id), Some(slot)) = (ids.get(index), readings.get_mut(index)) else {
            return Err(BusError::TooMany);
        };
        match bus.read_alone(id, index).await {
            Ok(reading) => {
                *slot = Some(reading);
                self.note_answer(index);
                Ok(())
            }
            Err(error) => {
                self.silent |= bit(index);
                Err(error)
            }
        }
    }
}

/// Enters the answers of a read that servos answer one after the other, each under its id.
///
/// Servos answer in the order asked, and where one is missing those behind it cannot. So an answer out of turn carries
/// a wrong id, or follows one that was garbled; it is left to the next read. Of two under one id neither is taken.
#[derive(Default)]
pub(crate) struct AnswerOrder {
    /// Place whose turn it is.
    next: usize,
}

impl AnswerOrder {
    /// Enters the reading of the servo at place `at` of those asked; returns whether it was taken.
    pub(crate) fn enter(&mut self, at: usize, slot: &mut Option<Reading>, reading: Option<Reading>) -> bool {
        let turn = at == self.next;
        if turn {
            self.next = self.next.saturating_add(1);
        }
        if turn || at < self.next {
            *slot = reading.filter(|_| turn);
        }
        turn
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::pin::pin;
    use core::task::{Context, Poll, Waker};

    /// Servos of which some are dead, on a bus where a dead one silences those behind it.
    struct Chain {
        dead: Vec<u8, 32>,
        set_up: u32,
        exchanges: u32,
        joint: u32,
    }

    fn reading(id: u8) -> Reading {
        let position = i32::from(id);
        Reading { position, temperature: None, millivolts: None, load: None, hardware_error: 0, torque: None }
    }

    impl ServoReader for Chain {
        fn is_set_up(&self, index: usize) -> bool {
            self.set_up & bit(index) != 0
        }

        async fn read_together(
            &mut self,
            ids: &[u8],
            places: &[u8],
            readings: &mut [Option<Reading>],
        ) -> Result<(), BusError> {
            self.joint += 1;
            let mut good = false;
            for &place in places {
                let id = ids[usize::from(place)];
                if self.dead.contains(&id) {
                    break;
                }
                assert!(self.is_set_up(place.into()));
                readings[usize::from(place)] = Some(reading(id));
                good = true;
            }
            if good { Ok(()) } else { Err(BusError::NoReply) }
        }

        async fn read_alone(&mut self, id: u8, index: usize) -> Result<Reading, BusError> {
            self.exchanges += if self.is_set_up(index) { 1 } else { SET_UP_EXCHANGES };
            if self.dead.contains(&id) {
                return Err(BusError::NoReply);
            }
            self.set_up |= bit(index);
            Ok(reading(id))
        }
    }

    /// Reads once; returns the result, who answered, and the joint reads and exchanges it took.
    fn read_all(
        schedule: &mut ReadSchedule,
        bus: &mut Chain,
        ids: &[u8],
    ) -> (Result<(), BusError>, usize, u32, u32) {
        (bus.joint, bus.exchanges) = (0, 0);
        let mut readings = vec![Some(reading(250)); ids.len()];
        let result = match pin!(schedule.read_all(bus, ids, &mut readings))
            .poll(&mut Context::from_waker(Waker::noop()))
        {
            Poll::Ready(result) => result,
            Poll::Pending => panic!("nothing here waits"),
        };
        for (id, reading) in ids.iter().zip(&readings) {
            assert!(reading.is_none_or(|reading| reading.position == i32::from(*id)));
        }
        (result, readings.iter().flatten().count(), bus.joint, bus.exchanges)
    }

    fn chain(dead: &[u8]) -> Chain {
        Chain { dead: Vec::from_slice(dead).unwrap(), set_up: u32::MAX, exchanges: 0, joint: 0 }
    }

    const IDS: [u8; 20] = [9, 8, 7, 6, 5, 4, 3, 2, 1, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20];

    #[test]
    fn dead_servos_cost_the_others_nothing_in_the_long_run() {
        for dead in [&[9][..], &[20], &[9, 8], &[9, 20, 4], &[1, 2, 3, 4, 5, 6, 7, 8, 9]] {
            let (mut schedule, mut bus) = (ReadSchedule::new(), chain(dead));
            let alive = IDS.len() - dead.len();
            let mut last = 0;
            for _ in 0..30 {
                let (result, good, joint, exchanges) = read_all(&mut schedule, &mut bus, &IDS);
                last = good;
                // Two joint reads, or one and a probe of servos that were found alive, at most.
                assert!(joint <= 2 && exchanges <= PROBE_EXCHANGES, "{dead:?}: {joint}, {exchanges}");
                assert!(good == 0 || result == Ok(()));
            }
            assert_eq!(last, alive, "{dead:?}");
            assert_eq!(read_all(&mut schedule, &mut bus, &IDS), (Ok(()), alive, 1, 1), "{dead:?}");
            bus.dead.clear();
            let ticks = (0..10).take_while(|_| read_all(&mut schedule, &mut bus, &IDS).1 < IDS.len()).count();
            assert!(ticks <= 2, "{dead:?}: back after {ticks}");
        }
    }

    #[test]
    fn one_dead_servo_keeps_no_other_from_being_read() {
        for dead in IDS {
            let (mut schedule, mut bus) = (ReadSchedule::new(), chain(&[dead]));
            for _ in 0..50 {
                assert_eq!(read_all(&mut schedule, &mut bus, &IDS).1, IDS.len() - 1);
            }
        }
    }

    #[test]
    fn a_dead_bus_costs_one_exchange_and_comes_back() {
        let (mut schedule, mut bus) = (ReadSchedule::new(), chain(&IDS));
        assert_eq!(read_all(&mut schedule, &mut bus, &IDS), (Err(BusError::NoReply), 0, 2, 1));
        for _ in 0..50 {
            assert_eq!(read_all(&mut schedule, &mut bus, &IDS), (Err(BusError::NoReply), 0, 0, 1));
        }
        // All have lost power too, and must be set up: two a tick.
        (bus.set_up, bus.dead) = (0, Vec::new());
        let good: std::vec::Vec<usize> = (0..10).map(|_| read_all(&mut schedule, &mut bus, &IDS).1).collect();
        assert_eq!(good, [2, 4, 6, 8, 10, 12, 14, 16, 18, 20]);
        assert_eq!(read_all(&mut schedule, &mut bus, &IDS), (Ok(()), 20, 1, 0));
    }

    #[test]
    fn answers_out_of_turn_are_not_taken() {
        let taken = |order: &[usize]| {
            let (mut turn, mut slots) = (AnswerOrder::default(), [None; 4]);
            for &at in order {
                turn.enter(at, &mut slots[at], Some(reading(at as u8)));
            }
            slots.map(|slot| slot.is_some())
        };
        assert_eq!(taken(&[0, 1, 2, 3]), [true; 4]);
        assert_eq!(taken(&[0, 2, 3]), [true, false, false, false]);
        assert_eq!(taken(&[3, 1, 2, 3]), [false; 4]);
        assert_eq!(taken(&[0, 1, 1, 3]), [true, false, false, false]);
        assert_eq!(taken(&[0, 1, 2, 0]), [false, true, true, false]);
    }

    #[test]
    fn no_servos_or_too_many() {
        let (mut schedule, mut bus) = (ReadSchedule::new(), chain(&[]));
        assert_eq!(read_all(&mut schedule, &mut bus, &[]), (Ok(()), 0, 0, 0));
        let ids: std::vec::Vec<u8> = (0..33).collect();
        assert_eq!(read_all(&mut schedule, &mut bus, &ids), (Err(BusError::TooMany), 0, 0, 0));
        assert_eq!(read_all(&mut schedule, &mut bus, &ids[..32]), (Ok(()), 32, 1, 0));
    }
}

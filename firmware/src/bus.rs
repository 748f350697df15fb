//! The buses of a puppet out of what a board has.

use crate::collect::numbered;
use crate::map::{BusKind, JointMap, MAX_BUSES};
use core::fmt;
use heapless::Vec;
use servo_wire::bus::ServoBus;
use servo_wire::impl_servo_bus;
use servo_wire::joined::JoinedBuses;

/// The buses that a board has, each at most once.
#[derive(Debug)]
pub struct BoardBuses<S, I, P> {
    /// A bus on a serial line, and what it speaks.
    pub serial: Option<(BusKind, S)>,
    /// A PCA9685.
    pub pca9685: Option<I>,
    /// PWM pins.
    pub pwm: Option<P>,
}

/// One of the buses that a board has.
#[derive(Debug)]
pub enum BoardBus<S, I, P> {
    /// On a serial line.
    Serial(S),
    /// A PCA9685.
    Pca9685(I),
    /// PWM pins.
    Pwm(P),
}

impl_servo_bus!([S: ServoBus, I: ServoBus, P: ServoBus] BoardBus<S, I, P> { Serial, Pca9685, Pwm });

/// The buses of a puppet on a board, in the order of the puppet's map.
pub type PuppetBus<S, I, P> = JoinedBuses<BoardBus<S, I, P>, MAX_BUSES>;

/// A puppet has a bus that its board does not have, or does not have once more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MissingBus(pub BusKind);

impl fmt::Display for MissingBus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the board has no bus of the kind {:?}, or not another one", self.0)
    }
}

impl core::error::Error for MissingBus {}

impl<S: ServoBus, I: ServoBus, P: ServoBus> BoardBuses<S, I, P> {
    /// The buses that a map has, as one.
    ///
    /// # Errors
    /// [`MissingBus`] for the first bus that is not there.
    pub fn of_map<const N: usize>(self, map: &JointMap<N>) -> Result<PuppetBus<S, I, P>, MissingBus> {
        let Self { mut serial, mut pca9685, mut pwm } = self;
        let mut buses = Vec::new();
        for (index, bus) in numbered(map.buses()) {
            let found = match bus.kind {
                BusKind::Pca9685 => pca9685.take().map(BoardBus::Pca9685),
                BusKind::Pwm => pwm.take().map(BoardBus::Pwm),
                kind => serial.take_if(|(there, _)| *there == kind).map(|(_, bus)| BoardBus::Serial(bus)),
            };
            // A map has no more buses than there is room for.
            let _ = buses.push((found.ok_or(MissingBus(bus.kind))?, map.on_bus(index as u8).len()));
        }
        Ok(JoinedBuses::new(buses))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{BusSpec, Idle, Joint, Settings};
    use decoder_core::I16F16;
    use embassy_futures::block_on;
    use servo_wire::bus::{BusError, Goal};

    /// Keeps the goals that it was written last.
    #[derive(Debug, Default)]
    struct Log(std::vec::Vec<(u8, i32)>);

    impl ServoBus for Log {
        async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
            ids.get(index).map(drop).ok_or(BusError::TooMany)
        }
        async fn set_torque(&mut self, _: &[u8], _: usize, _: bool) -> Result<(), BusError> {
            Ok(())
        }
        async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
            self.0 = goals.iter().map(|goal| (goal.id, goal.position)).collect();
            Ok(())
        }
    }

    fn map(kinds: &[BusKind]) -> JointMap<8> {
        let joint = |bus: usize, id: u8| Joint {
            channel: 0,
            bus: bus as u8,
            id,
            zero: 0,
            home: 0,
            scale: I16F16::ONE,
            min: 0,
            max: 1,
            max_velocity: 1,
            max_acceleration: 1,
            idle: Idle::default(),
        };
        let joints = (0..kinds.len()).flat_map(|bus| [joint(bus, 3), joint(bus, 5 + bus as u8)]).collect();
        let buses = kinds.iter().map(|&kind| BusSpec { kind, baud: 50 }).collect();
        JointMap::new(Settings::new(50), buses, joints).unwrap()
    }

    fn board() -> BoardBuses<Log, Log, Log> {
        BoardBuses {
            serial: Some((BusKind::Sts, Log::default())),
            pca9685: Some(Log::default()),
            pwm: Some(Log::default()),
        }
    }

    #[test]
    fn each_bus_gets_the_servos_that_the_map_has_on_it() {
        let map = map(&[BusKind::Pwm, BusKind::Sts, BusKind::Pca9685]);
        let mut bus = board().of_map(&map).unwrap();
        let goals: std::vec::Vec<Goal> =
            map.joints().iter().zip(10..).map(|(joint, position)| Goal { id: joint.id, position }).collect();
        block_on(bus.write_goals(&goals)).unwrap();
        let buses = bus.into_buses();
        let [(BoardBus::Pwm(pwm), 2), (BoardBus::Serial(serial), 2), (BoardBus::Pca9685(pca), 2)] =
            &buses[..]
        else {
            panic!("another order: {buses:?}")
        };
        assert_eq!(pwm.0, [(3, 10), (5, 11)]);
        assert_eq!(serial.0, [(3, 12), (6, 13)]);
        assert_eq!(pca.0, [(3, 14), (7, 15)]);
    }

    #[test]
    fn a_bus_that_is_not_there_is_named() {
        for (kinds, missing) in [
            (&[BusKind::Dynamixel][..], BusKind::Dynamixel),
            (&[BusKind::Pwm, BusKind::Sts, BusKind::Pwm], BusKind::Pwm),
            (&[BusKind::Sts, BusKind::Blender], BusKind::Blender),
        ] {
            assert_eq!(board().of_map(&map(kinds)).err(), Some(MissingBus(missing)));
        }
    }
}

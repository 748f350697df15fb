//! The buses of a puppet out of what a board has.

use crate::map::{BusKind, JointMap, MAX_BUSES};
use core::fmt;
use servo_wire::both::Both;
use servo_wire::bus::{BusError, Goal, Reading, ServoBus};

/// What a board has, each at most once.
#[derive(Debug)]
pub struct Parts<S, I, P> {
    /// A bus on a serial line, and what it speaks.
    pub serial: Option<(BusKind, S)>,
    /// A PCA9685.
    pub pca9685: Option<I>,
    /// PWM pins.
    pub pwm: Option<P>,
}

/// One of a puppet's buses.
#[derive(Debug)]
pub enum Part<S, I, P> {
    /// On a serial line.
    Serial(S),
    /// A PCA9685.
    Pca9685(I),
    /// PWM pins.
    Pwm(P),
    /// No bus, with no servos.
    None,
}

/// The buses of a puppet as one, in the order of its map.
pub type Mixed<S, I, P> = Both<Both<Part<S, I, P>, Part<S, I, P>>, Both<Part<S, I, P>, Part<S, I, P>>>;

/// A board does not have this bus of the puppet, or not once more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NoBus(pub BusKind);

impl fmt::Display for NoBus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the board has no bus of the kind {:?}, or not another one", self.0)
    }
}

impl core::error::Error for NoBus {}

/// Takes the buses of `map` out of what there is.
///
/// # Errors
/// [`NoBus`] for the first bus that is not there.
pub fn mixed<S, I, P, const N: usize>(
    map: &JointMap<N>,
    parts: Parts<S, I, P>,
) -> Result<Mixed<S, I, P>, NoBus>
where
    Part<S, I, P>: ServoBus,
{
    let Parts { mut serial, mut pca9685, mut pwm } = parts;
    let mut found: [Part<S, I, P>; MAX_BUSES] = [Part::None, Part::None, Part::None, Part::None];
    for (slot, bus) in found.iter_mut().zip(map.buses()) {
        let part = match bus.kind {
            BusKind::Pca9685 => pca9685.take().map(Part::Pca9685),
            BusKind::Pwm => pwm.take().map(Part::Pwm),
            kind => serial.take_if(|(there, _)| *there == kind).map(|(_, bus)| Part::Serial(bus)),
        };
        *slot = part.ok_or(NoBus(bus.kind))?;
    }
    let [first, second, third, fourth] = found;
    let count = |bus: u8| map.on_bus(bus).len();
    let (one, other) = (Both::new(first, second, count(0)), Both::new(third, fourth, count(2)));
    Ok(Both::new(one, other, count(0) + count(1)))
}

/// Calls the bus that there is; `$absent` where there is none.
macro_rules! served {
    ($self:expr, $bus:ident => $call:expr, $absent:expr) => {
        match $self {
            Part::Serial($bus) => $call,
            Part::Pca9685($bus) => $call,
            Part::Pwm($bus) => $call,
            Part::None => $absent,
        }
    };
}

impl<S: ServoBus, I: ServoBus, P: ServoBus> ServoBus for Part<S, I, P> {
    fn reads(&self, index: usize) -> bool {
        served!(self, bus => bus.reads(index), false)
    }

    async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        served!(self, bus => bus.ping(ids, index).await, Err(BusError::TooMany))
    }

    async fn set_torque(&mut self, ids: &[u8], index: usize, on: bool) -> Result<(), BusError> {
        served!(self, bus => bus.set_torque(ids, index, on).await, Err(BusError::TooMany))
    }

    async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
        served!(self, bus => bus.write_goals(goals).await, Ok(()))
    }

    async fn read_all(&mut self, ids: &[u8], readings: &mut [Option<Reading>]) -> Result<(), BusError> {
        served!(self, bus => bus.read_all(ids, readings).await, Ok(()))
    }

    async fn reboot(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        served!(self, bus => bus.reboot(ids, index).await, Err(BusError::TooMany))
    }

    async fn set_watchdog(&mut self, ids: &[u8], millis: u16) -> Result<(), BusError> {
        served!(self, bus => bus.set_watchdog(ids, millis).await, Err(BusError::Unsupported))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{BusSpec, Idle, Joint, Settings};
    use decoder_core::I16F16;
    use embassy_futures::block_on;

    /// Keeps the goals that it was written last.
    #[derive(Debug, Default)]
    struct Log(Vec<(u8, i32)>);

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

    fn parts() -> Parts<Log, Log, Log> {
        Parts {
            serial: Some((BusKind::Sts, Log::default())),
            pca9685: Some(Log::default()),
            pwm: Some(Log::default()),
        }
    }

    #[test]
    fn each_bus_gets_the_servos_that_the_map_has_on_it() {
        let map = map(&[BusKind::Pwm, BusKind::Sts, BusKind::Pca9685]);
        let mut bus = mixed(&map, parts()).unwrap();
        let goals: Vec<Goal> =
            map.joints().iter().zip(10..).map(|(joint, position)| Goal { id: joint.id, position }).collect();
        block_on(bus.write_goals(&goals)).unwrap();
        let (one, other) = bus.into_parts();
        let (Part::Pwm(pwm), Part::Serial(serial)) = one.into_parts() else { panic!("another order") };
        let (Part::Pca9685(pca), Part::None) = other.into_parts() else { panic!("another order") };
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
            assert_eq!(mixed(&map(kinds), parts()).err(), Some(NoBus(missing)));
        }
    }
}

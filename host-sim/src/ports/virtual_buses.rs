//! The buses of a puppet with virtual servos of every kind in this program, which answer at once.

use super::bus::SerialBus;
use crate::play::pwm_timing;
use crate::puppet_servos::ServedBus;
use anyhow::{Context, Result, bail};
use firmware::bus::BoardBus;
use firmware::map::{BusKind, MAX_BUSES};
use puppet_file::Map;
use servo_wire::bus::ServoBus;
use servo_wire::joined::JoinedBuses;
use servo_wire::pca9685::OSCILLATOR_HZ;
use servo_wire::port::LineConfig;
use std::time::Duration;
use virtual_servos::hobby::HobbyBoard;
use virtual_servos::serve::BYTE_GAP_US;
use virtual_servos::uart::{InProcessUart, ZeroDelay};

/// The buses of `map`, with the servos that `served` says, each at its joint's home, or as near as it can be. `now` is the time that
/// the servos live by.
///
/// # Errors
/// A sentence where a servo cannot be as the puppet says.
pub fn open<'a>(
    map: &Map,
    served: &[ServedBus],
    now: &'a dyn Fn() -> Duration,
) -> Result<impl ServoBus + use<'a>> {
    let mut buses = heapless::Vec::<_, MAX_BUSES>::new();
    for (index, (spec, served)) in (0..).zip(map.buses().iter().zip(served)) {
        let bus = match spec.kind {
            BusKind::Pca9685 => {
                let oscillator_hz = map.oscillator_hz().unwrap_or(OSCILLATOR_HZ);
                BoardBus::Pca9685(HobbyBoard::default().pca9685(oscillator_hz)?)
            }
            BusKind::Pwm => BoardBus::Pwm(HobbyBoard::default().pwm(pwm_timing(spec.baud)?)),
            kind => {
                let mut servos = virtual_servos(map, index, served)?;
                let hear = move |bytes: &[u8]| {
                    let now_us = u64::try_from(now().as_micros()).unwrap_or(u64::MAX);
                    servos.receive(bytes, now_us, &mut |_| {})
                };
                let uart = InProcessUart::new(Box::new(hear) as Box<dyn FnMut(&[u8]) -> Vec<u8> + 'a>);
                BoardBus::Serial(SerialBus::on(kind, uart, ZeroDelay, LineConfig::uart(spec.baud)))
            }
        };
        if buses.push((bus, map.on_bus(index).len())).is_err() {
            bail!("a puppet has at most {MAX_BUSES} buses");
        }
    }
    Ok(JoinedBuses::new(buses))
}

fn virtual_servos(
    map: &Map,
    index: u8,
    served: &ServedBus,
) -> Result<Box<dyn virtual_servos::virtual_bus::VirtualBus>> {
    let mut served = served.clone();
    for joint in &map.joints()[map.on_bus(index)] {
        for (servo, _) in served.servos.iter_mut().filter(|(servo, _)| servo.id == joint.id) {
            servo.position = joint.home.max(servo.min_position).min(servo.max_position);
        }
    }
    served
        .virtual_bus(BYTE_GAP_US)
        .with_context(|| format!("bus \"{}\"", served.name))?
        .with_context(|| format!("bus \"{}\" has no virtual servos", served.name))
}

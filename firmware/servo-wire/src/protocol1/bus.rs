//! AX and MX (protocol 1.0) servos as a [`ServoBus`]: a Sync Write each tick, and reads one by one.

use super::client::Protocol1Client;
use super::packet::OVERHEAD;
use crate::bus::{BusError, ERROR_HEAT, ERROR_OVERLOAD, ERROR_VOLTAGE, Goal, MAX_SERVOS, Reading, ServoBus};
use crate::port::LineConfig;
use crate::read_schedule::{PROBE_EXCHANGES, ReadSchedule, ServoReader};
use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

/// Where the bytes are that say who a servo is: model (2), firmware (1), id (1).
const IDENTITY: u8 = 0;
const TORQUE_ENABLE: u8 = 24;
const GOAL_POSITION: u8 = 30;

/// From Torque Enable (24) to Present Temperature (43).
const BLOCK: u8 = TORQUE_ENABLE;

/// Bytes that a tick reads of a servo.
pub const BLOCK_LEN: usize = 20;

/// Bits of the error byte with which a servo says that it did not obey: instruction, checksum, range, angle limit.
const REFUSED: u8 = 1 << 6 | 1 << 4 | 1 << 3 | 1 << 1;

/// Bits of the error byte that tell of the servo: they are those of a [`Reading`].
const STATE: u8 = ERROR_VOLTAGE | ERROR_HEAT | ERROR_OVERLOAD;

/// Bytes on the wire of a tick of this many servos: the Sync Write of their goals, and a read with its answer of each.
#[must_use]
pub const fn tick_bytes(servos: usize) -> usize {
    let goals = servos.saturating_mul(3).saturating_add(OVERHEAD + 2);
    servos.saturating_mul(OVERHEAD + 2 + OVERHEAD + BLOCK_LEN).saturating_add(goals)
}

/// AX and MX servos with protocol 1.0 on one port, at most [`MAX_SERVOS`].
///
/// They cannot be restarted over the bus and have no watchdog. `N`: see [`Protocol1Client`].
#[derive(Debug)]
pub struct Protocol1Bus<U, D, T, const N: usize = 192> {
    client: Protocol1Client<U, D, T, N>,
    schedule: ReadSchedule,
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> Protocol1Bus<U, D, T, N> {
    /// A bus on a client's port.
    pub const fn new(client: Protocol1Client<U, D, T, N>) -> Self {
        Self { client, schedule: ReadSchedule::new() }
    }

    /// The client, for what the player does not need.
    pub fn client(&mut self) -> &mut Protocol1Client<U, D, T, N> {
        &mut self.client
    }

    /// Longest time in microseconds that [`read_all`](ServoBus::read_all) takes, when servos fall silent.
    #[must_use]
    pub const fn read_limit_us(line: &LineConfig, servos: usize) -> u32 {
        let exchange = line.exchange_limit_us(OVERHEAD + 2, OVERHEAD + BLOCK_LEN, 1);
        exchange.saturating_mul((servos as u32).saturating_add(PROBE_EXCHANGES))
    }
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> ServoReader for Protocol1Client<U, D, T, N> {
    async fn read_alone(&mut self, id: u8, _index: usize) -> Result<Reading, BusError> {
        let mut data = [0; BLOCK_LEN];
        let error = self.read(id, BLOCK, &mut data).await?;
        let [torque, _, _, _, _, _, _, _, _, _, _, _, p0, p1, _, _, l0, l1, volts, temperature] = data;
        // The checksum lets one garbled answer in 256 pass; none that is right comes from a servo without supply.
        if volts == 0 {
            return Err(BusError::Corrupt);
        }
        let load = u16::from_le_bytes([l0, l1]);
        let size = (load & 0x3FF) as i16;
        Ok(Reading {
            // Multi-turn MX count below 0 too.
            position: i16::from_le_bytes([p0, p1]).into(),
            temperature: Some(temperature),
            millivolts: Some(u16::from(volts) * 100),
            load: Some(if load & 0x400 == 0 { size } else { size.wrapping_neg() }),
            hardware_error: error & STATE,
            torque: Some(torque != 0),
        })
    }
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> ServoBus for Protocol1Bus<U, D, T, N> {
    fn reads(&self, _index: usize) -> bool {
        true
    }

    /// Reads the servo's id rather than pinging it: a ping's own echo looks like its answer.
    async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let id = *ids.get(index).ok_or(BusError::TooMany)?;
        let mut identity = [0; 4];
        self.client.read(id, IDENTITY, &mut identity).await?;
        let [_, _, _, own] = identity;
        if own != id {
            return Err(BusError::Corrupt);
        }
        self.schedule.note_answer(index);
        Ok(())
    }

    async fn set_torque(&mut self, ids: &[u8], index: usize, on: bool) -> Result<(), BusError> {
        let id = *ids.get(index).ok_or(BusError::TooMany)?;
        let error = self.client.write(id, TORQUE_ENABLE, &[u8::from(on)]).await?;
        if error & REFUSED == 0 { Ok(()) } else { Err(BusError::Refused(error)) }
    }

    async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
        if goals.len() > MAX_SERVOS {
            return Err(BusError::TooMany);
        }
        let value = |goal: &Goal| goal.position.clamp(i16::MIN.into(), i16::MAX.into()) as i16;
        let values = goals.iter().map(|goal| (goal.id, value(goal).to_le_bytes()));
        self.client.sync_write(GOAL_POSITION, values).await
    }

    async fn read_all(&mut self, ids: &[u8], readings: &mut [Option<Reading>]) -> Result<(), BusError> {
        self.schedule.read_all(&mut self.client, ids, readings).await
    }

    async fn reboot(&mut self, _ids: &[u8], _index: usize) -> Result<(), BusError> {
        Err(BusError::Unsupported)
    }

    async fn set_watchdog(&mut self, _ids: &[u8], _millis: u16) -> Result<(), BusError> {
        Err(BusError::Unsupported)
    }
}

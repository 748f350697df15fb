//! Feetech servos of the STS, SMS and SCS series as a [`ServoBus`].
//!
//! They speak the frame of [protocol 1.0](crate::protocol1) with tables of their own. STS and SMS are little endian,
//! give negative values by a sign bit and know Sync Read; SCS are big endian and are read one by one.
//!
//! Source: Feetech, "FT-SCS communication protocol manual" and the memory tables of "SMS/STS" and "SCSCL".

use crate::bus::{
    BusError, ERROR_ENCODER, ERROR_HEAT, ERROR_OVERLOAD, ERROR_SHOCK, ERROR_VOLTAGE, Goal, MAX_SERVOS,
    Reading, ServoBus,
};
use crate::port::LineConfig;
use crate::protocol1::Protocol1Client;
use crate::protocol1::packet::OVERHEAD;
use crate::read_schedule::{AnswerOrder, PROBE_EXCHANGES, ReadSchedule, ServoReader};
use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};
use heapless::Vec;

/// Where the bytes are that say who a servo is: servo version (2), id (1).
const IDENTITY: u8 = 3;
const TORQUE_ENABLE: u8 = 40;
const GOAL_POSITION: u8 = 42;

/// From Torque Enable (40) to Status (65).
const BLOCK: u8 = TORQUE_ENABLE;

/// Bytes that a tick reads of a servo.
pub const BLOCK_LEN: usize = 26;

/// Which servos.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Series {
    /// STS and SMS: 4096 a turn.
    Sts,
    /// SCS: 1024 in about 300°.
    Scs,
}

impl Series {
    fn word(self, bytes: [u8; 2]) -> u16 {
        match self {
            Self::Sts => u16::from_le_bytes(bytes),
            Self::Scs => u16::from_be_bytes(bytes),
        }
    }

    fn position(self, bytes: [u8; 2]) -> i32 {
        match self {
            Self::Sts => signed(self.word(bytes), 15),
            Self::Scs => self.word(bytes).into(),
        }
    }

    fn goal(self, position: i32) -> [u8; 2] {
        match self {
            Self::Sts => {
                let size = position.unsigned_abs().min(0x7FFF) as u16;
                (if position < 0 { size | 0x8000 } else { size }).to_le_bytes()
            }
            Self::Scs => (position.clamp(0, 1023) as u16).to_be_bytes(),
        }
    }
}

/// A number whose sign is the bit `sign`, and whose size the bits below it.
fn signed(value: u16, sign: u32) -> i32 {
    let bit = 1 << sign;
    let size = i32::from(value & !(u16::MAX << sign));
    if value & bit == 0 { size } else { size.wrapping_neg() }
}

/// Bits of a servo's error byte as those of a [`Reading`]; in the servo: voltage, sensor, heat, current, (none), load.
fn hardware_error(error: u8) -> u8 {
    let moved = |from: u8, to: u8| if error & 1 << from == 0 { 0 } else { to };
    error & (ERROR_VOLTAGE | ERROR_HEAT | ERROR_OVERLOAD) | moved(1, ERROR_ENCODER) | moved(3, ERROR_SHOCK)
}

fn reading(series: Series, error: u8, data: &[u8]) -> Option<Reading> {
    let torque = *data.first()?;
    let (_, present) = data.split_at_checked(16)?;
    let [p0, p1, _, _, l0, l1, volts, temperature, ..] = *present else { return None };
    // The checksum lets one garbled answer in 256 pass; none that is right comes from a servo without supply.
    (volts != 0).then(|| Reading {
        position: series.position([p0, p1]),
        temperature: Some(temperature),
        millivolts: Some(u16::from(volts) * 100),
        load: Some(signed(series.word([l0, l1]), 10) as i16),
        hardware_error: hardware_error(error),
        torque: Some(torque != 0),
    })
}

/// Bytes on the wire of a tick of this many servos: the Sync Write of their goals, and the reads with their answers.
#[must_use]
pub const fn tick_bytes(series: Series, servos: usize) -> usize {
    let goals = servos.saturating_mul(3).saturating_add(OVERHEAD + 2);
    let questions = match series {
        Series::Sts => servos.saturating_add(OVERHEAD + 2),
        Series::Scs => servos.saturating_mul(OVERHEAD + 2),
    };
    let answers = servos.saturating_mul(OVERHEAD + BLOCK_LEN);
    goals.saturating_add(questions).saturating_add(answers)
}

/// Feetech servos of one series on one port, at most [`MAX_SERVOS`].
///
/// Speed and acceleration of the goals are those that the servo holds: after a restart none, as fast as it can. They
/// have no watchdog. `N`: see [`Protocol1Client`].
#[derive(Debug)]
pub struct FeetechBus<U, D, T, const N: usize = 192> {
    reader: Reader<U, D, T, N>,
    schedule: ReadSchedule,
}

/// What reads, apart from who is read.
#[derive(Debug)]
struct Reader<U, D, T, const N: usize> {
    client: Protocol1Client<U, D, T, N>,
    series: Series,
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> FeetechBus<U, D, T, N> {
    /// A bus on a client's port.
    pub const fn new(client: Protocol1Client<U, D, T, N>, series: Series) -> Self {
        Self { reader: Reader { client, series }, schedule: ReadSchedule::new() }
    }

    /// Which servos they are.
    pub const fn series(&self) -> Series {
        self.reader.series
    }

    /// The client, for what the player does not need.
    pub fn client(&mut self) -> &mut Protocol1Client<U, D, T, N> {
        &mut self.reader.client
    }

    /// Longest time in microseconds that [`read_all`](ServoBus::read_all) takes, when servos fall silent.
    #[must_use]
    pub const fn read_limit_us(line: &LineConfig, servos: usize) -> u32 {
        let exchange = line.exchange_limit_us(OVERHEAD + 2, OVERHEAD + BLOCK_LEN, 1);
        let question = line.exchange_limit_us(servos.saturating_add(OVERHEAD + 2), 0, 0);
        let exchanges = (servos as u32).saturating_mul(2).saturating_add(PROBE_EXCHANGES);
        exchange.saturating_mul(exchanges).saturating_add(question.saturating_mul(2))
    }
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> ServoReader for Reader<U, D, T, N> {
    async fn read_together(
        &mut self,
        ids: &[u8],
        places: &[u8],
        readings: &mut [Option<Reading>],
    ) -> Result<(), BusError> {
        if self.series == Series::Sts {
            let mut asked = Vec::<u8, MAX_SERVOS>::new();
            let known = places.iter().filter_map(|&place| ids.get(usize::from(place)).copied());
            // There is room for as many; `collect` panics where there are more.
            known.take(MAX_SERVOS).for_each(|id| {
                let _ = asked.push(id);
            });
            let mut turn = AnswerOrder::default();
            let each = |at: usize, error: u8, data: &[u8]| {
                if let Some(&place) = places.get(at)
                    && let Some(slot) = readings.get_mut(usize::from(place))
                {
                    turn.enter(at, slot, reading(Series::Sts, error, data));
                }
            };
            return self.client.sync_read(BLOCK, BLOCK_LEN as u8, &asked, each).await.map(drop);
        }
        self.read_one_by_one(ids, places, readings).await
    }

    async fn read_alone(&mut self, id: u8, _index: usize) -> Result<Reading, BusError> {
        let mut data = [0; BLOCK_LEN];
        let error = self.client.read(id, BLOCK, &mut data).await?;
        reading(self.series, error, &data).ok_or(BusError::Corrupt)
    }
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> ServoBus for FeetechBus<U, D, T, N> {
    fn reads(&self, _index: usize) -> bool {
        true
    }

    /// Reads the servo's id rather than pinging it: a ping's own echo looks like its answer.
    async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let id = *ids.get(index).ok_or(BusError::TooMany)?;
        let mut identity = [0; 3];
        self.reader.client.read(id, IDENTITY, &mut identity).await?;
        let [_, _, own] = identity;
        if own != id {
            return Err(BusError::Corrupt);
        }
        self.schedule.note_answer(index);
        Ok(())
    }

    async fn set_torque(&mut self, ids: &[u8], index: usize, on: bool) -> Result<(), BusError> {
        let id = *ids.get(index).ok_or(BusError::TooMany)?;
        self.reader.client.write(id, TORQUE_ENABLE, &[u8::from(on)]).await.map(drop)
    }

    async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
        if goals.len() > MAX_SERVOS {
            return Err(BusError::TooMany);
        }
        let Reader { client, series } = &mut self.reader;
        let values = goals.iter().map(|goal| (goal.id, series.goal(goal.position)));
        client.sync_write(GOAL_POSITION, values).await
    }

    async fn read_all(&mut self, ids: &[u8], readings: &mut [Option<Reading>]) -> Result<(), BusError> {
        self.schedule.read_all(&mut self.reader, ids, readings).await
    }

    async fn reboot(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let id = *ids.get(index).ok_or(BusError::TooMany)?;
        self.reader.client.reboot(id).await
    }

    async fn set_watchdog(&mut self, _ids: &[u8], _millis: u16) -> Result<(), BusError> {
        Err(BusError::Unsupported)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_bits_of_their_own() {
        assert_eq!(Series::Sts.goal(2048), [0x00, 0x08]);
        assert_eq!(Series::Scs.goal(1000), [0x03, 0xE8]);
        assert_eq!(Series::Scs.goal(2000), Series::Scs.goal(1023));
        for position in -0x7FFF..=0x7FFF {
            assert_eq!(Series::Sts.position(Series::Sts.goal(position)), position);
        }
        assert_eq!(Series::Sts.goal(i32::MIN), [0xFF, 0xFF]);
        for position in 0..1024 {
            assert_eq!(Series::Scs.position(Series::Scs.goal(position)), position);
        }
        assert_eq!(signed(0x400 | 250, 10), -250);
    }

    #[test]
    fn error_bits_go_where_readings_have_them() {
        assert_eq!(hardware_error(0), 0);
        assert_eq!(hardware_error(0b10_1111), 0b11_1101);
        assert_eq!(hardware_error(0b1101_0000), 0);
    }
}

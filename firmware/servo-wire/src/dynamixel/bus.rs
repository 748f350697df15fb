//! Servos of the X series as a [`ServoBus`]: a Sync Write and a Fast Sync Read each tick.
//!
//! What a servo says to a ping decides how it is read. One with an old firmware has no Fast Sync Read, so its bus is
//! read by Sync Read. XL330 and XC330 have their indirect data elsewhere, so they are read by a joint read of their own.
//!
//! What a tick reads lies apart in the control table; indirect addresses bring it together
//! ([`DynamixelClient::set_indirect`]), once for each servo and again after its restart.

use super::client::{Answer, DynamixelClient, Ping, joint_answer_len};
use super::packet::{OVERHEAD, max_packet_len};
use super::sync_write::{goal_positions, goal_positions_len};
use super::table::{
    BUS_WATCHDOG, GOAL_POSITION, HARDWARE_ERROR_STATUS, INDIRECT_DATA, INDIRECT_DATA_X330, PRESENT_CURRENT,
    PRESENT_INPUT_VOLTAGE, PRESENT_POSITION, PRESENT_TEMPERATURE, Register, TORQUE_ENABLE,
};
use crate::bus::{BusError, ERROR_ALERT, ERROR_WATCHDOG, Goal, MAX_SERVOS, Reading, ServoBus};
use crate::port::LineConfig;
use crate::read_schedule::{AnswerOrder, PROBE_EXCHANGES, ReadSchedule, SET_UP_EXCHANGES, ServoReader};
use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};
use heapless::Vec;

/// What a tick reads of a servo, in this order.
const BLOCK: [Register; 7] = [
    TORQUE_ENABLE,
    HARDWARE_ERROR_STATUS,
    BUS_WATCHDOG,
    PRESENT_CURRENT,
    PRESENT_POSITION,
    PRESENT_INPUT_VOLTAGE,
    PRESENT_TEMPERATURE,
];

/// Bytes that a tick reads of a servo.
pub const BLOCK_LEN: usize = 12;

/// Address of each byte of the block.
#[allow(clippy::indexing_slicing, reason = "the compiler evaluates it")]
const ADDRESSES: [u16; BLOCK_LEN] = {
    let mut addresses = [0; BLOCK_LEN];
    let (mut at, mut register) = (0, 0);
    while register < BLOCK.len() {
        let mut byte = 0;
        while byte < BLOCK[register].len {
            addresses[at] = BLOCK[register].address + byte;
            (at, byte) = (at + 1, byte + 1);
        }
        register += 1;
    }
    assert!(at == BLOCK_LEN);
    addresses
};

/// Joint reads in a row that may fail while their servos answer when they are asked alone. As many mean that a servo has
/// no Fast Sync Read, whatever its firmware says.
const FAST_TRIES: u8 = 3;

/// Whether a servo knows Fast Sync Read: from firmware 45 on, an MX from 42 on (e-Manual, "Fast Sync Read").
const fn knows_fast_reads(model: u16, firmware: u8) -> bool {
    firmware >= if matches!(model, 30 | 311 | 321) { 42 } else { 45 }
}

/// Whether a servo is of the series XL330 or XC330.
const fn is_x330(model: u16) -> bool {
    matches!(model, 1190 | 1200 | 1210 | 1220 | 1230 | 1240)
}

/// Milliseconds that the servo's watchdog counts in.
const WATCHDOG_UNIT_MS: u16 = 20;

/// Bytes on the wire of a tick of this many servos: the Sync Write of their goals and the Fast Sync Read of their
/// state with its answer, without stuffing, which adds a byte wherever a goal or a list of ids holds `FF FF FD`.
#[must_use]
pub const fn tick_bytes(servos: usize) -> usize {
    const GOAL_LEN: usize = GOAL_POSITION.len as usize;
    let goals = servos.saturating_mul(1 + GOAL_LEN).saturating_add(OVERHEAD + 4);
    let question = servos.saturating_add(OVERHEAD + 4);
    goals.saturating_add(question).saturating_add(joint_answer_len(servos, BLOCK_LEN))
}

/// Servos of the X series (and MX with protocol 2.0) on one port, at most [`MAX_SERVOS`].
///
/// `N`: bytes of the longest packet, see [`DynamixelClient`].
#[derive(Debug)]
pub struct DynamixelBus<U, D, T, const N: usize = 640> {
    reader: Reader<U, D, T, N>,
    schedule: ReadSchedule,
}

/// What reads, apart from who is read.
#[derive(Debug)]
struct Reader<U, D, T, const N: usize> {
    client: DynamixelClient<U, D, T, N>,
    fast: bool,
    /// Fast joint reads in a row that failed although a servo of theirs answered alone.
    fast_failures: u8,
    /// The last joint read was fast, and nobody answered it.
    fast_unanswered: bool,
    /// A bit for each servo: its indirect addresses are set.
    set_up: u32,
    /// A bit for each servo: it is an XL330 or XC330.
    x330: u32,
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> DynamixelBus<U, D, T, N> {
    /// A bus that reads by Fast Sync Read, as long as all its servos know it.
    pub const fn new(client: DynamixelClient<U, D, T, N>) -> Self {
        let reader =
            Reader { client, fast: true, fast_failures: 0, fast_unanswered: false, set_up: 0, x330: 0 };
        Self { reader, schedule: ReadSchedule::new() }
    }

    /// Reads by plain Sync Read from the start. An answer then takes 11 bytes and a return delay more. A bus does so by
    /// itself once it has found a servo with a firmware before version 45 (MX: before 42).
    #[must_use]
    pub const fn with_plain_reads(mut self) -> Self {
        self.reader.fast = false;
        self
    }

    /// Gives the client back.
    pub fn into_client(self) -> DynamixelClient<U, D, T, N> {
        self.reader.client
    }

    /// The client, for what the player does not need.
    pub fn client(&mut self) -> &mut DynamixelClient<U, D, T, N> {
        &mut self.reader.client
    }

    /// Longest time in microseconds that [`write_goals`](ServoBus::write_goals) takes.
    #[must_use]
    pub const fn write_limit_us(line: &LineConfig, servos: usize) -> u32 {
        line.exchange_limit_us(goal_positions_len(servos), 0, 0)
    }

    /// Longest time in microseconds that [`read_all`](ServoBus::read_all) takes: two joint reads and three exchanges
    /// with one servo, in a tick in which a servo falls silent; or one joint read and eight exchanges, when servos
    /// come back. Where there are XL330 or XC330 among others, a joint read is two.
    #[must_use]
    pub const fn read_limit_us(line: &LineConfig, servos: usize) -> u32 {
        let answers = servos.saturating_mul(max_packet_len(1 + BLOCK_LEN));
        let joint = line
            .exchange_limit_us(max_packet_len(servos.saturating_add(4)), answers, servos)
            .saturating_add(line.exchange_limit_us(max_packet_len(servos.saturating_add(4)), 0, 1));
        let falling = joint.saturating_add(Self::single_limit_us(line, SET_UP_EXCHANGES));
        let rising = Self::single_limit_us(line, PROBE_EXCHANGES);
        joint.saturating_add(if falling > rising { falling } else { rising })
    }

    /// Longest time in microseconds of so many exchanges with one servo; of the other methods `ping` takes 3,
    /// `set_torque` and `reboot` 1, `set_watchdog` 2 for each servo.
    #[must_use]
    pub const fn single_limit_us(line: &LineConfig, exchanges: u32) -> u32 {
        let longest = max_packet_len(2 + 2 * BLOCK_LEN);
        line.exchange_limit_us(longest, longest, 1).saturating_mul(exchanges)
    }
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> Reader<U, D, T, N> {
    /// Sets up what a tick reads of the servo: two exchanges.
    async fn prepare(&mut self, id: u8, index: usize) -> Result<(), BusError> {
        self.client.set_indirect(id, 0, &ADDRESSES).await?;
        self.set_up |= bit(index);
        Ok(())
    }

    /// Notes who the servo is.
    fn note(&mut self, index: usize, who: Ping) {
        self.fast &= knows_fast_reads(who.model, who.firmware);
        self.x330 = if is_x330(who.model) { self.x330 | bit(index) } else { self.x330 & !bit(index) };
    }

    /// Where the servo's indirect data begin.
    const fn data(&self, index: usize) -> u16 {
        if self.x330 & bit(index) == 0 { INDIRECT_DATA } else { INDIRECT_DATA_X330 }
    }

    /// One joint read of the servos at these places, whose indirect data all begin at `data`.
    async fn read_group(
        &mut self,
        data: u16,
        ids: &[u8],
        places: &[u8],
        readings: &mut [Option<Reading>],
    ) -> Result<(), BusError> {
        let mut asked = Vec::<u8, MAX_SERVOS>::new();
        let known = places.iter().filter_map(|&place| ids.get(usize::from(place)).copied());
        known.take(MAX_SERVOS).for_each(|id| {
            let _ = asked.push(id);
        });
        let mut restarted = 0;
        let mut turn = AnswerOrder::default();
        let fast = self.fast;
        let each = |at: usize, answer: Answer<'_>| {
            let Some(&place) = places.get(at) else { return };
            let Some(slot) = readings.get_mut(usize::from(place)) else { return };
            let reading = reading(&answer);
            // A joint answer names every servo in its place.
            if fast {
                *slot = reading;
            } else if !turn.enter(at, slot, reading) {
                return;
            }
            if reading.is_none() {
                restarted |= bit(place.into());
            }
        };
        let len = BLOCK_LEN as u16;
        let result = match fast {
            true => self.client.fast_sync_read(data, len, &asked, each).await,
            false => self.client.sync_read(data, len, &asked, each).await,
        };
        self.set_up &= !restarted;
        self.fast_unanswered = fast && result.is_err();
        if result.is_ok() {
            self.fast_failures = 0;
        }
        result?;
        let good = places.iter().any(|&place| readings.get(usize::from(place)).is_some_and(Option::is_some));
        if good { Ok(()) } else { Err(BusError::Corrupt) }
    }
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> ServoReader for Reader<U, D, T, N> {
    fn is_set_up(&self, index: usize) -> bool {
        self.set_up & bit(index) != 0
    }

    async fn read_together(
        &mut self,
        ids: &[u8],
        places: &[u8],
        readings: &mut [Option<Reading>],
    ) -> Result<(), BusError> {
        let mut result = Err(BusError::TooMany);
        for data in [INDIRECT_DATA, INDIRECT_DATA_X330] {
            let mut own = Vec::<u8, MAX_SERVOS>::new();
            let group = match self.x330 {
                0 if data == INDIRECT_DATA => places,
                0 => break,
                _ => {
                    let is_own = |place: &&u8| self.data(usize::from(**place)) == data;
                    // There is room for as many; `collect` panics where there are more.
                    places.iter().filter(is_own).take(MAX_SERVOS).for_each(|&place| {
                        let _ = own.push(place);
                    });
                    &own
                }
            };
            if group.is_empty() {
                continue;
            }
            result = match (self.read_group(data, ids, group, readings).await, result) {
                (Ok(()), _) | (_, Ok(())) => Ok(()),
                (Err(error), _) => Err(error),
            };
        }
        result
    }

    async fn read_alone(&mut self, id: u8, index: usize) -> Result<Reading, BusError> {
        if !self.is_set_up(index) {
            self.prepare(id, index).await?;
        }
        let mut data = [0; BLOCK_LEN];
        let alert = self.client.read(id, self.data(index), &mut data).await?;
        if core::mem::take(&mut self.fast_unanswered) {
            self.fast_failures = self.fast_failures.saturating_add(1);
            self.fast = self.fast_failures < FAST_TRIES;
        }
        reading(&Answer { alert, data: &data }).ok_or_else(|| {
            self.set_up &= !bit(index);
            BusError::Corrupt
        })
    }
}

const fn bit(index: usize) -> u32 {
    1_u32.wrapping_shl(index as u32)
}

/// The block as a reading; `None` after a restart, when the indirect addresses name themselves and all is 0: no servo
/// that answers has a supply of 0 V.
fn reading(answer: &Answer<'_>) -> Option<Reading> {
    let &[torque, error, watchdog, c0, c1, p0, p1, p2, p3, v0, v1, temperature] =
        answer.data.first_chunk::<BLOCK_LEN>()?;
    let decivolts = u16::from_le_bytes([v0, v1]);
    if decivolts == 0 {
        return None;
    }
    let mut hardware_error = error & !(ERROR_WATCHDOG | ERROR_ALERT);
    if answer.alert && hardware_error == 0 {
        hardware_error |= ERROR_ALERT;
    }
    // The register is -1 once the watchdog has stopped the servo.
    if watchdog == u8::MAX {
        hardware_error |= ERROR_WATCHDOG;
    }
    Some(Reading {
        position: i32::from_le_bytes([p0, p1, p2, p3]),
        temperature: Some(temperature),
        millivolts: Some(decivolts.saturating_mul(100)),
        load: Some(i16::from_le_bytes([c0, c1])),
        hardware_error,
        torque: Some(torque != 0),
    })
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> ServoBus for DynamixelBus<U, D, T, N> {
    fn reads(&self, _index: usize) -> bool {
        true
    }

    /// Also sets up what a tick reads of the servo.
    async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let id = *ids.get(index).ok_or(BusError::TooMany)?;
        let who = self.reader.client.ping(id).await?;
        self.reader.note(index, who);
        self.reader.prepare(id, index).await?;
        self.schedule.note_answer(index);
        Ok(())
    }

    async fn set_torque(&mut self, ids: &[u8], index: usize, on: bool) -> Result<(), BusError> {
        let id = *ids.get(index).ok_or(BusError::TooMany)?;
        self.reader.client.write(id, TORQUE_ENABLE.address, &[u8::from(on)]).await.map(drop)
    }

    async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
        self.reader.client.send_packet(|buffer| goal_positions(buffer, goals)).await
    }

    async fn read_all(&mut self, ids: &[u8], readings: &mut [Option<Reading>]) -> Result<(), BusError> {
        self.schedule.read_all(&mut self.reader, ids, readings).await
    }

    async fn reboot(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let id = *ids.get(index).ok_or(BusError::TooMany)?;
        self.reader.set_up &= !bit(index);
        self.reader.client.reboot(id).await.map(drop)
    }

    /// Of up to 2.54 s in steps of 20 ms.
    async fn set_watchdog(&mut self, ids: &[u8], millis: u16) -> Result<(), BusError> {
        let units = millis.div_ceil(WATCHDOG_UNIT_MS).min(127) as u8;
        let mut result = Ok(());
        for &id in ids {
            // Only 0 revives a servo that its watchdog has stopped.
            let mut set = self.reader.client.write(id, BUS_WATCHDOG.address, &[0]).await;
            if units > 0 && set.is_ok() {
                set = self.reader.client.write(id, BUS_WATCHDOG.address, &[units]).await;
            }
            result = result.and(set.map(drop));
        }
        result
    }
}

//! The client, and its instructions to one servo.

use crate::bus::BusError;
use crate::dynamixel::framer::Framer;
use crate::dynamixel::instruction::{ALERT, BROADCAST_ID, Instruction, MAX_ID};
use crate::dynamixel::packet::{PacketWriter, Status, WriteError, max_packet_len};
use crate::dynamixel::table;
use crate::port::Port;
use core::ops::ControlFlow;
use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

/// Microseconds that each id is given to answer a broadcast ping; ROBOTIS' own client gives as much.
const BROADCAST_PING_US: u32 = 3000;

/// What a servo says to a ping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ping {
    /// Model number; 1020 is an XM430-W350.
    pub model: u16,
    /// Version of the servo's firmware.
    pub firmware: u8,
    /// Whether the servo reports a hardware error.
    pub alert: bool,
}

/// What a servo says to a read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer<'a> {
    /// Whether the servo reports a hardware error.
    pub alert: bool,
    /// The bytes that were asked for.
    pub data: &'a [u8],
}

/// What to set back to factory values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum FactoryReset {
    /// All, id and baud rate too. Servos refuse it as a broadcast.
    All = 0xFF,
    /// All but the id.
    AllButId = 0x01,
    /// All but id and baud rate.
    AllButIdAndBaud = 0x02,
}

/// A client on a port. `N`: bytes of the longest packet either way, kept twice; 640 serve 32 servos.
#[derive(Debug)]
pub struct DynamixelClient<U, D, T, const N: usize = 640> {
    pub(super) port: Port<U, D, T>,
    framer: Framer<N>,
    pub(super) packet: [u8; N],
}

impl From<WriteError> for BusError {
    fn from(_: WriteError) -> Self {
        Self::TooMany
    }
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> DynamixelClient<U, D, T, N> {
    /// A client that owns the port.
    pub const fn new(port: Port<U, D, T>) -> Self {
        Self { port, framer: Framer::new(), packet: [0; N] }
    }

    /// Gives the port back.
    pub fn into_port(self) -> Port<U, D, T> {
        self.port
    }

    /// The port.
    pub fn port(&self) -> &Port<U, D, T> {
        &self.port
    }

    /// The port, to change its rate.
    pub fn port_mut(&mut self) -> &mut Port<U, D, T> {
        &mut self.port
    }

    /// Asks a servo who it is.
    ///
    /// # Errors
    /// [`BusError::NoReply`] when there is none with this id; see [`BusError`] for others.
    pub async fn ping(&mut self, id: u8) -> Result<Ping, BusError> {
        let mut data = [0; 3];
        let alert = self.ask(id, Instruction::Ping, &[], &mut data).await?;
        Ok(ping_of(data, alert))
    }

    /// Asks all servos who they are and calls `found` with each id as it answers. Returns how many did.
    ///
    /// Takes 3 ms and the time of a packet for each possible id, 0.8 s at 1 Mbit/s, whoever answers. Where servos
    /// talk at once both are lost; ping ids one by one to be sure.
    ///
    /// # Errors
    /// [`BusError::Port`] or, for a shorted line with echo, [`BusError::Corrupt`].
    pub async fn broadcast_ping(&mut self, mut found: impl FnMut(u8, Ping)) -> Result<usize, BusError> {
        self.send(BROADCAST_ID, Instruction::Ping, &[]).await?;
        const IDS: u32 = MAX_ID as u32 + 1;
        let ids = IDS as usize;
        let line = self.port.line();
        let limit = line
            .reply_limit_us(ids.saturating_mul(max_packet_len(4)), 1)
            .saturating_add(IDS * BROADCAST_PING_US);
        let mut seen = Seen::default();
        let result = self
            .statuses(limit, |status| {
                if let &[low, high, firmware] = status.parameters
                    && seen.insert(status.id)
                {
                    found(status.id, ping_of([low, high, firmware], status.alert()));
                }
                if seen.count < ids { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            })
            .await;
        match result {
            Err(BusError::Port) if seen.count == 0 => Err(BusError::Port),
            _ => Ok(seen.count),
        }
    }

    /// Reads `data.len()` bytes from `address` on. Returns whether the servo reports a hardware error.
    ///
    /// # Errors
    /// [`BusError`].
    pub async fn read(&mut self, id: u8, address: u16, data: &mut [u8]) -> Result<bool, BusError> {
        let len = u16::try_from(data.len()).map_err(|_| BusError::TooMany)?;
        self.ask(id, Instruction::Read, &[&address.to_le_bytes(), &len.to_le_bytes()], data).await
    }

    /// Reads `len` bytes from `address` on of all servos that have this id, and waits as long as two of them may answer. Returns
    /// how many did: 1 where each servo has an id of its own.
    ///
    /// # Errors
    /// [`BusError::NoReply`] when none did, [`BusError::Corrupt`] when no answer was whole, as where two talk at once; see
    /// [`BusError`] for others.
    pub async fn count_answers(&mut self, id: u8, address: u16, len: u16) -> Result<usize, BusError> {
        self.send(id, Instruction::Read, &[&address.to_le_bytes(), &len.to_le_bytes()]).await?;
        let limit = self.port.line().reply_limit_us(max_packet_len(len.into()).saturating_mul(2), 2);
        let mut count = 0_usize;
        let heard = self.statuses::<()>(limit, |status| {
            count = count.saturating_add((status.id == id).into());
            ControlFlow::Continue(())
        });
        match heard.await {
            Err(error) if count == 0 => Err(error),
            _ => Ok(count),
        }
    }

    /// Writes bytes from `address` on. Returns whether the servo reports a hardware error.
    ///
    /// To [`BROADCAST_ID`] nothing answers, and `false` is returned once it is sent.
    ///
    /// # Errors
    /// [`BusError`].
    pub async fn write(&mut self, id: u8, address: u16, data: &[u8]) -> Result<bool, BusError> {
        self.ask(id, Instruction::Write, &[&address.to_le_bytes(), data], &mut []).await
    }

    /// As [`write`](Self::write), but carried out by [`action`](Self::action).
    ///
    /// # Errors
    /// [`BusError`].
    pub async fn reg_write(&mut self, id: u8, address: u16, data: &[u8]) -> Result<bool, BusError> {
        self.ask(id, Instruction::RegWrite, &[&address.to_le_bytes(), data], &mut []).await
    }

    /// Carries out what [`reg_write`](Self::reg_write) left; to [`BROADCAST_ID`] on all servos at the same moment.
    ///
    /// # Errors
    /// [`BusError`]; [`BusError::Refused`] with 2 when nothing was left.
    pub async fn action(&mut self, id: u8) -> Result<bool, BusError> {
        self.ask(id, Instruction::Action, &[], &mut []).await
    }

    /// Restarts a servo: its RAM goes back to initial values and torque off. It is silent for a while after.
    ///
    /// # Errors
    /// [`BusError`].
    pub async fn reboot(&mut self, id: u8) -> Result<bool, BusError> {
        self.ask(id, Instruction::Reboot, &[], &mut []).await
    }

    /// Brings Present Position back into one turn; the servo must stand still.
    ///
    /// # Errors
    /// [`BusError`].
    pub async fn clear_turns(&mut self, id: u8) -> Result<bool, BusError> {
        self.ask(id, Instruction::Clear, &[&[0x01, 0x44, 0x58, 0x4C, 0x22]], &mut []).await
    }

    /// Sets a servo back to factory values; it restarts.
    ///
    /// # Errors
    /// [`BusError`].
    pub async fn factory_reset(&mut self, id: u8, what: FactoryReset) -> Result<bool, BusError> {
        self.ask(id, Instruction::FactoryReset, &[&[what as u8]], &mut []).await
    }

    /// Makes the bytes from [`INDIRECT_DATA`](table::INDIRECT_DATA)` + first` on stand for those at `addresses`, so
    /// that registers which lie apart come in one read. At most 28 bytes in all.
    ///
    /// What is already so is left: models that keep indirect addresses in EEPROM refuse to change them while torque
    /// is on, and a player that restarts before a standing puppet must not need to.
    ///
    /// # Errors
    /// [`BusError`]; [`BusError::TooMany`] beyond 28 bytes.
    pub async fn set_indirect(&mut self, id: u8, first: u8, addresses: &[u16]) -> Result<(), BusError> {
        const MOST: usize = 28;
        let len = addresses.len().saturating_mul(2);
        let (mut found, mut wanted) = ([0; 2 * MOST], [0; 2 * MOST]);
        if addresses.len().saturating_add(first.into()) > MOST {
            return Err(BusError::TooMany);
        }
        for (slot, address) in wanted.chunks_exact_mut(2).zip(addresses) {
            slot.copy_from_slice(&address.to_le_bytes());
        }
        let (found, wanted) = (found.get_mut(..len), wanted.get(..len));
        let (Some(found), Some(wanted)) = (found, wanted) else { return Err(BusError::TooMany) };
        let start = u16::from(first).saturating_mul(2).saturating_add(table::INDIRECT_ADDRESS);
        self.read(id, start, found).await?;
        if found != wanted {
            self.write(id, start, wanted).await?;
        }
        Ok(())
    }

    /// Sends a packet that `write` writes into the client's buffer.
    pub(crate) async fn send_packet(
        &mut self,
        write: impl FnOnce(&mut [u8; N]) -> Result<&[u8], WriteError>,
    ) -> Result<(), BusError> {
        self.port.send(write(&mut self.packet)?).await
    }

    /// Bytes of the answer with this much data at most, if there is room for it.
    pub(super) const fn room(data: usize) -> Result<usize, BusError> {
        let len = max_packet_len(data.saturating_add(1));
        if len > N { Err(BusError::TooMany) } else { Ok(len) }
    }

    /// Sends one packet.
    pub(super) async fn send(
        &mut self,
        id: u8,
        instruction: Instruction,
        parts: &[&[u8]],
    ) -> Result<(), BusError> {
        let mut writer = PacketWriter::new(&mut self.packet, id, instruction)?;
        for part in parts {
            writer.push(part)?;
        }
        self.port.send(writer.finish()?).await
    }

    /// Sends one packet and awaits its answer, which fills `data`. Returns the alert.
    async fn ask(
        &mut self,
        id: u8,
        instruction: Instruction,
        parts: &[&[u8]],
        data: &mut [u8],
    ) -> Result<bool, BusError> {
        let len = Self::room(data.len())?;
        self.send(id, instruction, parts).await?;
        if id == BROADCAST_ID {
            return Ok(false);
        }
        let limit = self.port.line().reply_limit_us(len, 1);
        let answer = self.statuses(limit, |status| {
            if status.id != id {
                return ControlFlow::Continue(());
            }
            match answer_of(status, data.len()) {
                Ok(Some(answer)) => {
                    data.copy_from_slice(answer.data);
                    ControlFlow::Break(Ok(answer.alert))
                }
                Ok(None) => ControlFlow::Continue(()),
                Err(error) => ControlFlow::Break(Err(error)),
            }
        });
        answer.await?
    }

    /// Gives `on` each status packet that comes until it breaks or `limit_us` is over.
    pub(super) async fn statuses<R>(
        &mut self,
        limit_us: u32,
        mut on: impl FnMut(&Status<'_>) -> ControlFlow<R>,
    ) -> Result<R, BusError> {
        let Self { port, framer, .. } = self;
        framer.clear();
        let received = port.receive(limit_us, |mut chunk| {
            while let Some(frame) = framer.feed(&mut chunk) {
                if let Some(status) = frame.ok().and_then(|packet| packet.status()) {
                    on(&status)?;
                }
            }
            ControlFlow::Continue(())
        });
        let error = match received.await {
            Ok(done) => return Ok(done),
            Err(error) => error,
        };
        // A wrong length may have swallowed packets that are whole.
        while let Some(frame) = framer.flush() {
            if let Some(status) = frame.ok().and_then(|packet| packet.status())
                && let ControlFlow::Break(done) = on(&status)
            {
                return Ok(done);
            }
        }
        Err(error)
    }
}

/// The answer in a status with `len` bytes of data; `None` for one of another length, which answers something else.
pub(super) fn answer_of<'s>(status: &Status<'s>, len: usize) -> Result<Option<Answer<'s>>, BusError> {
    let number = status.error & !ALERT;
    if number != 0 {
        return Err(BusError::Refused(number));
    }
    let data = status.parameters;
    Ok((data.len() == len).then_some(Answer { alert: status.alert(), data }))
}

fn ping_of([low, high, firmware]: [u8; 3], alert: bool) -> Ping {
    Ping { model: u16::from_le_bytes([low, high]), firmware, alert }
}

/// Ids that have answered.
#[derive(Default)]
pub(super) struct Seen {
    ids: [u32; 8],
    pub(super) count: usize,
}

impl Seen {
    /// Whether the id is new, and one that a servo can have.
    pub(super) fn insert(&mut self, id: u8) -> bool {
        let bit = 1 << (id % 32);
        match self.ids.get_mut(usize::from(id / 32)) {
            Some(word) if id <= MAX_ID && *word & bit == 0 => {
                *word |= bit;
                self.count = self.count.saturating_add(1);
                true
            }
            _ => false,
        }
    }
}

//! A client of protocol 1.0: one instruction out, its answers back.
//!
//! Each method is one exchange and returns within [`LineConfig::exchange_limit_us`](crate::port::LineConfig). Servos
//! must answer everything (Status Return Level 2 of Dynamixel servos, 1 of Feetech ones, as from the factory).
//!
//! An answer looks like an instruction. Where the port hears itself and
//! [`LineConfig::echo`](crate::port::LineConfig) is not set, a ping is answered by its own echo; everything else is
//! not taken for an answer, having another length.

use super::packet::{BROADCAST_ID, Framer, Instruction, OVERHEAD, Packet, write};
use crate::bus::BusError;
use crate::port::Port;
use core::ops::ControlFlow;
use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

/// A client on a port. `N`: bytes of the longest packet either way, kept twice, at most 259; 192 serve 32 servos.
#[derive(Debug)]
pub struct Protocol1Client<U, D, T, const N: usize = 192> {
    port: Port<U, D, T>,
    framer: Framer<N>,
    packet: [u8; N],
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> Protocol1Client<U, D, T, N> {
    /// A client that owns the port.
    pub const fn new(port: Port<U, D, T>) -> Self {
        Self { port, framer: Framer::new(), packet: [0; N] }
    }

    /// The port.
    pub fn port(&self) -> &Port<U, D, T> {
        &self.port
    }

    /// The port, to change its rate.
    pub fn port_mut(&mut self) -> &mut Port<U, D, T> {
        &mut self.port
    }

    /// Asks whether there is a servo. Returns its error byte.
    ///
    /// # Errors
    /// [`BusError::NoReply`] when there is none with this id; see [`BusError`] for others.
    pub async fn ping(&mut self, id: u8) -> Result<u8, BusError> {
        self.ask(id, Instruction::Ping, &[], &mut []).await
    }

    /// Reads `data.len()` bytes from `address` on. Returns the error byte.
    ///
    /// # Errors
    /// [`BusError`].
    pub async fn read(&mut self, id: u8, address: u8, data: &mut [u8]) -> Result<u8, BusError> {
        let len = u8::try_from(data.len()).map_err(|_| BusError::TooMany)?;
        self.ask(id, Instruction::Read, &[&[address, len]], data).await
    }

    /// Reads `len` bytes from `address` on of all servos that have this id, and waits as long as two of them may answer. Returns
    /// how many did: 1 where each servo has an id of its own.
    ///
    /// # Errors
    /// [`BusError::NoReply`] when none did, [`BusError::Corrupt`] when no answer was whole, as where two talk at once; see
    /// [`BusError`] for others.
    pub async fn count_answers(&mut self, id: u8, address: u8, len: u8) -> Result<usize, BusError> {
        self.send(id, Instruction::Read, &[&[address, len]]).await?;
        let bytes = usize::from(len).saturating_add(OVERHEAD).saturating_mul(2);
        let limit = self.port.line().reply_limit_us(bytes, 2);
        let mut count = 0_usize;
        let heard = self.packets::<()>(limit, |packet| {
            let answers = packet.id == id && packet.parameters.len() == usize::from(len);
            count = count.saturating_add(answers.into());
            ControlFlow::Continue(())
        });
        match heard.await {
            Err(error) if count == 0 => Err(error),
            _ => Ok(count),
        }
    }

    /// Writes bytes from `address` on. Returns the error byte; 0 at once for [`BROADCAST_ID`], which nobody answers.
    ///
    /// # Errors
    /// [`BusError`].
    pub async fn write(&mut self, id: u8, address: u8, data: &[u8]) -> Result<u8, BusError> {
        self.ask(id, Instruction::Write, &[&[address], data], &mut []).await
    }

    /// As [`write`](Self::write), but carried out by [`action`](Self::action).
    ///
    /// # Errors
    /// [`BusError`].
    pub async fn reg_write(&mut self, id: u8, address: u8, data: &[u8]) -> Result<u8, BusError> {
        self.ask(id, Instruction::RegWrite, &[&[address], data], &mut []).await
    }

    /// Has all servos carry out what [`reg_write`](Self::reg_write) left, at the same moment. Nothing answers.
    ///
    /// # Errors
    /// [`BusError::Port`].
    pub async fn action(&mut self) -> Result<(), BusError> {
        self.ask(BROADCAST_ID, Instruction::Action, &[], &mut []).await.map(drop)
    }

    /// Sets a servo back to factory values, id and baud rate too.
    ///
    /// # Errors
    /// [`BusError`].
    pub async fn factory_reset(&mut self, id: u8) -> Result<u8, BusError> {
        self.ask(id, Instruction::FactoryReset, &[], &mut []).await
    }

    /// Restarts a Feetech servo, which does not answer.
    ///
    /// # Errors
    /// [`BusError::Port`].
    pub async fn reboot(&mut self, id: u8) -> Result<(), BusError> {
        self.send(id, Instruction::Reboot, &[]).await
    }

    /// Sync Write: each servo (id, value) gets `LEN` bytes from `address` on. Nothing answers.
    ///
    /// # Errors
    /// [`BusError::TooMany`] when the packet is longer than `N`, [`BusError::Port`].
    pub async fn sync_write<const LEN: usize>(
        &mut self,
        address: u8,
        values: impl IntoIterator<Item = (u8, [u8; LEN])>,
    ) -> Result<(), BusError> {
        let mut entries = heapless::Vec::<u8, N>::new();
        for (id, value) in values {
            entries.push(id).map_err(|_| BusError::TooMany)?;
            entries.extend_from_slice(&value).map_err(|_| BusError::TooMany)?;
        }
        self.send(BROADCAST_ID, Instruction::SyncWrite, &[&[address, LEN as u8], &entries]).await
    }

    /// Sync Read of Feetech STS and SMS servos: `len` bytes from `address` on of each of `ids` (each once). Calls
    /// `each` with the place in `ids`, the error byte and the bytes, as they come; servos that keep silent are left
    /// out, and one that answers twice, which may be two of one id, is given twice. Returns how many answered.
    ///
    /// # Errors
    /// Why, when none answered; [`BusError::TooMany`] when a packet would be longer than `N`.
    pub async fn sync_read(
        &mut self,
        address: u8,
        len: u8,
        ids: &[u8],
        mut each: impl FnMut(usize, u8, &[u8]),
    ) -> Result<usize, BusError> {
        self.room(len.into())?;
        self.send(BROADCAST_ID, Instruction::SyncRead, &[&[address, len], ids]).await?;
        let mut heard = [0_u32; 8];
        let mut good = 0;
        let bytes = usize::from(len).saturating_add(OVERHEAD).saturating_mul(ids.len());
        let limit = self.port.line().reply_limit_us(bytes, ids.len());
        let result = self.packets(limit, |packet| {
            let bit = 1 << (packet.id % 32);
            if let Some(place) = ids.iter().position(|&id| id == packet.id)
                && packet.parameters.len() == usize::from(len)
                && let Some(word) = heard.get_mut(usize::from(packet.id / 32))
            {
                good = usize::saturating_add(good, (*word & bit == 0).into());
                *word |= bit;
                each(place, packet.code, packet.parameters);
            }
            if good < ids.len() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        match result.await {
            Err(error) if good == 0 => Err(error),
            _ => Ok(good),
        }
    }

    fn room(&self, parameters: usize) -> Result<(), BusError> {
        if parameters.saturating_add(OVERHEAD) > N { Err(BusError::TooMany) } else { Ok(()) }
    }

    async fn send(&mut self, id: u8, instruction: Instruction, parts: &[&[u8]]) -> Result<(), BusError> {
        self.port.send(write(&mut self.packet, id, instruction as u8, parts)?).await
    }

    /// Sends one packet and awaits its answer, which fills `data`. Returns the error byte.
    async fn ask(
        &mut self,
        id: u8,
        instruction: Instruction,
        parts: &[&[u8]],
        data: &mut [u8],
    ) -> Result<u8, BusError> {
        self.room(data.len())?;
        self.send(id, instruction, parts).await?;
        if id == BROADCAST_ID {
            return Ok(0);
        }
        // A read of two bytes is as long as its answer.
        let echo = match (instruction, parts) {
            (Instruction::Read, &[&[address, len]]) => Some([address, len]),
            _ => None,
        };
        let limit = self.port.line().reply_limit_us(data.len().saturating_add(OVERHEAD), 1);
        let answer = self.packets(limit, |packet| {
            let itself =
                packet.code == instruction as u8 && echo.is_some_and(|echo| echo == packet.parameters);
            if packet.id != id || packet.parameters.len() != data.len() || itself {
                return ControlFlow::Continue(());
            }
            data.copy_from_slice(packet.parameters);
            ControlFlow::Break(packet.code)
        });
        answer.await
    }

    /// Gives `on` each packet that comes until it breaks or `limit_us` is over.
    async fn packets<R>(
        &mut self,
        limit_us: u32,
        mut on: impl FnMut(&Packet<'_>) -> ControlFlow<R>,
    ) -> Result<R, BusError> {
        let Self { port, framer, .. } = self;
        framer.clear();
        let received = port.receive(limit_us, |mut chunk| {
            while let Some(packet) = framer.feed(&mut chunk) {
                on(&packet)?;
            }
            ControlFlow::Continue(())
        });
        let error = match received.await {
            Ok(done) => return Ok(done),
            Err(error) => error,
        };
        // A wrong length may have swallowed packets that are whole.
        while let Some(packet) = framer.flush() {
            if let ControlFlow::Break(done) = on(&packet) {
                return Ok(done);
            }
        }
        Err(error)
    }
}

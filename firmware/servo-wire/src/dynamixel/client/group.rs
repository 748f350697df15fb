//! Instructions to many servos at once: Sync and Bulk.

use super::single::{Answer, DynamixelClient, Seen, answer_of};
use crate::bus::BusError;
use crate::dynamixel::instruction::{BROADCAST_ID, Instruction};
use crate::dynamixel::packet::{PacketWriter, max_packet_len};
use crate::dynamixel::sync_write::sync_write;
use core::ops::ControlFlow;
use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

/// What a bulk read asks of one servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BulkItem {
    /// Id of the servo; once in a list.
    pub id: u8,
    /// Address of the first byte.
    pub address: u16,
    /// Number of bytes.
    pub len: u16,
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> DynamixelClient<U, D, T, N> {
    /// Sync Write: each servo (id, little-endian value) gets `LEN` bytes from `address` on. Nothing answers.
    ///
    /// # Errors
    /// [`BusError::TooMany`] when the packet is longer than `N`, [`BusError::Port`].
    pub async fn sync_write<const LEN: usize>(
        &mut self,
        address: u16,
        values: impl IntoIterator<Item = (u8, [u8; LEN])>,
    ) -> Result<(), BusError> {
        self.send_packet(|buffer| sync_write(buffer, address, values)).await
    }

    /// Bulk Write: each servo gets its bytes from its address on, (id, address, bytes). Nothing answers.
    ///
    /// # Errors
    /// [`BusError::TooMany`] when the packet is longer than `N`, [`BusError::Port`].
    pub async fn bulk_write(&mut self, items: &[(u8, u16, &[u8])]) -> Result<(), BusError> {
        let mut writer = PacketWriter::new(&mut self.packet, BROADCAST_ID, Instruction::BulkWrite)?;
        for &(id, address, data) in items {
            let len = u16::try_from(data.len()).map_err(|_| BusError::TooMany)?;
            push_item(&mut writer, BulkItem { id, address, len })?;
            writer.push(data)?;
        }
        self.port.send(writer.finish()?).await
    }

    /// Sync Read: `len` bytes from `address` on of each of `ids` (each once). Calls `each` with the place in `ids`
    /// and the answer as it comes; servos that keep silent, refuse or are garbled are left out. A servo that answers
    /// twice, which may be two of one id, is given twice. Returns how many answered.
    ///
    /// # Errors
    /// Why, when none answered; [`BusError::TooMany`] when a packet would be longer than `N`.
    pub async fn sync_read(
        &mut self,
        address: u16,
        len: u16,
        ids: &[u8],
        each: impl FnMut(usize, Answer<'_>),
    ) -> Result<usize, BusError> {
        Self::room(len.into())?;
        self.send_sync_read(Instruction::SyncRead, address, len, ids).await?;
        self.collect(ids.iter().map(|&id| (id, usize::from(len))), each).await
    }

    /// Bulk Read: as [`sync_read`](Self::sync_read), with an address and a length for each servo.
    ///
    /// # Errors
    /// As [`sync_read`](Self::sync_read).
    pub async fn bulk_read(
        &mut self,
        items: &[BulkItem],
        each: impl FnMut(usize, Answer<'_>),
    ) -> Result<usize, BusError> {
        items.iter().try_for_each(|item| Self::room(item.len.into()).map(drop))?;
        self.send_bulk_read(Instruction::BulkRead, items).await?;
        self.collect(items.iter().map(|item| (item.id, usize::from(item.len))), each).await
    }

    pub(super) async fn send_sync_read(
        &mut self,
        instruction: Instruction,
        address: u16,
        len: u16,
        ids: &[u8],
    ) -> Result<(), BusError> {
        self.send(BROADCAST_ID, instruction, &[&address.to_le_bytes(), &len.to_le_bytes(), ids]).await
    }

    pub(super) async fn send_bulk_read(
        &mut self,
        instruction: Instruction,
        items: &[BulkItem],
    ) -> Result<(), BusError> {
        let mut writer = PacketWriter::new(&mut self.packet, BROADCAST_ID, instruction)?;
        for &item in items {
            push_item(&mut writer, item)?;
        }
        self.port.send(writer.finish()?).await
    }

    /// Takes one status packet of each servo (id, bytes of data).
    async fn collect(
        &mut self,
        asked: impl Iterator<Item = (u8, usize)> + Clone,
        mut each: impl FnMut(usize, Answer<'_>),
    ) -> Result<usize, BusError> {
        let (mut servos, mut bytes) = (0, 0);
        for (_, len) in asked.clone() {
            servos = usize::saturating_add(servos, 1);
            bytes = usize::saturating_add(bytes, max_packet_len(len.saturating_add(1)));
        }
        let limit = self.port.line().reply_limit_us(bytes, servos);
        let (mut heard, mut good) = (Seen::default(), 0);
        let result = self.statuses(limit, |status| {
            let place = (0..usize::MAX).zip(asked.clone()).find(|(_, (id, _))| *id == status.id);
            let Some((place, (id, len))) = place else { return ControlFlow::Continue(()) };
            match answer_of(status, len) {
                Ok(None) => return ControlFlow::Continue(()),
                Ok(Some(answer)) => {
                    good = usize::saturating_add(good, heard.insert(id).into());
                    each(place, answer);
                }
                Err(_) => {
                    heard.insert(id);
                }
            }
            if heard.count < servos { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        match result.await {
            Err(error) if good == 0 => Err(error),
            Ok(()) if good == 0 => Err(BusError::Corrupt),
            _ => Ok(good),
        }
    }
}

fn push_item(writer: &mut PacketWriter<'_>, item: BulkItem) -> Result<(), BusError> {
    writer.push(&[item.id])?;
    writer.push(&item.address.to_le_bytes())?;
    Ok(writer.push(&item.len.to_le_bytes())?)
}

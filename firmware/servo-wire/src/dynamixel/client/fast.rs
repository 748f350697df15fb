//! Fast Sync Read and Fast Bulk Read: all servos answer in one joint packet.
//!
//! `FF FF FD 00 FE`, length, `55`, then for each servo in the order asked: error, id, data, checksum. Each checksum
//! covers all bytes before it, earlier checksums included; nothing is stuffed (e-Manual, "Fast Sync Read"). A
//! checksum is all that the next one needs of what is before, so each part can be checked from the one before it:
//! bytes that were hit cost their own servo's answer, and a hit checksum the next one's too.

use super::group::BulkItem;
use super::single::{Answer, DynamixelClient};
use crate::bus::BusError;
use crate::dynamixel::crc;
use crate::dynamixel::instruction::{ALERT, BROADCAST_ID, Instruction};
use crate::dynamixel::packet::HEADER;
use core::ops::ControlFlow;
use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

/// Bytes before the first servo's part.
const START: usize = 8;

/// Bytes of a servo's part besides its data: error, id, checksum.
const PART: usize = 4;

/// Bytes of the joint answer of `servos` servos with `len` bytes each.
#[must_use]
pub const fn joint_answer_len(servos: usize, len: usize) -> usize {
    PART.saturating_add(len).saturating_mul(servos).saturating_add(START)
}

impl<U: Read + Write, D: OutputPin, T: DelayNs, const N: usize> DynamixelClient<U, D, T, N> {
    /// Fast Sync Read: as [`sync_read`](Self::sync_read), in less time. Where a servo keeps silent, those behind it
    /// in the list cannot answer either.
    ///
    /// # Errors
    /// As [`sync_read`](Self::sync_read).
    pub async fn fast_sync_read(
        &mut self,
        address: u16,
        len: u16,
        ids: &[u8],
        each: impl FnMut(usize, Answer<'_>),
    ) -> Result<usize, BusError> {
        Self::joint_room(ids.len(), usize::from(len), ids.len().saturating_mul(len.into()))?;
        self.send_sync_read(Instruction::FastSyncRead, address, len, ids).await?;
        self.collect_joint(ids.iter().map(|&id| (id, usize::from(len))), each).await
    }

    /// Fast Bulk Read: as [`bulk_read`](Self::bulk_read), in less time.
    ///
    /// # Errors
    /// As [`bulk_read`](Self::bulk_read).
    pub async fn fast_bulk_read(
        &mut self,
        items: &[BulkItem],
        each: impl FnMut(usize, Answer<'_>),
    ) -> Result<usize, BusError> {
        let lens = items.iter().map(|item| usize::from(item.len));
        let sum = lens.clone().fold(0, usize::saturating_add);
        Self::joint_room(items.len(), lens.max().unwrap_or(0), sum)?;
        self.send_bulk_read(Instruction::FastBulkRead, items).await?;
        self.collect_joint(items.iter().map(|item| (item.id, usize::from(item.len))), each).await
    }

    /// Whether the longest part has room, and the whole answer a length that 16 bits can say.
    fn joint_room(servos: usize, longest: usize, sum: usize) -> Result<(), BusError> {
        let length = servos.saturating_mul(PART).saturating_add(sum).saturating_add(1);
        let good = PART.saturating_add(longest) <= N && length <= usize::from(u16::MAX);
        if good { Ok(()) } else { Err(BusError::TooMany) }
    }

    async fn collect_joint(
        &mut self,
        asked: impl Iterator<Item = (u8, usize)> + Clone,
        mut each: impl FnMut(usize, Answer<'_>),
    ) -> Result<usize, BusError> {
        let parts = asked.clone().map(|(_, len)| PART.saturating_add(len));
        let add =
            |(servos, bytes): (usize, usize), part| (servos.saturating_add(1), bytes.saturating_add(part));
        let (servos, bytes) = parts.fold((0, 0), add);
        let length = bytes.saturating_add(1) as u16;
        let [h0, h1, h2, h3] = HEADER;
        let [low, high] = length.to_le_bytes();
        let start = [h0, h1, h2, h3, BROADCAST_ID, low, high, Instruction::Status as u8];
        let Self { port, packet, .. } = self;
        let mut asked = (0..usize::MAX).zip(asked);
        let mut part = asked.next();
        let (mut window, mut len, mut good) = ([0; START], None, 0);
        let mut before = crc::update(0, &start);
        let limit = port.line().reply_limit_us(bytes.saturating_add(START), servos);
        let result = port.receive(limit, |chunk| {
            for &byte in chunk {
                let Some((place, (id, data))) = part else { break };
                let Some(filled) = len.as_mut() else {
                    window.rotate_left(1);
                    if let Some(last) = window.last_mut() {
                        *last = byte;
                    }
                    len = (window == start).then_some(0);
                    continue;
                };
                if let Some(slot) = packet.get_mut(*filled) {
                    *slot = byte;
                }
                *filled = filled.wrapping_add(1);
                if *filled < PART.saturating_add(data) {
                    continue;
                }
                let bytes = packet.get(..*filled).unwrap_or_default();
                *filled = 0;
                part = asked.next();
                let Some((body, checksum)) = bytes.split_last_chunk::<2>() else { continue };
                let said = u16::from_le_bytes(*checksum);
                let right = crc::update(before, body) == said;
                before = crc::update(said, checksum);
                if let [error, from, data @ ..] = body
                    && right
                    && *from == id
                    && error & !ALERT == 0
                {
                    good = usize::saturating_add(good, 1);
                    each(place, Answer { alert: error & ALERT != 0, data });
                }
            }
            if part.is_some() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        match result.await {
            Err(error) if good == 0 => Err(error),
            Ok(()) if good == 0 && servos > 0 => Err(BusError::Corrupt),
            _ => Ok(good),
        }
    }
}

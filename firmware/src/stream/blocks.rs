//! The blocks that wait for their time, in any order.

use super::error::StreamError;
use crate::collect::numbered;
use decoder_core::mclip::{BLOCK_HEADER_BYTES, BlockHeader};

/// Blocks that wait at most.
pub const MOST_BLOCKS: usize = 32;

/// The frame behind a block's last one.
const fn end(block: &BlockHeader) -> u32 {
    block.first_frame.saturating_add(block.frames as u32)
}

/// What became of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    Waits,
    Known,
    /// There is no place for it.
    Full,
}

/// Memory with the stream's header in front, and behind it places for blocks, each as large as the longest one.
#[derive(Debug)]
pub(super) struct Blocks<'s> {
    memory: &'s mut [u8],
    /// Bytes of the header, and how many of them were received.
    header: usize,
    received: usize,
    /// Bytes of a place; 0 before there are any.
    place: usize,
    /// What waits in each place.
    waiting: [Option<BlockHeader>; MOST_BLOCKS],
}

impl<'s> Blocks<'s> {
    pub const fn new(memory: &'s mut [u8]) -> Self {
        Self { memory, header: 0, received: 0, place: 0, waiting: [None; MOST_BLOCKS] }
    }

    /// Forgets all, for a stream whose header has so many bytes.
    pub fn begin(&mut self, header: usize) -> Result<(), StreamError> {
        let room = self.memory.len();
        if header > room {
            return Err(StreamError::TooLarge { needed: header as u32, room: room as u32 });
        }
        (self.header, self.received, self.place) = (header, 0, 0);
        self.waiting = [None; MOST_BLOCKS];
        Ok(())
    }

    /// Takes bytes of the header.
    pub fn receive_header(&mut self, offset: usize, bytes: &[u8]) -> Result<bool, StreamError> {
        let known = self
            .received
            .checked_sub(offset)
            .ok_or(StreamError::Gap { expected: self.received as u32, found: offset as u32 })?;
        let new = bytes.get(known..).unwrap_or_default();
        let places = self.memory.get_mut(self.received..self.header).unwrap_or_default();
        if new.len() > places.len() {
            return Err(StreamError::TooLarge {
                needed: self.received.saturating_add(new.len()) as u32,
                room: self.header as u32,
            });
        }
        places.iter_mut().zip(new).for_each(|(place, &byte)| *place = byte);
        self.received = self.received.saturating_add(new.len());
        Ok(self.received == self.header)
    }

    /// The header, as far as it was received.
    pub fn header(&self) -> &[u8] {
        self.memory.get(..self.received).unwrap_or_default()
    }

    /// Makes places for blocks whose codes have at most so many bytes.
    pub fn open(&mut self, block_bytes: usize) -> Result<(), StreamError> {
        let (place, room) = (block_bytes.saturating_add(BLOCK_HEADER_BYTES), self.memory.len());
        self.place = place;
        let needed = self.header.saturating_add(place.saturating_mul(2));
        if needed > room {
            return Err(StreamError::TooLarge { needed: needed as u32, room: room as u32 });
        }
        Ok(())
    }

    /// Places in all.
    pub fn places(&self) -> usize {
        let room = self.memory.len().saturating_sub(self.header);
        room.checked_div(self.place).unwrap_or(0).min(MOST_BLOCKS)
    }

    /// Where a place begins.
    const fn address(&self, place: usize) -> usize {
        self.header.saturating_add(place.saturating_mul(self.place))
    }

    /// Places that are free.
    pub fn free(&self) -> usize {
        self.places().saturating_sub(self.count(|_| true))
    }

    /// Takes a block, `bytes` being all of it.
    pub fn insert(&mut self, header: BlockHeader, bytes: &[u8]) -> Taken {
        if self.blocks().any(|block| block.first_frame == header.first_frame) {
            return Taken::Known;
        }
        let free = numbered(&self.waiting).take(self.places()).find(|(_, slot)| slot.is_none());
        let Some((place, _)) = free else { return Taken::Full };
        let at = self.address(place);
        let room = self.memory.get_mut(at..at.saturating_add(self.place)).unwrap_or_default();
        if bytes.len() > room.len() {
            return Taken::Full;
        }
        room.iter_mut().zip(bytes).for_each(|(place, &byte)| *place = byte);
        if let Some(slot) = self.waiting.get_mut(place) {
            *slot = Some(header);
        }
        Taken::Waits
    }

    /// The block that begins with this frame.
    pub fn block(&self, first_frame: u32) -> Option<&[u8]> {
        let waiting = numbered(&self.waiting).filter_map(|(place, slot)| slot.map(|block| (place, block)));
        let (place, block) = waiting.into_iter().find(|(_, block)| block.first_frame == first_frame)?;
        let length = BLOCK_HEADER_BYTES.saturating_add(block.length.into());
        self.memory.get(self.address(place)..)?.get(..length)
    }

    /// The frame behind the block that begins with this one.
    pub fn end_of(&self, first_frame: u32) -> Option<u32> {
        self.blocks().find(|block| block.first_frame == first_frame).map(end)
    }

    /// Drops all blocks that end before or at this frame.
    pub fn drop_until(&mut self, frame: u32) {
        self.drop_where(|block| end(block) <= frame);
    }

    /// Drops the block that begins with this frame.
    pub fn remove(&mut self, first_frame: u32) {
        self.drop_where(|block| block.first_frame == first_frame);
    }

    /// Drops the first block, if its time has passed at this frame.
    pub fn evict(&mut self, position: u32) -> bool {
        let passed = self.blocks().filter(|block| end(block) <= position);
        let first = passed.map(|block| block.first_frame).min();
        first.map(|first| self.remove(first)).is_some()
    }

    /// Blocks whose time has passed at this frame.
    pub fn passed(&self, position: u32) -> usize {
        self.count(|block| end(block) <= position)
    }

    /// The last entry point in these frames, both counted.
    pub fn last_entry(&self, from: u32, to: u32) -> Option<u32> {
        self.entries().filter(|&first| first >= from && first <= to).max()
    }

    /// The first entry point.
    pub fn first_entry(&self) -> Option<u32> {
        self.entries().min()
    }

    fn entries(&self) -> impl Iterator<Item = u32> {
        self.blocks().filter(|block| block.entry).map(|block| block.first_frame)
    }

    /// The first frame from this one that is not there.
    pub fn end_from(&self, frame: u32) -> u32 {
        let mut last = frame;
        // Each turn passes a block.
        while let Some(next) = self.blocks().find(|block| block.first_frame <= last && end(block) > last) {
            last = end(next);
        }
        last
    }

    fn blocks(&self) -> impl Iterator<Item = &BlockHeader> {
        self.waiting.iter().flatten()
    }

    fn count(&self, counts: impl Fn(&BlockHeader) -> bool) -> usize {
        self.blocks().filter(|block| counts(block)).fold(0, |count: usize, _| count.saturating_add(1))
    }

    fn drop_where(&mut self, goes: impl Fn(&BlockHeader) -> bool) {
        for slot in &mut self.waiting {
            *slot = slot.filter(|block| !goes(block));
        }
    }
}

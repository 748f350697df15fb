//! The stream between the link that fills it and the decoder that plays it.

use super::blocks::{Blocks, Taken};
use super::error::StreamError;
use super::memory::{Memory, PlayerMemory};
use super::progress::{Counters, Progress};
use super::reckoner::Made;
use core::cell::{Cell, RefCell};
use decoder_core::mclip::{BLOCK_HEADER_BYTES, Block, BlockBounds, Header};
use decoder_core::{Error, Limits};

/// How a stream is played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Time in ms that is waited for before the first frame plays.
    pub ahead_millis: u16,
    /// Time in ms without a block after which the link counts as lost.
    pub lost_millis: u16,
    /// What is accepted.
    pub limits: Limits,
}

/// A live stream, between the link that fills it and the decoder that plays it. For one thread: both borrow it.
pub struct Live<'s> {
    settings: Settings,
    blocks: RefCell<Blocks<'s>>,
    /// Out while it plays.
    player: Cell<Option<PlayerMemory<'s>>>,
    state: Cell<State>,
    counters: Cell<Counters>,
}

/// How far a stream is.
#[derive(Clone, Copy, Debug)]
struct State {
    /// Frames in all; 0 before the header is there.
    frames: u32,
    /// Most bytes of a block's codes, by the header.
    block_bytes: u16,
    rate_centihertz: u16,
    /// The frame that plays next, and the one that the decoder gives next.
    position: u32,
    next: u32,
    /// Where the block ends that the decoder is in; it waits no longer.
    taken: u32,
    /// Where the last one of all blocks that came ends.
    seen: u32,
    playing: bool,
    /// Time in ms since a block came.
    silent: u32,
}

const NEW: State = State {
    frames: 0,
    block_bytes: 0,
    rate_centihertz: 0,
    position: 0,
    next: 0,
    taken: 0,
    seen: 0,
    playing: false,
    silent: 0,
};

const NONE: Counters = Counters {
    played: 0,
    concealed: 0,
    eased: 0,
    lost: 0,
    late: 0,
    duplicates: 0,
    damaged: 0,
    overflowed: 0,
};

impl<'s> Live<'s> {
    /// No stream.
    pub const fn new(memory: Memory<'s>, settings: Settings) -> Self {
        let Memory { buffer, player } = memory;
        Self {
            settings,
            blocks: RefCell::new(Blocks::new(buffer)),
            player: Cell::new(Some(player)),
            state: Cell::new(NEW),
            counters: Cell::new(NONE),
        }
    }

    /// Begins a stream whose header (all bytes before the first block) has `bytes` bytes, and forgets the one before.
    ///
    /// # Errors
    /// [`StreamError::Playing`], [`StreamError::TooLarge`].
    pub fn begin(&self, bytes: u32) -> Result<(), StreamError> {
        if self.state.get().playing {
            return Err(StreamError::Playing);
        }
        self.state.set(NEW);
        self.counters.set(NONE);
        self.with(|blocks| blocks.begin(bytes as usize))?
    }

    /// Takes the header's bytes from `offset`, in order; true once it is whole. Bytes that it has are passed over.
    ///
    /// # Errors
    /// [`StreamError::Gap`]; [`StreamError::TooLarge`] and [`StreamError::Clip`] where such a stream cannot be played here.
    pub fn header(&self, offset: u32, bytes: &[u8]) -> Result<bool, StreamError> {
        if self.state.get().frames > 0 {
            return Ok(true);
        }
        let whole = self.with(|blocks| {
            if !blocks.receive_header(offset as usize, bytes)? {
                return Ok(None);
            }
            let header = Header::parse(blocks.header(), self.settings.limits).map_err(StreamError::Clip)?;
            let BlockBounds { bytes: block_bytes, frames } = header.block_bounds();
            let (channels, rate_centihertz) = (header.channel_count(), header.rate_centihertz());
            let (block, length) = (usize::from(block_bytes), blocks.header().len());
            blocks.open(block)?;
            Ok(Some((State { frames, block_bytes, rate_centihertz, ..NEW }, length, channels, block)))
        })?;
        let Some((state, length, channels, block)) = whole? else { return Ok(false) };
        self.fits(length, channels, block.max(BLOCK_HEADER_BYTES))?;
        self.state.set(state);
        Ok(true)
    }

    /// Whether a player has the memory.
    fn fits(&self, header: usize, channels: usize, block: usize) -> Result<(), StreamError> {
        let player = self.player.take();
        let room = player.as_ref().map(|player| {
            let pose = player.poses.iter().map(|pose| pose.len()).min().unwrap_or(0);
            [(header, player.header.len()), (block, player.block.len()), (channels, pose)]
        });
        self.player.set(player);
        match room.into_iter().flatten().find(|(needed, room)| needed > room) {
            Some((needed, room)) => Err(StreamError::TooLarge { needed: needed as u32, room: room as u32 }),
            None => Ok(()),
        }
    }

    /// Takes a packet: one whole block, or several. Takes time in proportion to its bytes.
    ///
    /// # Errors
    /// [`StreamError::NoHeader`], [`StreamError::Clip`] where it is damaged. Blocks that are late, doubled or too many
    /// are counted and no error.
    pub fn receive(&self, packet: &[u8]) -> Result<(), StreamError> {
        let mut state = self.state.get();
        if state.frames == 0 {
            return Err(StreamError::NoHeader);
        }
        let mut counters = self.counters.get();
        let received = self.with(|blocks| receive(blocks, packet, &mut state, &mut counters))?;
        if received.is_err() {
            up(&mut counters.damaged);
        }
        self.state.set(state);
        self.counters.set(counters);
        received.map_err(StreamError::Clip)
    }

    /// Time passes, also while nothing plays; true where the stream plays, its last block has not come, and none came for
    /// [`Settings::lost_millis`]. Call it each tick.
    pub fn lost(&self, millis: u16) -> bool {
        let mut state = self.state.get();
        let waits = state.playing && state.seen < state.frames;
        state.silent = if waits { state.silent.saturating_add(millis.into()) } else { 0 };
        self.state.set(state);
        state.silent >= u32::from(self.settings.lost_millis) && waits
    }

    /// What has happened.
    pub fn counters(&self) -> Counters {
        self.counters.get()
    }

    /// Whether it plays.
    pub const fn plays(&self) -> bool {
        self.state.get().playing
    }

    /// Frames per second in hundredths; 0 before the header is there.
    pub const fn rate_centihertz(&self) -> u16 {
        self.state.get().rate_centihertz
    }

    /// How far it is.
    pub fn progress(&self) -> Progress {
        let State { frames, position, next, taken, .. } = self.state.get();
        let (received, free, blocks) = self
            .with(|blocks| {
                (
                    blocks.end_from(next.max(taken)),
                    blocks.free().saturating_add(blocks.passed(position)),
                    blocks.places(),
                )
            })
            .unwrap_or_default();
        Progress { position, received, frames, free_blocks: free as u16, blocks: blocks as u16 }
    }

    // ---- For the player

    /// Lends the memory of the one player that there can be; `None` where there is no stream, or it plays already.
    pub(crate) fn take(&self) -> Option<PlayerMemory<'s>> {
        let mut state = self.state.get();
        if state.frames == 0 {
            return None;
        }
        let player = self.player.take()?;
        state.playing = true;
        state.silent = 0;
        self.state.set(state);
        Some(player)
    }

    /// Takes it back.
    pub(crate) fn give(&self, player: PlayerMemory<'s>) {
        self.player.set(Some(player));
        self.state.update(|state| State { playing: false, ..state });
    }

    pub(super) fn limits(&self) -> Limits {
        self.settings.limits
    }

    pub(super) fn copy_header(&self, to: &mut [u8]) -> usize {
        let copied = self.with(|blocks| {
            let header = blocks.header();
            to.iter_mut().zip(header).for_each(|(to, &byte)| *to = byte);
            header.len()
        });
        copied.unwrap_or(0)
    }

    /// The frame to begin with, once enough wait behind it.
    pub(super) fn start(&self) -> Option<u32> {
        let mut state = self.state.get();
        let first = self.with(|blocks| {
            let first = blocks.first_entry()?;
            let end = blocks.end_from(first);
            let ahead =
                u32::from(self.settings.ahead_millis).saturating_mul(state.rate_centihertz.into()) / 100_000;
            let enough =
                end.saturating_sub(first) >= ahead.max(1) || end >= state.frames || blocks.free() == 0;
            enough.then(|| {
                blocks.drop_until(first);
                first
            })
        });
        let first = first.ok().flatten()?;
        (state.position, state.next) = (first, first);
        self.state.set(state);
        Some(first)
    }

    pub(super) fn last_entry(&self, from: u32, to: u32) -> Option<u32> {
        if from > to {
            return None;
        }
        self.with(|blocks| blocks.last_entry(from, to)).ok().flatten()
    }

    /// Gives `feed` the block that begins with this frame, and drops it.
    pub(super) fn take_block<R>(&self, first_frame: u32, feed: impl FnOnce(&mut &[u8]) -> R) -> Option<R> {
        let fed = self.with(|blocks| {
            let end = blocks.end_of(first_frame)?;
            let result = feed(&mut blocks.block(first_frame)?);
            blocks.remove(first_frame);
            Some((result, end))
        });
        let (result, taken) = fed.ok().flatten()?;
        self.state.update(|state| State { taken, ..state });
        Some(result)
    }

    pub(super) fn count(&self, count: impl FnOnce(&mut Counters)) {
        let mut counters = self.counters.get();
        count(&mut counters);
        self.counters.set(counters);
    }

    /// A frame was played.
    pub(super) fn played(&self, position: u32, next: u32, made: Made) {
        self.count(|counters| {
            up(match made {
                Made::Right => &mut counters.played,
                Made::Reckoned => &mut counters.concealed,
                Made::Eased => &mut counters.eased,
            });
        });
        self.state.update(|state| State { position, next, ..state });
        let _ = self.with(|blocks| blocks.drop_until(next));
    }

    /// Nothing here borrows the blocks twice, so there is no such error; but a panic would be worse than one.
    fn with<R>(&self, f: impl FnOnce(&mut Blocks<'s>) -> R) -> Result<R, StreamError> {
        self.blocks.try_borrow_mut().map(|mut blocks| f(&mut blocks)).map_err(|_| StreamError::Playing)
    }
}

fn up(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

/// Takes the blocks of a packet.
fn receive(
    blocks: &mut Blocks<'_>,
    packet: &[u8],
    state: &mut State,
    counters: &mut Counters,
) -> Result<(), Error> {
    let bounds = BlockBounds { bytes: state.block_bytes, frames: state.frames };
    let mut at = 0;
    while at < packet.len() {
        let block = Block::read(packet, at, bounds, None)?;
        let header = block.header;
        header.verify(block.codes, at)?;
        let bytes = packet.get(at..block.end()).unwrap_or_default();
        let end = block.next_frame();
        state.seen = state.seen.max(end);
        state.silent = 0;
        if end <= state.position {
            up(&mut counters.late);
        }
        // Late blocks are of use where the decoder has to go through them.
        if header.first_frame >= state.next {
            let mut taken = blocks.insert(header, bytes);
            if taken == Taken::Full && blocks.evict(state.position) {
                taken = blocks.insert(header, bytes);
            }
            match taken {
                Taken::Waits => {}
                Taken::Known => up(&mut counters.duplicates),
                Taken::Full => up(&mut counters.overflowed),
            }
        } else if end > state.position {
            up(&mut counters.duplicates);
        }
        at = block.end();
    }
    Ok(())
}

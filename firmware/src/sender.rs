//! A sender of live streams that goes by the clock, for shows: what it sends, and what of it gets lost, is the same in each run.

use crate::clips::DecoderMemory;
use crate::library::{LIVE, Library};
use crate::link::message::DATA_BYTES;
use crate::machine::{Command, Machine};
use crate::map::JointMap;
use crate::play_error::PlayError;
use crate::stream::{Counters, Live, Made, Memory, PlayerMemory, Settings};
use decoder_core::mclip::{Block, BlockBounds, Blocks, Header, Prefix};
use decoder_core::{Error, I16F16, Limits};

/// Most channels of a stream.
const CHANNELS: usize = 128;

/// 16-bit words for its entropy stage and windows.
const WORDS: usize = 8192;

/// Bytes of the buffer for its blocks, and of its header at most.
const STREAM_BYTES: usize = 8192;

/// How streams are played: a fifth of a second behind the sender, and lost after half a second without a block.
pub const STREAM: Settings = Settings {
    ahead_millis: 200,
    lost_millis: 500,
    limits: Limits { channels: CHANNELS as u16, frames: u32::MAX },
};

/// Time in ms that blocks are sent ahead of the frame that plays.
pub const AHEAD_MILLIS: u32 = 400;

/// Memory of a stream and its decoder. It is the same wherever a show runs, since it is the room that a sender sees.
pub struct StreamMemory {
    buffer: [u8; STREAM_BYTES],
    header: [u8; STREAM_BYTES],
    block: [u8; DATA_BYTES],
    poses: [[I16F16; CHANNELS]; 4],
    decoder: DecoderMemory<CHANNELS, { 4 * CHANNELS }, WORDS, 0>,
    pose: [I16F16; CHANNELS],
}

/// Its parts: those of the stream, of its decoder, and a frame's.
pub type StreamParts<'s> =
    (Memory<'s>, &'s mut DecoderMemory<CHANNELS, { 4 * CHANNELS }, WORDS, 0>, &'s mut [I16F16]);

impl StreamMemory {
    /// Memory.
    pub const fn new() -> Self {
        Self {
            buffer: [0; STREAM_BYTES],
            header: [0; STREAM_BYTES],
            block: [0; DATA_BYTES],
            poses: [[I16F16::ZERO; CHANNELS]; 4],
            decoder: DecoderMemory::new(),
            pose: [I16F16::ZERO; CHANNELS],
        }
    }

    /// Lends it.
    pub fn lend(&mut self) -> StreamParts<'_> {
        let Self { buffer, header, block, poses, decoder, pose } = self;
        let player = PlayerMemory { header, block, poses: poses.each_mut().map(|pose| &mut pose[..]) };
        (Memory { buffer, player }, decoder, pose)
    }
}

impl Default for StreamMemory {
    fn default() -> Self {
        Self::new()
    }
}

/// A clip on its way.
#[derive(Clone, Copy, Debug)]
struct Sending<'s> {
    clip: &'s [u8],
    /// Bytes before the first block, and what its header says of the blocks.
    header: usize,
    bounds: BlockBounds,
    /// Where the block is that is sent next, and its first frame.
    at: usize,
    frame: u32,
    /// Whether the header is there.
    begun: bool,
}

/// Sends clips block by block to a [`Live`], and loses what is due in gaps.
///
/// A packet of one block a tick, [`AHEAD_MILLIS`] ahead as far as there is room. What is lost is not sent again, except before the
/// first frame. When the stream is lost, so is the link: the machine stops and latches that.
#[derive(Clone, Copy)]
pub struct Sender<'s, 'l> {
    live: &'s Live<'l>,
    clips: &'s [&'s [u8]],
    sending: Option<Sending<'s>>,
    /// Ticks in which packets will be lost.
    gap: u32,
    counters: Counters,
    made: Option<Made>,
}

impl<'s, 'l> Sender<'s, 'l> {
    /// A sender of these clips (.mclip).
    pub fn new(clips: &'s [&'s [u8]], live: &'s Live<'l>) -> Self {
        Self { live, clips, sending: None, gap: 0, counters: live.counters(), made: None }
    }

    /// How the last frame was made, of the stream that plays.
    pub const fn made(&self) -> Option<Made> {
        self.made
    }

    /// What the stream that plays, or played last, came to.
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// Whether a stream waits to be begun.
    pub fn waits(&self) -> bool {
        self.sending.is_some_and(|sending| !sending.begun)
    }

    /// Streams a clip from the next tick on, instead of the one that is sent.
    pub(crate) fn stream(&mut self, clip: u16) -> Result<(), PlayError> {
        if self.live.plays() {
            return Err(PlayError::NoDecoder);
        }
        let bytes = self.clips.get(usize::from(clip)).copied().ok_or(PlayError::NoClip { clip })?;
        self.sending = Some(Sending::new(bytes).map_err(PlayError::Clip)?);
        Ok(())
    }

    /// Loses the packets of so many ticks.
    pub(crate) const fn lose(&mut self, ticks: u32) {
        self.gap = ticks;
    }

    /// What the last tick showed.
    pub(crate) fn look(&mut self) {
        let plays = self.live.plays();
        if self.made.is_some() && !plays {
            (self.sending, self.made) = (None, None);
        }
        if !plays {
            return;
        }
        let (last, now) = (self.counters, self.live.counters());
        self.counters = now;
        self.made = if now.concealed != last.concealed {
            Some(Made::Reckoned)
        } else if now.eased != last.eased {
            Some(Made::Eased)
        } else if now.played != last.played {
            Some(Made::Right)
        } else {
            self.made
        };
    }

    /// Sends what is due in a tick, and tells the machine of it.
    pub(crate) fn tick<L: Library, const N: usize>(
        &mut self,
        tick: u32,
        machine: &mut Machine<'_, L, N>,
        refused: &mut impl FnMut(Command, PlayError),
    ) {
        let lost = self.gap > 0;
        self.gap = self.gap.saturating_sub(1);
        let Some(sending) = &mut self.sending else { return };
        if !sending.begun {
            let play = Command::Play { clip: LIVE, repeats: false };
            let begun = match lost {
                true => return,
                false => sending.begin(self.live).and_then(|()| machine.command(play)),
            };
            if let Err(error) = begun {
                self.sending = None;
                return refused(play, error);
            }
            self.counters = self.live.counters();
        }
        sending.send(self.live, lost);
        // While all is sent that is due nobody is missed.
        let millis = if lost { millis(machine.map(), tick) } else { 0 };
        if self.live.lost(millis) {
            self.sending = None;
            // As a device does: what is not there cannot be gone on with after an acknowledgement.
            for command in [Command::Stop, Command::LinkLost] {
                if let Err(error) = machine.command(command) {
                    refused(command, error);
                }
            }
        }
    }
}

/// Time in ms from the tick before to this one.
fn millis<const N: usize>(map: &JointMap<N>, tick: u32) -> u16 {
    let until = |tick| map.tick_micros(tick) / 1000;
    until(tick).saturating_sub(until(tick.saturating_sub(1))) as u16
}

impl<'s> Sending<'s> {
    fn new(clip: &'s [u8]) -> Result<Self, Error> {
        let bounds = Header::parse(clip, Limits::MAX)?.block_bounds();
        let header = Prefix::read(clip)?.header_bytes;
        Ok(Self { clip, header, bounds, at: header, frame: 0, begun: false })
    }

    /// The block that is sent next.
    fn block(&self) -> Option<Block<'s>> {
        Blocks::new(self.bounds, self.clip, self.at, self.frame).next()?.ok()
    }

    /// Goes on to the block after this one.
    fn pass(&mut self, block: &Block<'_>) {
        (self.at, self.frame) = (block.end(), block.next_frame());
    }

    fn begin(&mut self, live: &Live<'_>) -> Result<(), PlayError> {
        let header = self.clip.get(..self.header).unwrap_or_default();
        let begun = live.begin(header.len() as u32).and_then(|()| live.header(0, header));
        self.begun = true;
        begun.map(|_| ()).map_err(|error| match error {
            crate::stream::StreamError::Clip(error) => PlayError::Clip(error),
            _ => PlayError::NoDecoder,
        })
    }

    fn send(&mut self, live: &Live<'_>, lost: bool) {
        let (progress, counters) = (live.progress(), live.counters());
        if counters.played == 0 && counters.concealed == 0 {
            (self.at, self.frame) = (self.header, 0);
            while let Some(block) = self.block()
                && block.header.first_frame < progress.received
            {
                self.pass(&block);
            }
        }
        let Some(block) = self.block() else { return };
        let ahead = AHEAD_MILLIS * u32::from(live.rate_centihertz()) / 100_000;
        if progress.free_blocks == 0 || block.header.first_frame > progress.position.saturating_add(ahead) {
            return;
        }
        self.pass(&block);
        if !lost {
            // What is damaged is counted.
            let _ = live.receive(self.clip.get(block.at..block.end()).unwrap_or_default());
        }
    }
}

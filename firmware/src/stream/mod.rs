//! Plays a clip that arrives block by block while it plays.
//!
//! [`Live`] takes the header, then packets of whole blocks (docs/FORMAT.md, "Blocks"). A block's header has the number of its
//! first frame: it is the packet's number, so blocks may come late, twice, in another order, or never. They wait in a buffer
//! until their time. Concealment bridges what is missing, so a puppet never waits and never jumps.
//!
//! Time goes on by the frames that are played, whether they came or not: what comes too late is left out, and the puppet is in time again.

use core::cell::{Cell, RefCell};
use core::fmt;
use decoder_core::{Error, I16F16, Limits};
use serde::{Deserialize, Serialize};

/// Memory of a live stream.
#[derive(Debug)]
pub struct Memory<'s> {
    /// For blocks that wait. The header is in front of them as long as the stream goes on.
    pub buffer: &'s mut [u8],
    /// For the header, while it plays.
    pub header: &'s mut [u8],
    /// For the codes of the longest block.
    pub block: &'s mut [u8],
    /// For concealment: four poses.
    pub poses: [&'s mut [I16F16]; 4],
}

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

/// What has happened since the stream began. Saturates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counters {
    /// Frames that were played as they were sent.
    pub played: u32,
    /// Frames that were made up, since the right ones were not there.
    pub concealed: u32,
    /// Frames that were on the way back from made-up ones to the right ones.
    pub eased: u32,
    /// Blocks that are there no more when their time came: never received, or of no use without one that was not.
    pub lost: u32,
    /// Blocks that came after their last frame's time.
    pub late: u32,
    /// Blocks that came twice.
    pub duplicates: u32,
    /// Packets that were no blocks, or damaged.
    pub damaged: u32,
    /// Blocks that came when the buffer was full.
    pub overflowed: u32,
}

/// How far a stream is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Progress {
    /// Number of the frame that plays next.
    pub position: u32,
    /// Number of the first frame, from `position`, that is not there.
    pub received: u32,
    /// Frames in all.
    pub frames: u32,
    /// Bytes that the buffer still takes; a block takes its own and those of its header.
    pub room: u32,
}

/// Why a stream does not take what it was given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StreamError {
    /// No header was received yet.
    NoHeader,
    /// The stream before it still plays.
    Playing,
    /// The bytes are no header of a clip that can be played here, or no block of it.
    Clip(Error),
    /// The header, or a block, does not fit into the memory for it.
    TooLarge {
        /// Bytes that it takes.
        needed: u32,
        /// Bytes that there are.
        room: u32,
    },
    /// Bytes of the header before these are missing.
    Gap {
        /// Where it has to go on.
        expected: u32,
        /// Where these bytes begin.
        found: u32,
    },
}

impl fmt::Display for StreamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NoHeader => f.write_str("no stream was begun, or its header is not whole"),
            Self::Playing => f.write_str("the stream before this one still plays"),
            Self::Clip(error) => error.fmt(f),
            Self::TooLarge { needed, room } => {
                write!(f, "a header or block takes {needed} bytes, and there are {room} for it")
            }
            Self::Gap { expected, found } => {
                write!(f, "bytes of the header come from {found} on, expected {expected}")
            }
        }
    }
}

impl core::error::Error for StreamError {}

/// A live stream, between the link that fills it and the decoder that plays it.
#[derive(Debug)]
pub struct Live<'s> {
    memory: RefCell<Memory<'s>>,
    settings: Settings,
    counters: Cell<Counters>,
}

impl<'s> Live<'s> {
    /// No stream.
    pub const fn new(memory: Memory<'s>, settings: Settings) -> Self {
        let counters = Counters {
            played: 0,
            concealed: 0,
            eased: 0,
            lost: 0,
            late: 0,
            duplicates: 0,
            damaged: 0,
            overflowed: 0,
        };
        Self { memory: RefCell::new(memory), settings, counters: Cell::new(counters) }
    }

    /// Begins a stream whose header has `bytes` bytes, and forgets the one before.
    ///
    /// # Errors
    /// [`StreamError::Playing`], [`StreamError::TooLarge`].
    pub fn begin(&self, bytes: u32) -> Result<(), StreamError> {
        let _ = (bytes, self.memory.borrow(), self.settings);
        Err(StreamError::NoHeader)
    }

    /// Takes the header's bytes from `offset`, in order; true once it is whole. Bytes that it has are passed over.
    ///
    /// # Errors
    /// [`StreamError::Gap`], [`StreamError::NoHeader`] where no stream was begun, [`StreamError::Clip`].
    pub fn header(&self, offset: u32, bytes: &[u8]) -> Result<bool, StreamError> {
        let _ = (offset, bytes);
        Err(StreamError::NoHeader)
    }

    /// Takes a packet: one whole block, or several.
    ///
    /// # Errors
    /// [`StreamError::NoHeader`], [`StreamError::Clip`] where it is damaged. Blocks that are late, doubled or too many are
    /// counted and no error.
    pub fn receive(&self, packet: &[u8]) -> Result<(), StreamError> {
        let _ = packet;
        Err(StreamError::NoHeader)
    }

    /// Time passes, also while nothing plays; true where the stream plays, is not received to its end, and no block came for
    /// [`Settings::lost_millis`]. Call it each tick.
    pub fn lost(&self, millis: u16) -> bool {
        let _ = millis;
        false
    }

    /// What has happened.
    pub fn counters(&self) -> Counters {
        self.counters.get()
    }

    /// How far it is.
    pub fn progress(&self) -> Progress {
        Progress::default()
    }
}

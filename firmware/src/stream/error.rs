//! Why a stream does not take what it was given.

use core::fmt;
use decoder_core::Error;

/// Why a stream does not take what it was given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
            Self::NoHeader => f.write_str("the stream's header was not received"),
            Self::Playing => f.write_str("a stream plays"),
            Self::Clip(error) => error.fmt(f),
            Self::TooLarge { needed, room } => {
                write!(f, "the stream needs {needed} bytes of memory, there are {room}")
            }
            Self::Gap { expected, found } => {
                write!(f, "bytes of the header come from {found} on, expected {expected}")
            }
        }
    }
}

impl core::error::Error for StreamError {}

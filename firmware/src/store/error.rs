//! What a store says.

use crate::play_error::PlayError;
use core::fmt;
use decoder_core::Error;
use embedded_storage::nor_flash::NorFlashErrorKind;

/// Why a store does not do what it was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StoreError {
    /// The layout does not fit the flash.
    Layout,
    /// No free sectors in a row take so many bytes.
    Full {
        /// Bytes of the clip.
        needed: u32,
        /// Bytes that would fit.
        room: u32,
    },
    /// A clip of no bytes.
    Empty,
    /// The directory has no room for another clip.
    TooMany {
        /// Clips that it takes.
        most: u16,
    },
    /// The name is longer than 32 bytes.
    Name {
        /// Its bytes.
        found: u32,
    },
    /// There is no such clip.
    NoClip {
        /// Its number.
        clip: u16,
    },
    /// Something else has to be finished first.
    Busy,
    /// No upload was begun.
    NoUpload,
    /// Bytes before these are missing.
    Gap {
        /// Where it has to go on.
        expected: u32,
        /// Where these bytes begin.
        found: u32,
    },
    /// More bytes than the upload was begun with.
    TooLong {
        /// Bytes of the clip.
        bytes: u32,
    },
    /// Not all bytes were written.
    Incomplete {
        /// Bytes that were.
        received: u32,
        /// Bytes of the clip.
        bytes: u32,
    },
    /// The bytes on flash are not those that were to be sent.
    Checksum {
        /// CRC-32 of what is there.
        found: u32,
        /// CRC-32 that was announced.
        expected: u32,
    },
    /// The bytes are no clip that can be played here.
    Clip(Error),
    /// The clip is whole, and this puppet cannot play it.
    Play(PlayError),
    /// The flash does not hold what was written to it.
    Worn {
        /// Where.
        at: u32,
    },
    /// The flash refused an operation.
    Flash {
        /// Why.
        kind: NorFlashErrorKind,
        /// Where.
        at: u32,
    },
}

impl fmt::Display for StoreError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Layout => f.write_str("the store's layout does not fit the flash"),
            Self::Full { needed, room } => {
                write!(f, "no room for a clip of {needed} bytes, the largest that fits has {room}")
            }
            Self::Empty => f.write_str("a clip has at least one byte"),
            Self::TooMany { most } => write!(f, "the directory is full: it takes {most} clips"),
            Self::Name { found } => {
                write!(
                    f,
                    "the clip's name has {found} bytes, at most {} are stored",
                    super::entry::NAME_BYTES
                )
            }
            Self::NoClip { clip } => write!(f, "there is no clip {clip} in the store"),
            Self::Busy => f.write_str(
                "the store is busy: another host's upload goes on, or the directory is written; try again, at the latest \
                 2 s after that host has stopped",
            ),
            Self::NoUpload => f.write_str("no upload was begun"),
            Self::Gap { expected, found } => {
                write!(f, "bytes of the upload come from {found} on, expected {expected}")
            }
            Self::TooLong { bytes } => {
                write!(f, "the upload has more than the {bytes} bytes it was begun with")
            }
            Self::Incomplete { received, bytes } => {
                write!(f, "only {received} of the upload's {bytes} bytes were received")
            }
            Self::Checksum { found, expected } => {
                write!(f, "the clip's CRC-32 on flash is {found:#010x}, expected {expected:#010x}")
            }
            Self::Clip(error) => error.fmt(f),
            Self::Play(error) => error.fmt(f),
            Self::Worn { at } => write!(f, "flash at {at:#x} does not hold what was written to it"),
            Self::Flash { kind, at } => write!(f, "flash at {at:#x}: {kind}"),
        }
    }
}

impl core::error::Error for StoreError {}

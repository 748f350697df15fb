//! What is wrong with a clip, as the link says it: decoder-core's errors, with sizes of 32 bits.

use decoder_core::{Error, Feature, Field};

/// An [`Error`] on the link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ClipError {
    Truncated { field: Field, at: u32, needed: u32, found: u32 },
    Malformed { field: Field, at: u32, found: u32, low: u32, high: u32 },
    Encoding { field: Field, at: u32 },
    Unsupported { field: Field, found: u32 },
    Checksum { field: Field, at: u32, found: u32, expected: u32 },
    Limit { field: Field, found: u32, limit: u32 },
    Memory { field: Field, needed: u32, lent: u32 },
    NotLinked { feature: Feature },
}

/// A size on the link, which has 32 bits; on a computer more may be meant.
fn size(size: usize) -> u32 {
    u32::try_from(size).unwrap_or(u32::MAX)
}

impl From<Error> for ClipError {
    fn from(error: Error) -> Self {
        match error {
            Error::Truncated { field, at, needed, found } => {
                Self::Truncated { field, at: size(at), needed: size(needed), found: size(found) }
            }
            Error::Malformed { field, at, found, low, high } => {
                Self::Malformed { field, at: size(at), found, low, high }
            }
            Error::Encoding { field, at } => Self::Encoding { field, at: size(at) },
            Error::Unsupported { field, found } => Self::Unsupported { field, found },
            Error::Checksum { field, at, found, expected } => {
                Self::Checksum { field, at: size(at), found, expected }
            }
            Error::Limit { field, found, limit } => Self::Limit { field, found, limit },
            Error::OutputTooSmall { field, needed, lent } => {
                Self::Memory { field, needed: size(needed), lent: size(lent) }
            }
            Error::NotLinked { feature } => Self::NotLinked { feature },
            // One that this version has no number for.
            _ => Self::Encoding { field: Field::Header, at: 0 },
        }
    }
}

impl From<ClipError> for Error {
    fn from(error: ClipError) -> Self {
        match error {
            ClipError::Truncated { field, at, needed, found } => {
                Self::Truncated { field, at: at as usize, needed: needed as usize, found: found as usize }
            }
            ClipError::Malformed { field, at, found, low, high } => {
                Self::Malformed { field, at: at as usize, found, low, high }
            }
            ClipError::Encoding { field, at } => Self::Encoding { field, at: at as usize },
            ClipError::Unsupported { field, found } => Self::Unsupported { field, found },
            ClipError::Checksum { field, at, found, expected } => {
                Self::Checksum { field, at: at as usize, found, expected }
            }
            ClipError::Limit { field, found, limit } => Self::Limit { field, found, limit },
            ClipError::Memory { field, needed, lent } => {
                Self::OutputTooSmall { field, needed: needed as usize, lent: lent as usize }
            }
            ClipError::NotLinked { feature } => Self::NotLinked { feature },
        }
    }
}

/// The fields by number. Numbers are never given again: new ones go to the end.
pub(super) const FIELDS: [(u32, Field); 35] = [
    (0, Field::Frames),
    (1, Field::Channels),
    (2, Field::Rate),
    (3, Field::FixedChannels),
    (4, Field::IndexBits),
    (5, Field::Level),
    (6, Field::Pose),
    (7, Field::Table),
    (8, Field::Rows),
    (9, Field::Magic),
    (10, Field::Version),
    (11, Field::Header),
    (12, Field::Codec),
    (13, Field::Parameters),
    (14, Field::Entropy),
    (15, Field::CodeTables),
    (16, Field::Ram),
    (17, Field::Delay),
    (18, Field::Cycles),
    (19, Field::Channel),
    (20, Field::Names),
    (21, Field::Predictor),
    (22, Field::Kind),
    (23, Field::EntryBits),
    (24, Field::Bits),
    (25, Field::Step),
    (26, Field::Group),
    (27, Field::BlockHeader),
    (28, Field::BlockLength),
    (29, Field::FirstFrame),
    (30, Field::Entry),
    (31, Field::Payload),
    (32, Field::States),
    (33, Field::Words),
    (34, Field::Halves),
];

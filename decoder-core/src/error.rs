//! What a decoder says about bytes that it will not play.

use crate::ids::Feature;
use core::fmt;
use serde::{Deserialize, Serialize};

/// What the caller is ready to hold. A count from a file is checked once against it, where it is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Most channels in a frame.
    pub channels: u16,
    /// Most frames in a clip.
    pub frames: u32,
}

impl Limits {
    /// What the formats can express.
    pub const MAX: Self = Self { channels: u16::MAX, frames: u32::MAX };
}

/// A field of a file, as an error names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Field {
    /// Number of frames in a segment (QMD `n_d`), or in the clip.
    Frames,
    /// Number of channels in a frame (QMD `m`).
    Channels,
    /// Frames per second, in hundredths.
    Rate,
    /// Number of leading channels that hold floats (QMD `FDF`).
    FixedChannels,
    /// Bits of an index (QMD `b`).
    IndexBits,
    /// Hierarchy level of a channel.
    Level,
    /// The initial pose.
    Pose,
    /// The look-up table of a segment.
    Table,
    /// The rows of a segment.
    Rows,
    /// The first bytes of a `.mclip` file.
    Magic,
    /// Version of the format.
    Version,
    /// The header of a clip.
    Header,
    /// The codec.
    Codec,
    /// The parameters of the codec.
    Parameters,
    /// The entropy stage.
    Entropy,
    /// The tables of the entropy stage.
    CodeTables,
    /// Bytes of memory that a decoder needs.
    Ram,
    /// Frames by which a decoder lags behind.
    Delay,
    /// Certified cycles of a frame.
    Cycles,
    /// What a header says of a channel.
    Channel,
    /// Names of joints.
    Names,
    /// Coefficients of predictors.
    Predictor,
    /// What a channel moves.
    Kind,
    /// Bits of a channel's value at an entry point.
    EntryBits,
    /// Bits of a channel's codes.
    Bits,
    /// Index of a channel's step.
    Step,
    /// A channel's group of code tables.
    Group,
    /// The header of a block.
    BlockHeader,
    /// Length of a block.
    BlockLength,
    /// Number of the first frame of a block.
    FirstFrame,
    /// Whether the first block is an entry point.
    Entry,
    /// The codes in a block.
    Payload,
    /// Memory for the state of channels.
    States,
    /// Memory of 32-bit words.
    Words,
    /// Memory of 16-bit words.
    Halves,
}

impl Field {
    /// The field's name in a sentence.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Frames => "number of frames",
            Self::Channels => "number of channels",
            Self::Rate => "frame rate",
            Self::FixedChannels => "number of fixed channels (FDF)",
            Self::IndexBits => "index bits (b)",
            Self::Level => "hierarchy level",
            Self::Pose => "initial pose",
            Self::Table => "look-up table",
            Self::Rows => "rows of differences",
            Self::Magic => "magic number",
            Self::Version => "format version",
            Self::Header => "header",
            Self::Codec => "codec",
            Self::Parameters => "codec's parameters",
            Self::Entropy => "entropy stage",
            Self::CodeTables => "code tables",
            Self::Ram => "decoder's memory (RAM)",
            Self::Delay => "delay",
            Self::Cycles => "certified cycles",
            Self::Channel => "channel's record",
            Self::Names => "names of joints",
            Self::Predictor => "predictor's coefficients",
            Self::Kind => "channel's kind",
            Self::EntryBits => "bits of a channel's value at an entry point",
            Self::Bits => "bits of a code",
            Self::Step => "step index",
            Self::Group => "group",
            Self::BlockHeader => "block's header",
            Self::BlockLength => "block length",
            Self::FirstFrame => "first frame of a block",
            Self::Entry => "entry flag of the first block",
            Self::Payload => "block's codes",
            Self::States => "channels' states",
            Self::Words => "codec's 32-bit words",
            Self::Halves => "codec's and entropy stage's 16-bit words",
        }
    }
}

/// Why bytes are not a clip that can be played here. Offsets are bytes from the start of the clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Error {
    /// The bytes end inside a field.
    Truncated {
        /// The field that does not fit.
        field: Field,
        /// Where it starts.
        at: usize,
        /// Bytes that it takes.
        needed: usize,
        /// Bytes that are there.
        found: usize,
    },
    /// A field has a value that no encoder writes.
    Malformed {
        /// The field.
        field: Field,
        /// Where it is.
        at: usize,
        /// Its value.
        found: u32,
        /// The lowest value that is allowed.
        low: u32,
        /// The highest value that is allowed.
        high: u32,
    },
    /// The bytes of a structure are none, whatever their values.
    Encoding {
        /// The structure.
        field: Field,
        /// Where it starts.
        at: usize,
    },
    /// A version, codec or stage that this decoder does not know.
    Unsupported {
        /// Which of them.
        field: Field,
        /// Its number.
        found: u32,
    },
    /// Bytes were damaged.
    Checksum {
        /// What they are.
        field: Field,
        /// Where it starts.
        at: usize,
        /// The CRC-32 of what is there.
        found: u32,
        /// The CRC-32 that is stored with it.
        expected: u32,
    },
    /// The clip is sound but larger than the caller's [`Limits`].
    Limit {
        /// The field.
        field: Field,
        /// Its value.
        found: u32,
        /// The caller's limit.
        limit: u32,
    },
    /// Memory that the caller lends is too small.
    OutputTooSmall {
        /// What it is to hold.
        field: Field,
        /// Elements that are needed.
        needed: usize,
        /// Elements that were lent.
        lent: usize,
    },
    /// A codec or stage that this decoder could play, but that was left out when it was built.
    NotLinked {
        /// What has it.
        feature: Feature,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Truncated { field, at, needed, found } => {
                write!(f, "byte {at}: {} should take {needed} bytes, but only {found} are left", field.name())
            }
            Self::Malformed { field: Field::Magic, at, found, low, .. } => {
                let (found, expected) = (found.to_le_bytes(), low.to_le_bytes());
                let (found, expected) = (found.escape_ascii(), expected.escape_ascii());
                write!(f, "byte {at}: the magic number is \"{found}\", expected \"{expected}\"")
            }
            Self::Malformed { field: Field::Version, at, found, .. } => {
                write!(f, "byte {at}: found {found} behind the format version, expected 0")
            }
            // Sizes and lengths are the numbers that tables have.
            Self::Malformed { field: Field::CodeTables, at, found, low, high } if low == high => {
                write!(f, "byte {at}: the code tables take {low} bytes, but {found} are there")
            }
            Self::Malformed { field: Field::CodeTables, at, found, low, high } => {
                write!(f, "byte {at}: a length in the code tables is {found}, expected {low} to {high}")
            }
            Self::Malformed { field, at, found, low, high } if low == high => {
                write!(f, "byte {at}: {} is {found}, expected {low}", field.name())
            }
            Self::Malformed { field, at, found, low, high } => {
                write!(f, "byte {at}: {} is {found}, expected {low} to {high}", field.name())
            }
            Self::Encoding { field, at } => write!(f, "byte {at}: the {} cannot be read", field.name()),
            Self::Unsupported { field, found } => {
                write!(f, "{} {found} is not supported by this version of Bunraku", field.name())
            }
            Self::NotLinked { feature } => {
                write!(
                    f,
                    "the clip needs the feature {}, which this decoder was built without",
                    feature.name()
                )
            }
            Self::Checksum { field, at, found, expected } => write!(
                f,
                "byte {at}: damage in the {}: its CRC-32 is {found:#010x}, expected {expected:#010x}",
                field.name()
            ),
            Self::Limit { field, found, limit } => {
                write!(f, "{} is {found}, more than the limit of {limit}", field.name())
            }
            Self::OutputTooSmall { field, needed, lent } => {
                write!(f, "memory lent for the {} holds {lent} elements, {needed} are needed", field.name())
            }
        }
    }
}

impl core::error::Error for Error {}

/// Checks a number that was read in the structure at byte `at`.
pub(crate) const fn check(field: Field, at: usize, found: u32, low: u32, high: u32) -> Result<(), Error> {
    if found < low || found > high {
        return Err(Error::Malformed { field, at, found, low, high });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::EntropyId;
    use std::string::ToString;

    #[test]
    fn errors_are_sentences_with_their_numbers() {
        let field = Field::Level;
        for (error, sentence) in [
            (
                Error::Truncated { field, at: 7, needed: 4, found: 3 },
                "byte 7: hierarchy level should take 4 bytes, but only 3 are left",
            ),
            (
                Error::Malformed { field, at: 7, found: 9, low: 1, high: 8 },
                "byte 7: hierarchy level is 9, expected 1 to 8",
            ),
            (
                Error::Malformed { field: Field::Entry, at: 7, found: 0, low: 1, high: 1 },
                "byte 7: entry flag of the first block is 0, expected 1",
            ),
            (
                Error::Malformed {
                    field: Field::Magic,
                    at: 0,
                    found: u32::from_le_bytes(*b"M\x1bLQ"),
                    low: u32::from_le_bytes(*b"MCLP"),
                    high: u32::from_le_bytes(*b"MCLP"),
                },
                "byte 0: the magic number is \"M\\x1bLQ\", expected \"MCLP\"",
            ),
            (
                Error::Malformed { field: Field::Version, at: 6, found: 1, low: 0, high: 0 },
                "byte 6: found 1 behind the format version, expected 0",
            ),
            (
                Error::Malformed { field: Field::CodeTables, at: 12, found: 5, low: 4, high: 4 },
                "byte 12: the code tables take 4 bytes, but 5 are there",
            ),
            (
                Error::Malformed { field: Field::CodeTables, at: 12, found: 9, low: 0, high: 8 },
                "byte 12: a length in the code tables is 9, expected 0 to 8",
            ),
            (Error::Encoding { field, at: 7 }, "byte 7: the hierarchy level cannot be read"),
            (
                Error::NotLinked { feature: Feature::Entropy(EntropyId::Huffman) },
                "the clip needs the feature huffman, which this decoder was built without",
            ),
            (
                Error::Unsupported { field: Field::Version, found: 9 },
                "format version 9 is not supported by this version of Bunraku",
            ),
            (
                Error::Checksum { field: Field::Payload, at: 7, found: 0xab, expected: 0x1234_5678 },
                "byte 7: damage in the block's codes: its CRC-32 is 0x000000ab, expected 0x12345678",
            ),
            (
                Error::Limit { field: Field::Frames, found: 9, limit: 8 },
                "number of frames is 9, more than the limit of 8",
            ),
            (
                Error::OutputTooSmall { field: Field::Pose, needed: 9, lent: 8 },
                "memory lent for the initial pose holds 8 elements, 9 are needed",
            ),
        ] {
            assert_eq!(error.to_string(), sentence);
        }
    }

    /// Two fields of one name would be one in a sentence.
    #[test]
    fn fields_have_names_of_their_own() {
        let mut names = FIELDS.map(Field::name);
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] < pair[1]), "{names:?}");
        assert!(names.iter().all(|name| name.len() > 3));
    }

    const FIELDS: [Field; 31] = [
        Field::Frames,
        Field::Channels,
        Field::Rate,
        Field::FixedChannels,
        Field::IndexBits,
        Field::Level,
        Field::Pose,
        Field::Table,
        Field::Rows,
        Field::Magic,
        Field::Version,
        Field::Header,
        Field::Codec,
        Field::Parameters,
        Field::Entropy,
        Field::CodeTables,
        Field::Ram,
        Field::Delay,
        Field::Cycles,
        Field::Channel,
        Field::Bits,
        Field::Step,
        Field::Group,
        Field::BlockHeader,
        Field::BlockLength,
        Field::FirstFrame,
        Field::Entry,
        Field::Payload,
        Field::States,
        Field::Words,
        Field::Halves,
    ];
}

//! Why a clip cannot be played.

use crate::clock::MAX_FRAMES_PER_TICK;
use core::fmt;
use decoder_core::Error;

/// Why a clip cannot be played by a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum PlayError {
    /// The clip does not say its rate.
    Rate,
    /// There is no frame to play.
    NoFrames,
    /// A joint follows a channel that the clip does not have.
    Channel {
        /// The servo.
        id: u8,
        /// The channel.
        channel: u16,
        /// Channels of the clip.
        channels: u32,
    },
    /// The clip is damaged.
    Clip(Error),
    /// Too many clips wait already.
    QueueFull,
    /// There is no such clip.
    NoClip {
        /// Its number.
        clip: u16,
    },
    /// All decoders are in use, or the live stream plays already.
    NoDecoder,
    /// The clip is one of another skeleton, or of other channels of it.
    Channels {
        /// Channels of the clip.
        found: u32,
        /// Those that the map was made for.
        expected: u16,
    },
    /// More frames would go by in a tick than it can decode in its time.
    TooFast {
        /// Frames per second of the clip, in hundredths.
        rate_centihertz: u16,
        /// Ticks per second of the puppet.
        tick_hz: u16,
    },
    /// The clip has as many channels as the map was made for, and other ones.
    Names {
        /// Digest of the names that the clip has.
        found: u32,
        /// Digest of those that the map was made for.
        expected: u32,
    },
    /// The clip ends before this frame.
    Beyond {
        /// The frame.
        frame: u32,
        /// Frames of the clip.
        frames: u32,
    },
    /// A live stream cannot be sought in: it has no way back, and what is ahead has not come.
    Stream,
    /// No clip plays.
    Nothing,
}

/// What to do about a clip of other channels.
const MEND: &str = "; encode the clip for this puppet (bunraku encode --puppet), or give the device the map of the \
                    clip's skeleton";

impl fmt::Display for PlayError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Rate => f.write_str("the clip does not say its frame rate"),
            Self::NoFrames => f.write_str("the clip has no frames"),
            Self::Channel { id, channel, channels } => {
                write!(
                    f,
                    "servo {id} follows channel {channel} (from 0), but the clip has {channels} channels"
                )
            }
            Self::Clip(error) => error.fmt(f),
            Self::QueueFull => f.write_str("too many clips wait already"),
            Self::NoClip { clip } => write!(f, "there is no clip {clip}"),
            Self::NoDecoder => f.write_str("no decoder is free"),
            Self::TooFast { rate_centihertz, tick_hz } => write!(
                f,
                "the clip has {}.{:02} frames a second, more than {MAX_FRAMES_PER_TICK} for each of the {tick_hz} ticks a \
                 second; encode it with fewer frames a second (--fps), or give the puppet more ticks",
                rate_centihertz / 100,
                rate_centihertz % 100
            ),
            Self::Channels { found, expected } => {
                write!(
                    f,
                    "the clip has {found} channels, expected {expected}, which the joint map was made for{MEND}"
                )
            }
            Self::Names { found, expected } => write!(
                f,
                "the clip's channels have other names than those that the joint map was made for (digest {found:08x}, \
                 expected {expected:08x}){MEND}"
            ),
            Self::Beyond { frame, frames } => {
                write!(f, "there is no frame {frame}: the clip has {frames} frames, from 0")
            }
            Self::Stream => f.write_str("a live stream cannot be sought in; it is where its packets are"),
            Self::Nothing => f.write_str("no clip plays"),
        }
    }
}

impl core::error::Error for PlayError {}

//! Why a motion is not encoded.

/// Why a motion is not encoded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// Index bits that the format does not have.
    #[error("index bits (b) are {found}, expected 8 to 16")]
    IndexBits {
        /// What was asked for.
        found: u8,
    },
    /// More fixed channels than channels.
    #[error("fixed channels (FDF) are {found}, expected 0 to {channels}, the number of channels")]
    FixedChannels {
        /// What was asked for.
        found: u16,
        /// Channels of the motion.
        channels: u16,
    },
    /// Segments without frames.
    #[error("a segment has 0 frames, expected at least 1")]
    EmptySegments,
    /// A motion without frames or channels.
    #[error("the motion has {frames} frames of {channels} channels, expected at least 1 of both")]
    Empty {
        /// Its frames.
        frames: usize,
        /// Its channels.
        channels: usize,
    },
    /// More channels or frames than the format can count.
    #[error("the motion has {found} {what}, the format holds at most {limit}")]
    TooMany {
        /// Channels or frames.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A value outside 16.16 fixed point.
    #[error("frame {frame} of channel {channel} is {value}, outside the range of -32768 to 32767")]
    Range {
        /// Name of the channel.
        channel: String,
        /// The frame, from 0.
        frame: usize,
        /// The value.
        value: f64,
    },
    /// A rate that the format cannot hold.
    #[error("the rate is {found} frames per second, expected 0.01 to 655.35 (--fps 60 thins frames out)")]
    Rate {
        /// The rate.
        found: f64,
    },
    /// A codec whose quality is a number of bits was to have steps of a given size.
    #[error("{codec} has no steps to choose: found a size of steps, expected bits of a code")]
    NoFreeSteps {
        /// Name of the codec.
        codec: &'static str,
    },
    /// The decoder does not take what these settings make: one of them is outside what the format has.
    #[error("the decoder refuses the clip that these settings make: {0}")]
    Refused(#[from] decoder_core::Error),
}

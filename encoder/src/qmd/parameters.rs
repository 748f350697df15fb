//! What sets the size and the error of a clip.

use crate::error::EncodeError;
use decoder_core::qmd::{MAX_INDEX_BITS, MIN_INDEX_BITS};

/// The three quality control parameters (paper, section 5).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
pub struct Parameters {
    /// Bits of an index (`b`), 8 to 16.
    pub index_bits: u8,
    /// Leading channels whose differences stay floats (`FDF`), 0 to the number of channels.
    pub fixed_channels: u16,
    /// Frames of a segment (`n_d`), at least 1; the last segment may have fewer.
    pub segment_frames: u32,
}

impl Parameters {
    /// The paper's choice for clips of one segment (section 6.1): `b` = 8, `FDF` = 6.
    pub const TABLE_1: Self = Self { index_bits: 8, fixed_channels: 6, segment_frames: u32::MAX };

    /// Bytes of a clip of `frames` frames of `channels` channels (equation 4, and docs/FORMAT.md for the opening).
    pub fn bytes(self, frames: usize, channels: usize) -> usize {
        let layout = self.layout(channels as u16, 0);
        let segments = frames.div_ceil(self.segment_frames as usize);
        segments * (decoder_core::qmd::SEGMENT_HEADER_BYTES + layout.table_bytes())
            + layout.opening_bytes()
            + frames * layout.row_bytes()
    }

    pub(super) fn layout(self, channels: u16, rate_centihertz: u16) -> decoder_core::qmd::Layout {
        decoder_core::qmd::Layout {
            channels,
            rate_centihertz,
            fixed_channels: self.fixed_channels,
            index_bits: self.index_bits,
        }
    }

    pub(super) fn check(self, channels: u16) -> Result<(), EncodeError> {
        if !(MIN_INDEX_BITS..=MAX_INDEX_BITS).contains(&self.index_bits) {
            return Err(EncodeError::IndexBits { found: self.index_bits });
        }
        if self.fixed_channels > channels {
            return Err(EncodeError::FixedChannels { found: self.fixed_channels, channels });
        }
        if self.segment_frames == 0 {
            return Err(EncodeError::EmptySegments);
        }
        Ok(())
    }
}

/// How differences are taken and tables are made.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub enum Method {
    /// The paper's encoder.
    Faithful {
        /// `k` of equation 1. `None` is its limit for k → ∞: of the numbers in a bucket only those of its lowest
        /// level count (selective averaging).
        exponent: Option<f64>,
    },
    /// Differences against the decoder's pose, tables that minimise the weighted error.
    ClosedLoop,
}

impl Method {
    /// The paper's encoder with selective averaging.
    pub const FAITHFUL: Self = Self::Faithful { exponent: None };
}

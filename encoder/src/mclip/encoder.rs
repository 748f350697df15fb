//! Encodes a motion with a codec, an entropy stage and a quality.

use crate::codec::CodecSettings;
use crate::error::EncodeError;
use crate::quality::Quality;
use crate::task::{Channels, Task};
use decoder_core::mclip::{CodecId, EntropyId};
use mocap::motion::Motion;
use mocap::skeleton::Skeleton;

/// Frames from one entry point to the next unless others are asked for.
pub const ENTRY_FRAMES: usize = 480;

/// Longest block in bytes of codes unless another is asked for.
pub const BLOCK_BYTES: u16 = 1024;

/// What a clip is encoded with: all that is not a matter of quality.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoding {
    /// The codec and its settings.
    pub codec: CodecSettings,
    /// The entropy stage; the smallest unless given.
    pub entropy: Option<EntropyId>,
    /// Longest block in bytes of codes; a frame that is longer has a block of its own.
    pub block_bytes: u16,
    /// Frames from one entry point to the next.
    pub entry_frames: usize,
}

impl Encoding {
    /// What a codec is used with unless something else is asked for.
    pub fn new(codec: CodecId) -> Self {
        Self::of(CodecSettings::new(codec))
    }

    /// A codec with these settings of its own, for instance `Encoding::of(Dpcm { order: Order::First, ..Dpcm::default() })`.
    pub fn of(codec: impl Into<CodecSettings>) -> Self {
        let codec = codec.into();
        Self { codec, entropy: None, block_bytes: BLOCK_BYTES, entry_frames: ENTRY_FRAMES }
    }

    /// Most bits of a code that [`Quality::Bits`] may ask for.
    pub fn most_bits(&self) -> u8 {
        self.codec.encoder().most_bits()
    }

    /// Whether [`Quality::Step`] and [`Quality::Even`] may be asked for. Otherwise the number of bits is what sets the
    /// quality.
    pub fn has_free_steps(&self) -> bool {
        self.codec.encoder().has_free_steps()
    }
}

/// A motion made ready to be encoded many times.
#[derive(Clone, Debug)]
pub struct Encoder<'m> {
    motion: Channels<'m>,
}

impl<'m> Encoder<'m> {
    /// # Errors
    /// [`EncodeError`] where the motion is empty or its size, rate or values do not fit the format.
    pub fn new(skeleton: &'m Skeleton, motion: &Motion) -> Result<Self, EncodeError> {
        Ok(Self { motion: Channels::new(skeleton, motion)? })
    }

    /// The motion, channel by channel.
    pub const fn motion(&self) -> &Channels<'m> {
        &self.motion
    }

    /// Encodes, in the smallest entropy stage unless one is given.
    ///
    /// # Errors
    /// [`EncodeError::NoFreeSteps`] where the codec has no steps to choose, and [`EncodeError::Refused`] where a setting is
    /// outside what the format has.
    pub fn encode(&self, encoding: &Encoding, quality: Quality<'_>) -> Result<Vec<u8>, EncodeError> {
        encoding.codec.encoder().encode(&self.task(encoding), quality)
    }

    /// What a codec is to do for an encoding.
    pub(crate) const fn task(&self, encoding: &Encoding) -> Task<'_> {
        let &Encoding { entropy, block_bytes, entry_frames, .. } = encoding;
        Task { motion: &self.motion, entropy, block_bytes, entry_frames }
    }
}

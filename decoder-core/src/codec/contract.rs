//! What a codec is to a container.

use crate::I16F16;
use crate::channel::{Channel, Rules};
use crate::error::Error;
use crate::ids::EntropyId;
use crate::memory::{Memory, Needs};

/// What a header says besides a codec's parameters and its channels' records.
#[derive(Clone, Copy, Debug)]
pub struct Shape<'a> {
    /// Channels in a frame.
    pub channels: usize,
    /// The entropy stage.
    pub entropy: EntropyId,
    /// The entropy stage's tables.
    pub tables: &'a [u8],
    /// The byte of the clip that an error in the tables is told with.
    pub at: usize,
}

/// A codec with its parameters, as a header has them.
pub trait Codec<'a>: Copy {
    /// Reads the parameters, which are in the structure at byte `at`.
    ///
    /// # Errors
    /// [`Error::Malformed`] or [`Error::Encoding`] where they are none of the codec's, [`Error::NotLinked`] where they
    /// ask for a part that was left out.
    fn parse(parameters: &'a [u8], at: usize) -> Result<Self, Error>;

    /// Writes the parameters as [`parse`](Self::parse) reads them.
    fn emit(&self, out: &mut impl Extend<u8>);

    /// What the record of a channel may be.
    fn rules(&self) -> Rules;

    /// The memory that is needed besides that of the entropy stage.
    fn needs(&self, channels: usize) -> Needs;

    /// Frames by which a pose lags behind its codes: the pose that a frame's codes give is that of so many frames before.
    fn delay(&self) -> u16 {
        0
    }
}

/// A codec that has a decoder of its own, instead of the one that all scalar codecs share.
pub trait CodecWithDecoder<'a>: Codec<'a> {
    /// The decoder, in memory that its caller lends.
    type Decoder<'s>: FrameDecoder
    where
        'a: 's;

    /// A decoder before any entry point, for these channels, in memory of at least what is needed.
    ///
    /// # Errors
    /// [`Error::OutputTooSmall`], or [`Error::Encoding`] where the entropy stage's tables are none.
    fn open<'s>(
        self,
        shape: Shape<'a>,
        channels: impl Iterator<Item = Channel<'a>>,
        memory: Memory<'s>,
    ) -> Result<Self::Decoder<'s>, Error>;
}

/// A decoder of any codec, which a container leads from block to block and from frame to frame.
///
/// The decoder owns its place in a block, be that a bit position, the registers of a range coder, or frames of a group that
/// were decoded before they are asked for. A container hands it the whole block with each call, and the same one until
/// [`begin`](Self::begin).
pub trait FrameDecoder {
    /// Frames by which a pose lags behind its codes: [`Codec::delay`].
    fn delay(&self) -> u16 {
        0
    }

    /// Enters a block with these codes. At an `entry` point nothing counts that was before it, but for poses that are
    /// [delayed](Self::delay). `Some(true)` says that the block's first frame was decoded with that, `None` that there are
    /// too few codes.
    fn begin(&mut self, codes: &[u8], entry: bool) -> Option<bool>;

    /// Decodes the next frame of the block. The work of a call is bounded: that of a group of frames has to be spread
    /// over them. `None`: there are too few codes.
    fn next_frame(&mut self, codes: &[u8]) -> Option<()>;

    /// Gives one more of the poses that are [delayed](Self::delay), after the last frame of the clip.
    fn drain(&mut self) {}

    /// Bytes of the block that were taken.
    fn used(&self) -> usize;

    /// The last pose, an element a channel.
    fn pose(&self) -> &[I16F16];
}

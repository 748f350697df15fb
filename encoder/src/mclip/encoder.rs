//! Encodes a motion with a codec, an entropy stage and a quality.

use super::writer;
use crate::codec::CodecSettings;
use crate::column::Choice;
use crate::error::EncodeError;
use crate::memory::OwnedMemory;
use crate::simulate::Outline;
use crate::task::{Channels, Task};
use decoder_core::Limits;
use decoder_core::entropy::fixed_width::OCTET;
use decoder_core::mclip::{Clip, CodecId, EntropyId};
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

/// How fine steps are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quality {
    /// Every channel has codes of so many bits, 1 to [`Encoding::most_bits`], and its best step.
    Bits(u8),
    /// The displacement in cm, root of the sum of squares over the joints, that one step of a channel makes. For
    /// codecs whose steps are free: [`Encoding::has_free_steps`].
    Step(f64),
    /// The step of every channel in its own unit, degrees or centimetres: what has the most PSNR for its bits. For the
    /// same codecs.
    Even(f64),
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

    /// The motion as a codec takes it.
    pub(crate) const fn task(&self, entry_frames: usize) -> Task<'_> {
        Task { motion: &self.motion, entry_frames }
    }

    /// Encodes, in the smallest entropy stage unless one is given.
    ///
    /// # Errors
    /// [`EncodeError::NoFreeSteps`] where the codec has no steps to choose, and [`EncodeError::Refused`] where a setting is
    /// outside what the format has.
    pub fn encode(&self, encoding: &Encoding, quality: Quality) -> Result<Vec<u8>, EncodeError> {
        let codec = encoding.codec.encoder();
        let task = self.task(encoding.entry_frames);
        let mut allocation = match quality {
            Quality::Bits(bits) => codec.allocate_bits(&task, bits.clamp(1, codec.most_bits())),
            Quality::Step(cm) => codec.allocate_steps(&task, &self.motion.steps(cm)),
            Quality::Even(step) => {
                codec.allocate_steps(&task, &vec![65536.0 * step; self.motion.columns.len()])
            }
        }?;
        if encoding.entropy == Some(EntropyId::FixedWidth) {
            level(&mut allocation.choices);
        }
        let outline = Outline::of_clip(codec, &task, &allocation);
        let coded = outline.simulate(&self.motion.source.targets, allocation.dead_zone)?;
        let stages = encoding.entropy.map_or(EntropyId::ALL.to_vec(), |entropy| vec![entropy]);
        let clips =
            stages.into_iter().map(|entropy| writer::write(&outline, &coded, entropy, encoding.block_bytes));
        Ok(clips.min_by_key(Vec::len).unwrap_or_default())
    }
}

/// Gives channels at rest codes too, where all others of their octet have codes of one width: a decoder takes the codes of
/// equal octets several times as fast.
fn level(choices: &mut [Choice]) {
    for octet in choices.chunks_mut(OCTET) {
        let width = octet.iter().map(|choice| choice.bits).max().unwrap_or(0);
        if octet.iter().all(|choice| choice.bits == 0 || choice.bits == width) {
            octet.iter_mut().for_each(|choice| choice.bits = width);
        }
    }
}

/// Decodes a whole clip with the decoder's own code. Values are in degrees and centimetres, angles continuous.
///
/// # Errors
/// As [`Clip::parse`] and [`Decoder::next_frame`](decoder_core::mclip::Decoder::next_frame).
pub fn decode(bytes: &[u8]) -> Result<Motion, decoder_core::Error> {
    let clip = Clip::parse(bytes, Limits::MAX)?;
    let opening = clip.header().opening();
    let fps = f64::from(opening.rate_numerator) / f64::from(opening.rate_denominator);
    let mut memory = OwnedMemory::new(clip.header().needs());
    let mut decoder = clip.decoder(memory.lend())?;
    let mut samples = Vec::new();
    while let Some(pose) = decoder.next_frame()? {
        samples.extend(pose.iter().map(|value| value.to_num::<f64>()));
    }
    Ok(Motion { fps, channels: clip.channels(), samples })
}

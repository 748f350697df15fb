//! The codecs: which stages each is composed of.
//!
//! | codec | prediction | quantiser |
//! |---|---|---|
//! | pcm | the middle of the channel's range | uniform between limits (7-4) |
//! | mulaw | first order | mu-law (7-5) |
//! | dpcm | the last value, first or second order | uniform |
//! | adpcm | second order, fixed or adaptive | uniform or adaptive (7-7) |
//! | qmd | the last value | look-up table |

use super::header::check;
use crate::error::{Error, Feature, Field};
use crate::predict::adaptive::MAX_WINDOW;
use crate::predict::window::{LONGEST, SHORTEST};
use crate::quantise::adaptive::CLASSES;
use crate::quantise::step::MAX_STEP;
use crate::quantise::{Adaptive, Lookup, MAX_BITS, MuLaw};

/// A codec, as a header names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CodecId {
    /// Values in steps between two limits.
    Pcm,
    /// Differences to a prediction, in mu-law steps.
    MuLaw,
    /// Differences to a prediction, in steps.
    Dpcm,
    /// The same with a quantiser, a predictor or both that adapt.
    Adpcm,
    /// Differences from a look-up table.
    Qmd,
}

/// An entropy stage, as a header names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EntropyId {
    /// Codes of fixed width.
    FixedWidth,
    /// Static Huffman codes.
    Huffman,
    /// Adaptive Huffman codes.
    AdaptiveHuffman,
}

impl CodecId {
    /// All codecs, in the order of their numbers.
    pub const ALL: [Self; 5] = [Self::Pcm, Self::MuLaw, Self::Dpcm, Self::Adpcm, Self::Qmd];

    /// The codec with this number.
    pub fn from_id(id: u8) -> Option<Self> {
        Self::ALL.get(usize::from(id)).copied()
    }

    /// Its number.
    pub const fn id(self) -> u8 {
        self as u8
    }

    /// Its name, in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pcm => "pcm",
            Self::MuLaw => "mulaw",
            Self::Dpcm => "dpcm",
            Self::Adpcm => "adpcm",
            Self::Qmd => "qmd",
        }
    }
}

impl EntropyId {
    /// All entropy stages, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::FixedWidth, Self::Huffman, Self::AdaptiveHuffman];

    /// The stage with this number.
    pub fn from_id(id: u8) -> Option<Self> {
        Self::ALL.get(usize::from(id)).copied()
    }

    /// Says whether it was linked.
    ///
    /// # Errors
    /// [`Error::NotLinked`].
    pub const fn check_linked(self) -> Result<(), Error> {
        match self {
            Self::FixedWidth => Feature::FixedWidth.check(),
            Self::Huffman => Feature::Huffman.check(),
            Self::AdaptiveHuffman => Feature::AdaptiveHuffman.check(),
        }
    }

    /// Its number.
    pub const fn id(self) -> u8 {
        self as u8
    }

    /// Its name, in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FixedWidth => "fixed-width",
            Self::Huffman => "huffman",
            Self::AdaptiveHuffman => "adaptive-huffman",
        }
    }
}

/// How the adaptive predictor adapts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adaptation {
    /// s, 1 to [`MAX_WINDOW`]: the exponential window has 2^s frames. Or [`SHORTEST`] to [`LONGEST`]: the sliding window
    /// has so many.
    pub window: u8,
    /// p: a channel's coefficients are solved for every 2^p frames, 0 to 14, so that a sliding window, of at most 8 · 2^p frames,
    /// costs no more than 8 movements a frame.
    pub period: u8,
}

impl Adaptation {
    /// Words of a channel's ring: the sliding window's length, none for an exponential one.
    pub const fn ring_words(self) -> usize {
        if self.window >= SHORTEST { self.window as usize } else { 0 }
    }
}

/// What adapts in adpcm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adpcm {
    /// The quantiser; its multipliers are 0 where it does not.
    pub quantiser: Adaptive,
    /// The predictor, if it does.
    pub predictor: Option<Adaptation>,
}

impl Adpcm {
    /// Bytes of the parameters.
    pub const BYTES: usize = CLASSES.wrapping_add(4);

    /// The parameters as a header has them.
    pub fn bytes(&self) -> [u8; Self::BYTES] {
        let (window, period) = match self.predictor {
            Some(Adaptation { window, period }) => (window, period),
            None => (0, 0),
        };
        let multipliers = self.quantiser.multipliers.into_iter().map(i8::cast_unsigned);
        let rest = [self.quantiser.low, self.quantiser.high, window, period];
        let mut bytes = [0; Self::BYTES];
        bytes.iter_mut().zip(multipliers.chain(rest)).for_each(|(slot, byte)| *slot = byte);
        bytes
    }

    fn read(bytes: &[u8; Self::BYTES], at: usize) -> Result<Self, Error> {
        let (multipliers, rest) = bytes.split_first_chunk::<CLASSES>().unwrap_or((&[0; CLASSES], &[]));
        let &[low, high, window, period] = rest else {
            return Err(Error::Encoding { field: Field::Parameters, at });
        };
        check(Field::Parameters, at, high.into(), low.into(), MAX_STEP.into())?;
        let most = if window < SHORTEST { MAX_WINDOW } else { LONGEST };
        check(Field::Parameters, at, window.into(), 0, most.into())?;
        // Each time coefficients are solved for, a sliding window is gone through: at most 8 movements a channel and frame.
        let eighths = window.wrapping_sub(1) >> 3;
        let least = if window < SHORTEST { 0 } else { u8::BITS.wrapping_sub(eighths.leading_zeros()) };
        check(Field::Parameters, at, period.into(), least, if window == 0 { 0 } else { 14 })?;
        let quantiser = Adaptive::new(multipliers.map(u8::cast_signed), low, high);
        let predictor = (window > 0).then_some(Adaptation { window, period });
        Ok(Self { quantiser, predictor })
    }
}

/// A codec with its parameters.
#[derive(Clone, Copy, Debug)]
pub enum Codec<'a> {
    /// Values in steps between two limits.
    Pcm,
    /// Differences to a prediction of first order, in mu-law steps.
    MuLaw(MuLaw<'a>),
    /// Differences to a prediction, in steps.
    Dpcm {
        /// Order of the predictor: 0 for the last value, 1 or 2.
        order: u8,
    },
    /// The same with stages that adapt.
    Adpcm(Adpcm),
    /// Differences from a look-up table.
    Qmd(Lookup<'a>),
}

impl<'a> Codec<'a> {
    /// Reads a codec's parameters, which are in the structure at byte `at`.
    ///
    /// # Errors
    /// [`Error::Malformed`] or [`Error::Encoding`] where they are none of the codec's.
    pub fn read(id: CodecId, parameters: &'a [u8], at: usize) -> Result<Self, Error> {
        let error = Error::Encoding { field: Field::Parameters, at };
        match (id, parameters) {
            (CodecId::Pcm, []) => Ok(Self::Pcm),
            (CodecId::MuLaw, levels) => MuLaw::new(levels).map(Self::MuLaw).ok_or(error),
            (CodecId::Dpcm, &[order]) => {
                check(Field::Parameters, at, order.into(), 0, 2)?;
                Ok(Self::Dpcm { order })
            }
            (CodecId::Adpcm, parameters) => match <&[u8; Adpcm::BYTES]>::try_from(parameters).ok() {
                Some(parameters) => Adpcm::read(parameters, at).map(Self::Adpcm),
                None => Err(error),
            },
            (CodecId::Qmd, levels) => Lookup::new(levels).map(Self::Qmd).ok_or(error),
            _ => Err(error),
        }
    }

    /// Says whether what it is composed of was linked.
    ///
    /// # Errors
    /// [`Error::NotLinked`].
    pub fn check_linked(&self) -> Result<(), Error> {
        match self {
            Self::Pcm => Feature::Pcm.check(),
            Self::MuLaw(_) => Feature::MuLaw.check(),
            Self::Dpcm { .. } => Feature::Dpcm.check(),
            Self::Adpcm(Adpcm { quantiser, predictor }) => {
                if quantiser.adapts() {
                    Feature::AdaptiveStep.check()?;
                }
                match predictor {
                    Some(_) => Feature::AdaptivePredictor.check(),
                    None if quantiser.adapts() => Ok(()),
                    None => Feature::Dpcm.check(),
                }
            }
            Self::Qmd(_) => Feature::Lookup.check(),
        }
    }

    /// Which codec it is.
    pub const fn id(&self) -> CodecId {
        match self {
            Self::Pcm => CodecId::Pcm,
            Self::MuLaw(_) => CodecId::MuLaw,
            Self::Dpcm { .. } => CodecId::Dpcm,
            Self::Adpcm(_) => CodecId::Adpcm,
            Self::Qmd(_) => CodecId::Qmd,
        }
    }

    /// Most bits of a channel's code.
    pub const fn most_bits(&self) -> u8 {
        match self {
            Self::MuLaw(law) => law.bits(),
            _ => MAX_BITS,
        }
    }

    /// Whether a channel needs a [`Correlation`](crate::predict::Correlation): that of an exponential window.
    pub const fn correlates(&self) -> bool {
        matches!(self, Self::Adpcm(Adpcm { predictor: Some(adaptation), .. }) if adaptation.ring_words() == 0)
    }

    /// Words of a channel's ring, for a predictor with a sliding window.
    pub const fn ring_words(&self) -> usize {
        match self {
            Self::Adpcm(Adpcm { predictor: Some(adaptation), .. }) => adaptation.ring_words(),
            _ => 0,
        }
    }

    /// Whether the predictor needs the value before the last one.
    pub const fn keeps_values(&self) -> bool {
        matches!(self, Self::Dpcm { order: 2.. } | Self::Adpcm(Adpcm { predictor: None, .. }))
    }

    /// Whether the first frame after an entry point has values of its own, instead of codes.
    pub const fn has_entry_values(&self) -> bool {
        !matches!(self, Self::Pcm)
    }
}

//! The curves: a codec with its settings, and the qualities that it is swept over.

use decoder_core::mclip::{CodecId, EntropyId};
use encoder::codec::CodecSettings;
use encoder::codec::adpcm::Adpcm;
use encoder::codec::dpcm::{Dpcm, Order};
use encoder::mclip::{self, Encoding};

/// A codec whose quality is swept.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// What it is called in legends and in the CSV.
    pub name: String,
    /// What sets its quality.
    pub sweep: Sweep,
}

/// What is swept.
#[derive(Clone, Debug, PartialEq)]
pub enum Sweep {
    /// Bits of a code, the same in every channel (.mclip).
    Bits(Encoding),
    /// Steps that move the joints alike in every channel (.mclip).
    Steps(Encoding),
    /// Leading channels that stay floats, FDF, from none to all, with indices of so many bits (.qmd).
    Fixed {
        /// The paper's b, 8 to 16.
        index_bits: u8,
        /// Whether with the paper's encoder.
        faithful: bool,
    },
}

/// One quality of a sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quality {
    /// As [`Sweep::Bits`] and [`Sweep::Steps`] say.
    Mclip(Encoding, mclip::Quality<'static>),
    /// As [`Sweep::Fixed`] says.
    Qmd {
        /// b.
        index_bits: u8,
        /// FDF.
        fixed_channels: u16,
        /// Whether with the paper's encoder.
        faithful: bool,
    },
}

/// Bits that are swept, where a codec can have so many: 4 to 1024 levels, as in the document.
const BITS: std::ops::RangeInclusive<u8> = 2..=10;

/// Steps that are swept, in cm, each twice the one before.
const STEPS: (f64, i32) = (0.025, 9);

/// Numbers of fixed channels that are swept, from none to all.
const FIXED: usize = 16;

impl Curve {
    fn new(name: &str, sweep: Sweep) -> Self {
        Self { name: name.to_owned(), sweep }
    }

    /// Direct quantisation with uniform steps between a channel's lowest and highest value (7-4; figures 7-2, 7-3).
    pub fn pcm() -> Self {
        Self::new("pcm", Sweep::Bits(Encoding::new(CodecId::Pcm)))
    }

    /// First-order prediction, differences in mu-law steps (7-5, 7-14; figure 7-6).
    pub fn mulaw() -> Self {
        Self::new("mulaw", Sweep::Bits(Encoding::new(CodecId::MuLaw)))
    }

    /// First-order prediction, differences in uniform steps (7-4, 7-14; figures 7-5, 7-6).
    pub fn dpcm_first() -> Self {
        let first = Dpcm { order: Order::First, ..Dpcm::default() };
        Self::new("dpcm order 1", Sweep::Bits(Encoding::of(first)))
    }

    /// An adaptive quantiser behind an adaptive second-order predictor (7-7, 7-15; figures 7-7, 7-8).
    pub fn adpcm_both() -> Self {
        Self::new("adpcm both", Sweep::Bits(Encoding::of(Adpcm::BOTH)))
    }

    /// A .qmd with indices of `index_bits` bits, over FDF (QMD figures 5, 6).
    pub fn qmd(index_bits: u8, faithful: bool) -> Self {
        let name = format!(".qmd b {index_bits}{}", if faithful { " faithful" } else { "" });
        Self { name, sweep: Sweep::Fixed { index_bits, faithful } }
    }

    /// The curves of a codec: over bits for all settings that deserve one, and over steps where the standard settings have
    /// free steps.
    pub fn of(codec: CodecId) -> Vec<Self> {
        let mut curves = Vec::new();
        for (name, settings) in CodecSettings::curves(codec) {
            let encoding = Encoding::of(settings);
            let name = format!("{} {name}", codec.name());
            curves.push(Self::new(name.trim_end(), Sweep::Bits(encoding)));
            if settings == CodecSettings::new(codec) && encoding.has_free_steps() {
                curves.push(Self::new(&format!("{} steps", name.trim_end()), Sweep::Steps(encoding)));
            }
        }
        if codec == CodecId::Qmd {
            // The codec has a container of its own too.
            curves.push(Self::qmd(8, false));
        }
        curves
    }

    /// Whether it can have one entropy stage or another: a .qmd has none.
    pub const fn has_entropy(&self) -> bool {
        !matches!(self.sweep, Sweep::Fixed { .. })
    }

    /// The curve with another entropy stage, which its name then says. A .qmd has none.
    pub fn with_entropy(mut self, entropy: EntropyId) -> Self {
        if let Sweep::Bits(encoding) | Sweep::Steps(encoding) = &mut self.sweep {
            encoding.entropy = Some(entropy);
            self.name = format!("{}, {}", self.name, entropy.name());
        }
        self
    }

    /// The codec.
    pub fn codec(&self) -> CodecId {
        match &self.sweep {
            Sweep::Bits(encoding) | Sweep::Steps(encoding) => encoding.codec.id(),
            Sweep::Fixed { .. } => CodecId::Qmd,
        }
    }

    /// The qualities for a motion of so many channels, the same number of them for any; coarsest first.
    pub fn qualities(&self, channels: usize) -> Vec<Quality> {
        match self.sweep {
            Sweep::Bits(encoding) => BITS
                .filter(|&bits| bits <= encoding.most_bits())
                .map(|bits| Quality::Mclip(encoding, mclip::Quality::Bits(bits)))
                .collect(),
            Sweep::Steps(encoding) => (0..=STEPS.1)
                .rev()
                .map(|power| {
                    Quality::Mclip(encoding, mclip::Quality::Step(STEPS.0 * f64::from(power).exp2()))
                })
                .collect(),
            Sweep::Fixed { index_bits, faithful } => (0..=FIXED)
                .map(|part| Quality::Qmd {
                    index_bits,
                    fixed_channels: (channels * part / FIXED) as u16,
                    faithful,
                })
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_codec_has_a_curve_for_settings_that_deserve_one_and_for_free_steps() {
        let names = |codec| Curve::of(codec).into_iter().map(|curve| curve.name).collect::<Vec<_>>();
        assert_eq!(names(CodecId::Pcm), ["pcm", "pcm steps"]);
        assert_eq!(names(CodecId::Dpcm), ["dpcm order 1", "dpcm order 2", "dpcm order 2 steps"]);
        assert_eq!(names(CodecId::Qmd), ["qmd packed", ".qmd b 8"]);
    }

    #[test]
    fn names_tell_curves_apart_and_every_motion_has_as_many_qualities() {
        let mut names: Vec<String> = Vec::new();
        for codec in CodecId::ALL {
            for curve in Curve::of(codec) {
                assert_eq!(curve.codec(), codec, "{}", curve.name);
                assert_eq!(curve.qualities(62).len(), curve.qualities(3).len(), "{}", curve.name);
                names.push(curve.clone().with_entropy(EntropyId::Huffman).name);
                names.push(curve.name);
            }
        }
        names.sort();
        names.dedup();
        // Eleven curves, and ten with an entropy stage of their own.
        let expected = 2 * CodecId::ALL.into_iter().map(|codec| Curve::of(codec).len()).sum::<usize>() - 1;
        assert_eq!(names.len(), expected, "{names:?}");
    }
}

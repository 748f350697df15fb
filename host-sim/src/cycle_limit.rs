//! Finds the settings of a .mclip whose most expensive frame a core can afford.

use crate::clip::Clip;
use crate::profile::{self, measure};
use anyhow::{Context, Result, anyhow, bail};
use decoder_core::mclip::{CodecId, EntropyId};
use encoder::codec::CodecSettings;
use encoder::mclip::{Encoded, Encoder, Encoding, Quality, Target, certify};
use mocap::metrics::Evaluator;
use std::path::Path;
use std::str::FromStr;
use thumb_cycles::Core;

/// Most cycles that a frame may take on a core, the flash without wait states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit {
    /// Cycles of the most expensive frame.
    pub cycles: u64,
    /// The core; the Cortex-M4 unless one is named.
    pub core: Core,
}

impl FromStr for Limit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (cycles, core) = text.split_once('@').unwrap_or((text, Core::M4.name()));
        let cycles = cycles.parse().ok().filter(|&cycles| cycles > 0);
        let cycles =
            cycles.ok_or_else(|| "expected cycles, for instance 6000 or 6000@cortex-m0plus".to_owned())?;
        let core = Core::from_name(core).ok_or_else(|| {
            let names: Vec<&str> = Core::ALL.iter().map(|core| core.name()).collect();
            format!("expected a core after the @: {}", names.join(", "))
        })?;
        Ok(Self { cycles, core })
    }
}

/// What a clip should come to besides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Codes of so many bits, in the fewest bytes.
    Bits(u8),
    /// An error in the fewest bytes, or a rate at the smallest error.
    Target(Target),
}

/// A clip that was tried.
#[derive(Clone, Debug)]
pub struct TriedClip {
    /// What it was encoded with.
    pub encoding: Encoding,
    /// The clip.
    pub encoded: Encoded,
    /// Cycles of its most expensive frame, which its header has as well.
    pub cycles_max: u64,
}

/// What to try, for a codec and an entropy stage where these are given; every one has the other settings of `base`. Where
/// no codec is given, all are tried that can come to any error: those whose steps are free.
pub fn candidates(base: &Encoding, codec: Option<CodecId>, entropy: Option<EntropyId>) -> Vec<Encoding> {
    let free = || CodecId::ALL.into_iter().filter(|&codec| Encoding::new(codec).has_free_steps()).collect();
    let codecs: Vec<CodecId> = codec.map_or_else(free, |codec| vec![codec]);
    let entropies = entropy.map_or(vec![EntropyId::Huffman, EntropyId::FixedWidth], |entropy| vec![entropy]);
    let mut all = Vec::new();
    for id in codecs {
        let settings = if base.codec.id() == id { base.codec } else { CodecSettings::new(id) };
        for codec in settings.cheaper() {
            for &entropy in &entropies {
                all.push(Encoding { codec, entropy: Some(entropy), ..*base });
            }
        }
    }
    all
}

/// A sentence's name for an encoding, for instance `dpcm, second order, huffman`.
pub fn describe(encoding: &Encoding) -> String {
    let entropy = encoding.entropy.map_or("smallest", EntropyId::name);
    let parts = [encoding.codec.id().name(), &encoding.codec.encoder().describe(), entropy];
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(", ")
}

/// The cores that the header of a .mclip can name, each at its number (docs/FORMAT.md, "Header").
const HEADER_CORES: [Core; 7] =
    [Core::M0, Core::M0Plus, Core::M0PlusSlow, Core::M3, Core::M4, Core::M33, Core::M7];

/// The number of a core in the header of a .mclip.
pub fn header_number(core: Core) -> Option<u8> {
    let place = HEADER_CORES.into_iter().position(|other| other == core)?;
    u8::try_from(place).ok()
}

/// The core that has a number in the header of a .mclip.
pub fn header_core(number: u8) -> Option<Core> {
    HEADER_CORES.get(usize::from(number)).copied()
}

/// Encodes with every candidate, and gives the best clip whose most expensive frame is within the limit: clips are run on
/// the simulated core from the best on, until one is. `progress` is told what is being done.
///
/// # Errors
/// Where none is within the limit, a sentence that names the one with the fewest cycles; those of building and running
/// images.
pub fn best_clip(
    encoder: &Encoder<'_>,
    evaluator: &Evaluator,
    candidates: &[Encoding],
    goal: Goal,
    limit: Limit,
    progress: &mut dyn FnMut(String),
) -> Result<TriedClip> {
    let mut clips = Vec::new();
    for encoding in candidates {
        progress(format!("encoding as {}", describe(encoding)));
        let encoded = match goal {
            Goal::Bits(bits) if bits > encoding.most_bits() => continue,
            Goal::Bits(bits) => encoder.measured(encoding, Quality::Bits(bits), evaluator)?,
            Goal::Target(target) => encoder.encode_to(encoding, target, evaluator)?,
        };
        if reaches(encoder, &encoded, goal) {
            clips.push((encoding, encoded));
        }
    }
    let cost = |encoded: &Encoded| match goal {
        Goal::Target(Target::Rate(_)) => encoded.errors.mean_joint_cm,
        _ => encoded.bytes.len() as f64,
    };
    clips.sort_by(|(_, one), (_, other)| cost(one).total_cmp(&cost(other)));
    progress(format!("building the decoder for {}", limit.core.target()));
    let decoder = profile::mclip_decoders(&[limit.core.target()])?.concat();
    let mut least: Option<TriedClip> = None;
    for (encoding, encoded) in clips {
        progress(format!("counting cycles of {}", describe(encoding)));
        let (bytes, cycles_max) =
            certified(&encoded.bytes, &decoder, limit.core).with_context(|| describe(encoding))?;
        let tried = TriedClip { encoding: *encoding, encoded: Encoded { bytes, ..encoded }, cycles_max };
        if cycles_max <= limit.cycles {
            return Ok(tried);
        }
        if least.as_ref().is_none_or(|least| cycles_max < least.cycles_max) {
            least = Some(tried);
        }
    }
    let Some(least) = least else { bail!("no codec comes to what was asked for, whatever its cycles") };
    bail!(
        "the fewest cycles of a worst frame on {} are {}, with {} in {} bytes, above the limit of {}",
        limit.core.name(),
        least.cycles_max,
        describe(&least.encoding),
        least.encoded.bytes.len(),
        limit.cycles
    )
}

/// Whether a clip comes to what it should: its bounds, an error to 3 %, or a rate.
fn reaches(encoder: &Encoder<'_>, encoded: &Encoded, goal: Goal) -> bool {
    match goal {
        Goal::Bits(_) => true,
        Goal::Target(Target::Error(cm)) => encoded.errors.mean_joint_cm <= cm * 1.03,
        Goal::Target(Target::Within(bounds)) => bounds.excess(&encoded.errors) <= 1.0,
        Goal::Target(Target::Rate(rate)) => encoder.rate(&encoded.bytes) <= rate,
    }
}

/// The clip with the cycles of its most expensive frame in its header, and these cycles.
fn certified(bytes: &[u8], decoder: &[u8], core: Core) -> Result<(Vec<u8>, u64)> {
    let number =
        header_number(core).ok_or_else(|| anyhow!("{} is no core of a clip's header", core.name()))?;
    // Counted with room for the number, so that every byte is where it will be.
    let cycles = worst_frame(&certify(bytes, &[(number, 0)])?, decoder, core)?;
    Ok((certify(bytes, &[(number, u32::try_from(cycles)?)])?, cycles))
}

/// Cycles of a clip's most expensive frame, on the image of a decoder.
fn worst_frame(bytes: &[u8], decoder: &[u8], core: Core) -> Result<u64> {
    let clip = Clip::parse(Path::new("clip.mclip"), bytes)?;
    let image = profile::load_mclip(decoder.to_vec(), bytes, false)?;
    let measured = measure::frames(core, &image, 0, &profile::frames(&clip)?, &mut || ())?;
    measured.frame_cycles.iter().copied().max().ok_or_else(|| anyhow!("the clip has no frames"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use encoder::codec::adpcm::Adpcm;

    #[test]
    fn a_limit_names_a_core_or_not() {
        assert_eq!("6000".parse(), Ok(Limit { cycles: 6000, core: Core::M4 }));
        assert_eq!("12000@cortex-m0plus".parse(), Ok(Limit { cycles: 12_000, core: Core::M0Plus }));
        for wrong in ["", "0", "-3", "5%", "@cortex-m4"] {
            assert!(wrong.parse::<Limit>().unwrap_err().starts_with("expected cycles"), "{wrong}");
        }
        assert!("5@z80".parse::<Limit>().unwrap_err().contains("cortex-m33"));
    }

    #[test]
    fn what_is_given_is_not_varied() {
        let base = Encoding { entry_frames: 99, block_bytes: 300, ..Encoding::of(Adpcm::BOTH) };
        let given = candidates(&base, Some(CodecId::Adpcm), Some(EntropyId::FixedWidth));
        let expected = Encoding { entropy: Some(EntropyId::FixedWidth), ..base };
        assert_eq!(given, [expected]);
        let free = candidates(&Encoding::new(CodecId::Dpcm), None, None);
        let with_free_steps = CodecId::ALL.into_iter().filter(|&codec| Encoding::new(codec).has_free_steps());
        let settings = with_free_steps.map(|codec| CodecSettings::new(codec).cheaper().len());
        assert_eq!(free.len(), settings.sum::<usize>() * 2);
        assert!(free.len() >= 5 * 2);
        assert_eq!(describe(&free[0]), "pcm, huffman");
        assert_eq!(describe(&free[3]), "dpcm, last value, fixed-width");
        assert_eq!(describe(&given[0]), "adpcm, adaptive predictor, adaptive step, fixed-width");
    }
}

//! Stores a motion in every way, and plays what was stored on the simulator.

use super::pack::{self, PACKERS, Packer};
use super::quantised::Quantised;
use crate::clip::Clip;
use crate::image::Image;
use crate::profile::elf::Memory;
use crate::profile::loaded::Contents;
use crate::profile::measure::{self, Measured};
use crate::profile::{self, LoadedImage};
use anyhow::{Context, Result, bail};
use decoder_core::mclip::{CodecId, EntropyId};
use encoder::mclip::{Encoder, Encoding, Quality, Target};
use encoder::qmd::{self, Parameters};
use encoder::source::Source;
use mocap::metrics::Evaluator;
use serde::Serialize;
use std::path::Path;
use thumb_cycles::Core;

/// How a motion is stored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// As int16.
    Int16 {
        /// By what it is packed.
        packer: Packer,
        /// Whether frames are differences.
        delta: bool,
    },
    /// As QMD.
    Qmd {
        /// Channels that are floats.
        fdf: u16,
        /// Whether the decoder is lent memory for its table.
        lent: bool,
    },
    /// As a .mclip.
    Mclip {
        /// Its codec.
        blocks: Blocks,
    },
}

/// The codecs of .mclip that are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Blocks {
    /// dpcm in codes of fixed width, at the error of int16.
    DpcmFixed,
    /// dpcm in Huffman codes, at the error of int16.
    DpcmHuffman,
    /// dpcm in Huffman codes, at a mean joint error of 0.1 cm.
    DpcmCoarse,
    /// Indices of QMD tables in Huffman codes, b = 8.
    QmdHuffman,
}

impl Blocks {
    const ALL: [Self; 4] = [Self::DpcmFixed, Self::DpcmHuffman, Self::DpcmCoarse, Self::QmdHuffman];

    const fn name(self) -> &'static str {
        match self {
            Self::DpcmFixed => "dpcm, fixed width",
            Self::DpcmHuffman => "dpcm, Huffman",
            Self::DpcmCoarse => "dpcm, Huffman, 0.1 cm",
            Self::QmdHuffman => "QMD packed, Huffman",
        }
    }

    /// Encodes; `fine` is the error of int16 in cm.
    fn encode(self, clip: &mocap::Clip, fine: f64, evaluator: &Evaluator) -> Result<Vec<u8>> {
        let (codec, entropy) = match self {
            Self::DpcmFixed => (CodecId::Dpcm, EntropyId::FixedWidth),
            Self::DpcmHuffman | Self::DpcmCoarse => (CodecId::Dpcm, EntropyId::Huffman),
            Self::QmdHuffman => (CodecId::Qmd, EntropyId::Huffman),
        };
        let encoding = Encoding { entropy: Some(entropy), ..Encoding::new(codec) };
        let encoder = Encoder::new(&clip.skeleton, &clip.motion)?;
        let to = |cm| encoder.encode_to(&encoding, Target::Error(cm), evaluator).map(|encoded| encoded.bytes);
        Ok(match self {
            Self::DpcmFixed | Self::DpcmHuffman => to(fine),
            Self::DpcmCoarse => to(0.1),
            Self::QmdHuffman => encoder.encode(&encoding, Quality::Bits(8)),
        }?)
    }
}

impl Method {
    /// All that can be compared on this machine, for a motion of so many channels.
    pub fn all(channels: usize) -> Vec<Self> {
        let packers = PACKERS.into_iter().filter(|packer| packer.left_out().is_none());
        let packed = packers.flat_map(|packer| {
            // Differences take as many bytes as frames until something packs them.
            let deltas: &[bool] = if packer == Packer::Raw { &[false] } else { &[false, true] };
            deltas.iter().map(move |&delta| Self::Int16 { packer, delta })
        });
        let fdf = 6.min(channels as u16);
        let qmd = [(fdf, true), (0, true), (fdf, false)].map(|(fdf, lent)| Self::Qmd { fdf, lent });
        let mclip = Blocks::ALL.map(|blocks| Self::Mclip { blocks });
        packed.chain(qmd).chain(mclip).collect()
    }

    /// A short name.
    pub fn name(self) -> String {
        match self {
            Self::Int16 { packer, delta: false } => packer.name().to_owned(),
            Self::Int16 { packer, delta: true } => format!("delta + {}", packer.name()),
            Self::Qmd { fdf, lent: true } => format!("QMD, FDF {fdf}"),
            Self::Qmd { fdf, lent: false } => format!("QMD, FDF {fdf}, no table"),
            Self::Mclip { blocks } => blocks.name().to_owned(),
        }
    }

    /// Whether it is ours.
    pub const fn is_ours(self) -> bool {
        !matches!(self, Self::Int16 { .. })
    }
}

/// What a method costs on a core.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// The core.
    pub core: &'static str,
    /// Cycles of a frame on average.
    pub cycles_mean: f64,
    /// Cycles of the most expensive frame.
    pub cycles_max: u64,
    /// Static RAM, and the deepest stack of decoding a frame; for ours that of the whole run, since the decoder lives
    /// on the stack.
    pub ram_bytes: u64,
    /// Flash of the decoder: its functions and their constants, without the motion.
    pub flash_bytes: u64,
}

/// What a method gives.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// Its name.
    pub name: String,
    /// The method.
    pub method: Method,
    /// Bytes of the stored motion.
    pub bytes: usize,
    /// Distance of joints from where they should be, over all joints and frames.
    pub mean_joint_cm: f64,
    /// What it costs, core by core.
    pub costs: Vec<Cost>,
}

/// A motion to be stored in every way, and the players of what other crates have packed.
pub struct Comparison<'c> {
    clip: &'c mocap::Clip,
    evaluator: Evaluator,
    /// The motion as int16.
    stored: Quantised,
    cores: &'c [Core],
    targets: Vec<&'static str>,
    /// Images of [`PACKERS`] that are not left out, in the order of the targets.
    players: Vec<(Packer, Vec<Vec<u8>>)>,
}

impl<'c> Comparison<'c> {
    /// Builds the players for every core, all at once.
    ///
    /// # Errors
    /// A sentence that says what could not be stored or built.
    pub fn new(clip: &'c mocap::Clip, cores: &'c [Core]) -> Result<Self> {
        let mut targets: Vec<&str> = cores.iter().map(|core| core.target()).collect();
        targets.sort_unstable();
        targets.dedup();
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion)?;
        let stored = Quantised::new(clip)?;
        let packers: Vec<Packer> = PACKERS.into_iter().filter(|packer| packer.left_out().is_none()).collect();
        let sizes = [
            ("BUNRAKU_CHANNELS", stored.channels().to_string()),
            ("BUNRAKU_BLOCK_FRAMES", stored.block_frames().to_string()),
        ];
        let tamp = pack::tamp_variables();
        let variables: Vec<(&str, &str)> =
            sizes.iter().chain(&tamp).map(|(name, value)| (*name, value.as_str())).collect();
        let image = Image {
            package: "peers-image",
            source: "bench/peers-image",
            binary: Packer::Raw.binary(),
            features: if packers.contains(&Packer::Tamp) { "tamp" } else { "" },
            targets: &targets,
            folder: pack::FOLDER,
            files: &[],
            variables: &variables,
        };
        let binaries: Vec<&str> = packers.iter().map(|packer| packer.binary()).collect();
        let players = packers.into_iter().zip(image.build_all(&binaries)?).collect();
        Ok(Self { clip, evaluator, stored, cores, targets, players })
    }

    /// Stores the motion by one method and plays it on every core. Every frame is compared with what this machine has.
    ///
    /// # Errors
    /// A sentence that says what could not be stored, built or run.
    pub fn measure(&self, method: Method) -> Result<Entry> {
        let Self { clip, evaluator, stored, cores, targets, players } = self;
        let error_of_int16 = || evaluator.mean_joint_cm(&stored.motion(clip.motion.fps).samples);
        let (bytes, images, mean_joint_cm, expected) = match method {
            Method::Int16 { packer, delta } => {
                let block = stored.block_frames() * stored.channels() * 2;
                let store = packer.pack(&stored.bytes(delta), block)?;
                let player = players.iter().find(|(other, _)| *other == packer);
                let (_, images) = player.with_context(|| format!("{} is left out", packer.name()))?;
                let (files, numbers) = (&[("STORE", &store[..])], &[("DELTA", delta.into())]);
                let contents = Contents { files, numbers, lent_bytes: 0 };
                let images = images.iter().map(|elf| LoadedImage::new(elf.clone(), contents));
                let images = images.collect::<Result<Vec<LoadedImage>>>()?;
                (store.len(), images, error_of_int16(), stored.expected())
            }
            Method::Qmd { fdf, lent } => {
                let parameters = Parameters { fixed_channels: fdf, ..Parameters::TABLE_1 };
                let source = Source::new(&clip.skeleton, &clip.motion)?;
                let bytes = source.encode(parameters, qmd::Method::ClosedLoop)?;
                let images = profile::images(&bytes, targets, lent)?;
                let error = evaluator.mean_joint_cm(&qmd::decode(&bytes)?.samples);
                let expected = profile::frames(&Clip::parse(Path::new("clip.qmd"), &bytes)?)?;
                (bytes.len(), images, error, expected)
            }
            Method::Mclip { blocks } => {
                let bytes = blocks.encode(clip, error_of_int16(), evaluator)?;
                let images = profile::mclip_images(&bytes, targets, false)?;
                let error = evaluator.mean_joint_cm(&encoder::mclip::decode(&bytes)?.samples);
                let expected = profile::frames(&Clip::parse(Path::new("clip.mclip"), &bytes)?)?;
                (bytes.len(), images, error, expected)
            }
        };
        let mut costs = Vec::new();
        for &core in *cores {
            let built = targets.iter().zip(&images).find(|(target, _)| **target == core.target());
            let Some((_, image)) = built else { bail!("no image was built for {}", core.name()) };
            let measured = measure::frames(core, image, 0, &expected, &mut || ())
                .with_context(|| format!("{} on {}", method.name(), core.name()))?;
            costs.push(cost(core, image, method, &measured)?);
        }
        Ok(Entry { name: method.name(), method, bytes, mean_joint_cm, costs })
    }
}

fn cost(core: Core, image: &LoadedImage, method: Method, measured: &Measured) -> Result<Cost> {
    let memory = Memory::of(&image.elf)?;
    let stack = match method {
        Method::Qmd { .. } | Method::Mclip { .. } => measured.stack_bytes,
        Method::Int16 { .. } => measured.frame_stack_bytes,
    };
    let constants = memory.sections.iter().filter(|section| section.name == ".rodata");
    let constants: u64 = constants.map(|section| section.bytes).sum();
    let frames = &measured.frame_cycles;
    Ok(Cost {
        core: core.name(),
        cycles_mean: frames.iter().sum::<u64>() as f64 / frames.len().max(1) as f64,
        cycles_max: frames.iter().copied().max().unwrap_or(0),
        ram_bytes: memory.ram_bytes() + image.lent_bytes as u64 + u64::from(stack),
        flash_bytes: memory.code_bytes + constants,
    })
}

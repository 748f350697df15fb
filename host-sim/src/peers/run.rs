//! Stores a motion in every way, and plays each on the simulator.

use super::Quantised;
use crate::clip::Clip;
use crate::image::Image;
use crate::profile;
use crate::profile::elf::Memory;
use crate::profile::measure::{self, Measured};
use crate::thumb::Core;
use anyhow::{Context, Result, anyhow, bail};
use encoder::metrics::Evaluator;
use encoder::qmd::{self, Parameters, Source};
use serde::Serialize;
use std::path::Path;

/// A crate that packs blocks of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Packer {
    /// None: bytes as they are.
    #[serde(rename = "raw")]
    Raw,
    /// heatshrink, window 2^11, look-ahead 2^4.
    #[serde(rename = "heatshrink")]
    Heatshrink,
    /// LZ4 blocks.
    #[serde(rename = "lz4_flex")]
    Lz4,
    /// Raw DEFLATE at level 10.
    #[serde(rename = "miniz_oxide")]
    Miniz,
}

/// All packers.
pub const PACKERS: [Packer; 4] = [Packer::Raw, Packer::Heatshrink, Packer::Lz4, Packer::Miniz];

/// What is not compared, and why.
pub const LEFT_OUT: &str = "tamp is left out: its crate (tamp-sys 0.1.0) runs bindgen on its C source when it is built, which takes \
     libclang, and newlib's headers for Arm, on every machine that builds Bunraku";

impl Packer {
    /// The crate's name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Heatshrink => "heatshrink",
            Self::Lz4 => "lz4_flex",
            Self::Miniz => "miniz_oxide",
        }
    }

    /// Feature of the image.
    const fn feature(self) -> &'static str {
        match self {
            Self::Raw => "",
            other => other.name(),
        }
    }

    /// What the image is given: bytes as they are, or blocks with their lengths.
    fn pack(self, bytes: &[u8], block: usize) -> Result<Vec<u8>> {
        if self == Self::Raw {
            return Ok(bytes.to_vec());
        }
        let mut store = Vec::new();
        for block in bytes.chunks(block) {
            let packed = match self {
                Self::Raw => block.to_vec(),
                Self::Heatshrink => {
                    // 9 bits for a byte that is not found before.
                    let mut buffer = vec![0; block.len() * 9 / 8 + 8];
                    let config = heatshrink::Config::new(11, 4).map_err(|error| anyhow!(error))?;
                    heatshrink::encode(block, &mut buffer, &config)
                        .map_err(|error| anyhow!("heatshrink: {error:?}"))?
                        .to_vec()
                }
                Self::Lz4 => lz4_flex::block::compress(block),
                Self::Miniz => miniz_oxide::deflate::compress_to_vec(block, 10),
            };
            let len = u16::try_from(packed.len()).context("a packed block of more than 65535 bytes")?;
            store.extend(len.to_le_bytes());
            store.extend(packed);
        }
        Ok(store)
    }
}

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
}

impl Method {
    /// All that are compared, for a motion of so many channels.
    pub fn all(channels: usize) -> Vec<Self> {
        let packed = PACKERS.into_iter().flat_map(|packer| {
            // Differences take as many bytes as frames until something packs them.
            let deltas: &[bool] = if packer == Packer::Raw { &[false] } else { &[false, true] };
            deltas.iter().map(move |&delta| Self::Int16 { packer, delta })
        });
        let fdf = 6.min(channels as u16);
        let qmd = [(fdf, true), (0, true), (fdf, false)].map(|(fdf, lent)| Self::Qmd { fdf, lent });
        packed.chain(qmd).collect()
    }

    /// A short name.
    pub fn name(self) -> String {
        match self {
            Self::Int16 { packer, delta: false } => packer.name().to_owned(),
            Self::Int16 { packer, delta: true } => format!("delta + {}", packer.name()),
            Self::Qmd { fdf, lent: true } => format!("QMD, FDF {fdf}"),
            Self::Qmd { fdf, lent: false } => format!("QMD, FDF {fdf}, no table"),
        }
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
    /// Static RAM, and the deepest stack of decoding a frame; for QMD that of the whole run, since its decoder lives
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

/// Stores a motion by one method, builds its player for every core and plays it. Every frame is compared with what
/// this machine has.
///
/// # Errors
/// A sentence that says what could not be stored, built or run.
pub fn run(clip: &encoder::Clip, method: Method, cores: &[Core]) -> Result<Entry> {
    let mut targets: Vec<&str> = cores.iter().map(|core| core.target()).collect();
    targets.sort_unstable();
    targets.dedup();
    let evaluator = Evaluator::new(&clip.skeleton, &clip.motion)?;
    let (bytes, images, mean_joint_cm, expected) = match method {
        Method::Int16 { packer, delta } => {
            let stored = Quantised::new(clip)?;
            let store = packer.pack(&stored.bytes(delta), stored.block_frames() * stored.channels() * 2)?;
            let images = Image {
                package: "peers-image",
                source: "bench/peers-image",
                binary: "peers-image",
                features: packer.feature(),
                targets: &targets,
                folder: "peers",
                files: &[("BUNRAKU_STORE", "store", &store)],
                variables: &[
                    ("BUNRAKU_CHANNELS", &stored.channels().to_string()),
                    ("BUNRAKU_BLOCK_FRAMES", &stored.block_frames().to_string()),
                    ("BUNRAKU_DELTA", if delta { "1" } else { "0" }),
                ],
            }
            .build()?;
            let error = evaluator.mean_joint_cm(&stored.motion(clip.motion.fps).samples);
            (store.len(), images, error, stored.expected())
        }
        Method::Qmd { fdf, lent } => {
            let parameters = Parameters { fixed_channels: fdf, ..Parameters::TABLE_1 };
            let source = Source::new(&clip.skeleton, &clip.motion)?;
            let bytes = source.encode(parameters, qmd::Method::ClosedLoop)?;
            let images = profile::images(&bytes, &targets, lent)?;
            let error = evaluator.mean_joint_cm(&qmd::decode(&bytes)?.samples);
            (bytes.len(), images, error, profile::frames(&Clip::parse(Path::new("clip.qmd"), &bytes)?)?)
        }
    };
    let mut costs = Vec::new();
    for &core in cores {
        let built = targets.iter().zip(&images).find(|(target, _)| **target == core.target());
        let Some((_, image)) = built else { bail!("no image was built for {}", core.name()) };
        let measured = measure::run(core, image, 0, &expected, &mut || ())
            .with_context(|| format!("{} on {}", method.name(), core.name()))?;
        costs.push(cost(core, image, method, bytes, &measured)?);
    }
    Ok(Entry { name: method.name(), method, bytes, mean_joint_cm, costs })
}

fn cost(core: Core, image: &[u8], method: Method, stored: usize, measured: &Measured) -> Result<Cost> {
    let memory = Memory::of(image)?;
    let stack = match method {
        Method::Qmd { .. } => measured.stack_bytes,
        Method::Int16 { .. } => measured.frame_stack_bytes,
    };
    let constants = memory.sections.iter().filter(|section| section.name == ".rodata");
    let constants: u64 = constants.map(|section| section.bytes).sum();
    let frames = &measured.frame_cycles;
    Ok(Cost {
        core: core.name(),
        cycles_mean: frames.iter().sum::<u64>() as f64 / frames.len().max(1) as f64,
        cycles_max: frames.iter().copied().max().unwrap_or(0),
        ram_bytes: memory.ram_bytes() + u64::from(stack),
        flash_bytes: memory.code_bytes + constants.saturating_sub(stored as u64),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_packed_can_be_unpacked() {
        let stored = Quantised::new(&encoder::sample::clip()).unwrap();
        let block = stored.block_frames() * stored.channels() * 2;
        for packer in PACKERS.into_iter().skip(1) {
            for delta in [false, true] {
                let bytes = stored.bytes(delta);
                let store = packer.pack(&bytes, block).unwrap();
                assert!(store.len() < bytes.len(), "{} {delta}", packer.name());
                let (mut rest, mut found): (&[u8], Vec<u8>) = (&store, Vec::new());
                while let Some((len, after)) = rest.split_first_chunk::<2>() {
                    let (packed, after) = after.split_at(usize::from(u16::from_le_bytes(*len)));
                    rest = after;
                    let mut buffer = vec![0; block + 1];
                    let len = match packer {
                        Packer::Heatshrink => {
                            let config = heatshrink::Config::new(11, 4).unwrap();
                            heatshrink::decode(packed, &mut buffer, &config).unwrap().len()
                        }
                        Packer::Lz4 => lz4_flex::block::decompress_into(packed, &mut buffer).unwrap(),
                        _ => {
                            let unpacked = miniz_oxide::inflate::decompress_to_vec(packed).unwrap();
                            buffer[..unpacked.len()].copy_from_slice(&unpacked);
                            unpacked.len()
                        }
                    };
                    found.extend(&buffer[..len]);
                }
                assert_eq!(found, bytes, "{} {delta}", packer.name());
            }
        }
    }
}

//! The crates that motion is packed with.

use crate::image;
use anyhow::{Context, Result, anyhow};
use serde::Serialize;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// A crate that packs bytes.
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
    /// One stream of tamp, window 2^10, which is its default.
    #[serde(rename = "tamp")]
    Tamp,
}

/// All packers.
pub const PACKERS: [Packer; 5] = [Packer::Raw, Packer::Heatshrink, Packer::Tamp, Packer::Lz4, Packer::Miniz];

/// Bits of tamp's window. Differences, which pack best, took the fewest bytes with these on CMU clips, to half a percent.
const TAMP_WINDOW_BITS: &str = "10";

impl Packer {
    /// The crate's name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Heatshrink => "heatshrink",
            Self::Lz4 => "lz4_flex",
            Self::Miniz => "miniz_oxide",
            Self::Tamp => "tamp",
        }
    }

    /// Why it cannot be compared on this machine, if it cannot.
    pub fn left_out(self) -> Option<&'static str> {
        if self != Self::Tamp {
            return None;
        }
        // Its crate asks both where their headers are.
        let there = |program: &str, argument: &str| {
            let output = Command::new(program).arg(argument).stdin(Stdio::null()).output();
            output.is_ok_and(|output| output.status.success())
        };
        if there("clang", "-print-resource-dir") && newlib().is_some() {
            return None;
        }
        Some(
            "tamp is left out: its crate has C in it and runs bindgen, which takes clang with libclang, arm-none-eabi-gcc and \
             newlib (cargo xtask setup installs them)",
        )
    }

    /// The image that plays what it has packed.
    pub(super) const fn binary(self) -> &'static str {
        match self {
            Self::Raw => "peers-raw",
            Self::Heatshrink => "peers-heatshrink",
            Self::Lz4 => "peers-lz4",
            Self::Miniz => "peers-miniz",
            Self::Tamp => "peers-tamp",
        }
    }

    /// What the image is given: bytes as they are, one stream, or blocks with their lengths.
    pub(super) fn pack(self, bytes: &[u8], block: usize) -> Result<Vec<u8>> {
        match self {
            Self::Raw => return Ok(bytes.to_vec()),
            Self::Tamp => {
                return image::run_tool("tamp-pack", "bench/tamp-pack", FOLDER, &[TAMP_WINDOW_BITS], bytes);
            }
            Self::Heatshrink | Self::Lz4 | Self::Miniz => {}
        }
        let mut store = Vec::new();
        for block in bytes.chunks(block) {
            let packed = match self {
                Self::Raw | Self::Tamp => block.to_vec(),
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

/// The folder of cargo's target folder where all is built that the comparison needs.
pub(super) const FOLDER: &str = "peers";

/// Environment variables that building tamp's image takes.
pub(super) fn tamp_variables() -> Vec<(&'static str, String)> {
    let mut variables = vec![("BUNRAKU_WINDOW_BITS", TAMP_WINDOW_BITS.to_owned())];
    if let Some(include) = newlib() {
        variables.push(("BINDGEN_EXTRA_CLANG_ARGS", format!("-I{}", include.display())));
    }
    variables
}

/// Where newlib's headers are for the Arm compiler.
fn newlib() -> Option<PathBuf> {
    let output = Command::new("arm-none-eabi-gcc").arg("-print-file-name=libc.a").output().ok()?;
    let library = PathBuf::from(String::from_utf8(output.stdout).ok()?.trim());
    let include = library.parent()?.parent()?.join("include");
    include.join("stdlib.h").is_file().then_some(include)
}

#[cfg(test)]
mod tests {
    use super::super::quantised::Quantised;
    use super::*;

    #[test]
    fn what_is_packed_can_be_unpacked() {
        let stored = Quantised::new(&mocap::sample::clip()).unwrap();
        let block = stored.block_frames() * stored.channels() * 2;
        for packer in [Packer::Heatshrink, Packer::Lz4, Packer::Miniz] {
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

//! The document's methods at one PSNR: how many bits each needs, which is their order.
//!
//! Sections 7.2 to 7.6 compare methods by curves of PSNR over bits per second, at 30 updates a second, where a rule of
//! thumb (7.1) calls 20 to 30 dB visually acceptable. Here each method is brought to one PSNR on each motion. Where a
//! method's quality is its bits of a code, that is the fewest bits that have it, and what exactly this PSNR takes is
//! found between them and a bit less on a straight line.
//!
//! The PSNR is [`Report::psnr_db`](metrics::Report): of all rotations together, their peak the range of the motion. (The
//! document defines its own in a chapter, 6, that we do not have.) Rates count the codes: the document sends no
//! header, no checksum and no entry point. The size of the whole file is told beside.

use super::Named;
use anyhow::{Context, Result};
use decoder_core::Limits;
use decoder_core::codec::adpcm::Adaptation;
use decoder_core::mclip::{BLOCK_HEADER_BYTES, Clip, CodecId, EntropyId};
use encoder::codec::CodecSettings;
use encoder::codec::adpcm::Adpcm;
use encoder::codec::dpcm::{Dpcm, Order};
use encoder::codec::qmd::Qmd;
use encoder::lloyd_max::Density;
use encoder::mclip::{Encoder, Encoding, Quality, decode};
use mocap::metrics;
use rayon::prelude::*;

/// A method of the document, or one of ours.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// What it is called.
    pub name: &'static str,
    /// The section that it is from; none where it is ours.
    pub section: Option<&'static str>,
    /// How it is encoded.
    pub encoding: Encoding,
}

impl Method {
    /// All methods, in the order of the document's sections and then ours.
    pub fn all() -> Vec<Self> {
        let (fixed, huffman) = (Some(EntropyId::FixedWidth), Some(EntropyId::Huffman));
        let with = |settings: CodecSettings, entropy| Encoding {
            entropy,
            entry_frames: usize::MAX,
            ..Encoding::of(settings)
        };
        let of = |codec, entropy| with(CodecSettings::new(codec), entropy);
        let dpcm = |order, entropy| with(Dpcm { order, ..Dpcm::default() }.into(), entropy);
        let (last, first) = (|entropy| dpcm(Order::Zero, entropy), |entropy| dpcm(Order::First, entropy));
        let both = |entropy| with(Adpcm::BOTH.into(), entropy);
        let max = |density, entropy| with(Qmd { density: Some(density) }.into(), entropy);
        let sliding = |window| {
            let predictor = Some(Adaptation { window, period: 4 });
            with(Adpcm { predictor, ..Adpcm::default() }.into(), huffman)
        };
        let method = |name, section, encoding| Self { name, section, encoding };
        vec![
            method("direct", Some("7.2"), of(CodecId::Pcm, fixed)),
            method("direct, Huffman", Some("7.4"), of(CodecId::Pcm, huffman)),
            method("differences, uniform", Some("7.2.1"), last(fixed)),
            method("differences, mu-law", Some("7.2.2"), of(CodecId::MuLaw, fixed)),
            method("differences, Gaussian Max", Some("7.2"), max(Density::Gaussian, fixed)),
            method("differences, Laplacian Max", Some("7.2"), max(Density::Laplacian, fixed)),
            method("the same, uniform, Huffman", Some("7.2.1"), last(huffman)),
            method("the same, Gaussian, Huffman", Some("7.2"), max(Density::Gaussian, huffman)),
            method("the same, Laplacian, Huffman", Some("7.2"), max(Density::Laplacian, huffman)),
            method("predictive", Some("7.5"), first(fixed)),
            method("predictive, Huffman", Some("7.5"), first(huffman)),
            method("adaptive predictive", Some("7.6"), both(fixed)),
            method("adaptive predictive, Huffman", Some("7.6"), both(huffman)),
            method("even steps, first order", None, first(huffman)),
            method("even steps, second order", None, of(CodecId::Dpcm, huffman)),
            method("even steps, adaptive", None, of(CodecId::Adpcm, huffman)),
            method("even steps, window of 15", None, sliding(15)),
            method("even steps, window of 120", None, sliding(120)),
        ]
    }
}

/// What a motion came to.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Reached {
    /// The motion.
    pub clip: String,
    /// The method.
    pub method: &'static str,
    /// Bits of a code, where they set the quality.
    pub bits: Option<u8>,
    /// The PSNR of all rotations together in dB: not below what was asked for, or the most that the method has.
    pub psnr_db: f64,
    /// Bytes of the codes.
    pub code_bytes: u64,
    /// Bytes of the codes at exactly the PSNR that was asked for.
    pub code_bytes_at: f64,
    /// Bytes of the whole clip.
    pub bytes: u64,
    /// Bytes of the motion in samples of 16 bits, the document's raw rate.
    pub raw_bytes: u64,
    /// How many times smaller the codes are than the raw samples.
    pub ratio: f64,
    /// How many times smaller the whole clip is.
    pub ratio_file: f64,
    /// Seconds of motion.
    pub seconds: f64,
}

/// Encodes every motion with every method such that its PSNR is `db`, in the order of methods and in each of motions.
///
/// # Errors
/// A sentence that names the motion that cannot be encoded.
pub fn reach_all(motions: &[Named], methods: &[Method], db: f64) -> Result<Vec<Reached>> {
    let jobs: Vec<(&Method, &Named)> =
        methods.iter().flat_map(|method| motions.iter().map(move |named| (method, named))).collect();
    jobs.into_par_iter().map(|(method, named)| reach(method, named, db)).collect()
}

/// A clip and its PSNR.
struct Tried {
    bits: Option<u8>,
    psnr_db: f64,
    code_bytes: u64,
    bytes: u64,
}

/// The coarsest step in degrees.
const COARSEST: f64 = 64.0;

/// The finest step, as the number of halvings of the coarsest.
const HALVINGS: i32 = 14;

fn reach(method: &Method, named: &Named, db: f64) -> Result<Reached> {
    let (skeleton, motion) = (&named.clip.skeleton, &named.clip.motion);
    let encoder = Encoder::new(skeleton, motion).with_context(|| format!("cannot encode {}", named.name))?;
    let attempt = |quality: Quality| -> Result<Tried> {
        let bytes = encoder.encode(&method.encoding, quality)?;
        let decoded = decode(&bytes)?;
        let report = metrics::compare(skeleton, motion, &decoded, bytes.len() as u64)?;
        Ok(Tried {
            bits: if let Quality::Bits(bits) = quality { Some(bits) } else { None },
            psnr_db: report.psnr_db.unwrap_or(f64::INFINITY),
            code_bytes: code_bytes(&bytes)?,
            bytes: bytes.len() as u64,
        })
    };
    let (found, code_bytes_at) = if method.section.is_none() && method.encoding.has_free_steps() {
        by_steps(attempt, db)?
    } else {
        by_bits(attempt, db, method.encoding.most_bits())?
    };
    let raw_bytes = motion.samples.len() as u64 * 2;
    Ok(Reached {
        clip: named.name.clone(),
        method: method.name,
        bits: found.bits,
        psnr_db: found.psnr_db,
        code_bytes: found.code_bytes,
        code_bytes_at,
        bytes: found.bytes,
        raw_bytes,
        ratio: raw_bytes as f64 / found.code_bytes as f64,
        ratio_file: raw_bytes as f64 / found.bytes as f64,
        seconds: motion.frames() as f64 / motion.fps,
    })
}

/// The coarsest steps that have the PSNR: by half octaves, and then by the eighths that steps have.
fn by_steps(attempt: impl Fn(Quality) -> Result<Tried>, db: f64) -> Result<(Tried, f64)> {
    let at = |eighths: i32| attempt(Quality::Even(COARSEST * (-f64::from(eighths) / 8.0).exp2()));
    let mut coarse = 0;
    while coarse < 8 * HALVINGS && at(coarse)?.psnr_db < db {
        coarse += 4;
    }
    let mut fine = (coarse - 3).max(0);
    let mut found = at(fine)?;
    while found.psnr_db < db && fine < coarse {
        fine += 1;
        found = at(fine)?;
    }
    let bytes = found.code_bytes as f64;
    Ok((found, bytes))
}

/// The fewest bits that have the PSNR, and the bytes between them and a bit less where the PSNR is met.
fn by_bits(attempt: impl Fn(Quality) -> Result<Tried>, db: f64, most: u8) -> Result<(Tried, f64)> {
    let mut before: Option<Tried> = None;
    for bits in 1..most {
        let tried = attempt(Quality::Bits(bits))?;
        if tried.psnr_db >= db {
            let bytes = tried.code_bytes as f64;
            let at = before.map_or(bytes, |before| {
                let part = (db - before.psnr_db) / (tried.psnr_db - before.psnr_db);
                before.code_bytes as f64 + part * (bytes - before.code_bytes as f64)
            });
            return Ok((tried, at));
        }
        before = Some(tried);
    }
    let last = attempt(Quality::Bits(most))?;
    let bytes = last.code_bytes as f64;
    Ok((last, bytes))
}

/// Bytes of the blocks' codes, without their headers.
fn code_bytes(bytes: &[u8]) -> Result<u64> {
    let clip = Clip::parse(bytes, Limits::MAX)?;
    Ok((bytes.len() - clip.header_bytes() - clip.block_count() as usize * BLOCK_HEADER_BYTES) as u64)
}

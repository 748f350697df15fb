//! The golden vectors of mclip, and both ways to decode them.

use crate::vectors::{LIMITS, Vector, hex, listed};
use decoder_core::mclip::{Clip, Memory, Needs, Receiver, State, Stream};
use decoder_core::predict::Correlation;
use decoder_core::{Error, I16F16, Limits};
use sha2::{Digest, Sha256};

/// The list of vectors.
pub const LIST: &str = "SHA256SUMS.mclip";

/// The golden vectors.
///
/// # Panics
/// Where one cannot be read.
pub fn all() -> Vec<Vector> {
    listed(LIST)
}

/// What decoders of the vectors, and of damaged ones, may hold.
pub const MCLIP_LIMITS: Limits = Limits { frames: 20_000, ..LIMITS };

/// Memory for a decoder.
pub struct Lent {
    pose: Vec<I16F16>,
    states: Vec<State>,
    correlations: Vec<Correlation>,
    words: Vec<u16>,
}

impl Lent {
    /// As much as a clip needs.
    pub fn new(needs: Needs) -> Self {
        Self {
            pose: vec![I16F16::ZERO; needs.channels],
            states: vec![State::EMPTY; needs.channels],
            correlations: vec![Correlation::EMPTY; needs.correlations],
            words: vec![0; needs.words],
        }
    }

    /// The memory as a decoder takes it.
    pub fn memory(&mut self) -> Memory<'_> {
        Memory {
            pose: &mut self.pose,
            states: &mut self.states,
            correlations: &mut self.correlations,
            words: &mut self.words,
        }
    }
}

/// SHA-256 of a clip's frames, decoded in place.
///
/// # Errors
/// Where the clip, or a block of it, is refused.
pub fn sha256_in_place(bytes: &[u8]) -> Result<String, Error> {
    let clip = Clip::parse(bytes, MCLIP_LIMITS)?;
    let mut lent = Lent::new(clip.header().needs());
    let mut decoder = clip.decoder(lent.memory())?;
    let mut sha = Sha256::new();
    while let Some(pose) = decoder.next_frame()? {
        pose.iter().for_each(|value| sha.update(value.to_bits().to_le_bytes()));
    }
    Ok(hex(sha))
}

/// SHA-256 of a clip's frames, decoded from chunks of `size` bytes.
///
/// # Errors
/// Where the clip, or a block of it, is refused.
pub fn sha256_of_stream(bytes: &[u8], size: usize) -> Result<String, Error> {
    let mut chunks = bytes.chunks(size);
    let mut chunk: &[u8] = &[];
    let mut buffer = vec![0; bytes.len()];
    let mut receiver = Receiver::new(&mut buffer);
    while !receiver.receive(&mut chunk)? {
        match chunks.next() {
            Some(next) => chunk = next,
            None => break,
        }
    }
    let header = receiver.finish(MCLIP_LIMITS)?;
    let mut lent = Lent::new(header.needs());
    let mut block = vec![0; usize::from(header.opening().block_bytes).max(12)];
    let mut stream = Stream::new(header, lent.memory(), &mut block)?;
    let mut sha = Sha256::new();
    loop {
        while let Some(pose) = stream.next_frame(&mut chunk)? {
            pose.iter().for_each(|value| sha.update(value.to_bits().to_le_bytes()));
        }
        match chunks.next() {
            Some(next) => chunk = next,
            None => break,
        }
    }
    stream.finish()?;
    Ok(hex(sha))
}

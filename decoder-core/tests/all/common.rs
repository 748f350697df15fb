//! The golden vectors, and memory for decoders.

use decoder_core::mclip::{BLOCK_HEADER_BYTES, Header, Memory, Needs, Prefix, State};
use decoder_core::predict::Correlation;
use decoder_core::{I16F16, Limits};
use std::fs;
use std::path::Path;

/// More than any vector has.
pub const LIMITS: Limits = Limits { channels: 300, frames: 20_000 };

pub struct Vector {
    pub name: String,
    pub bytes: Vec<u8>,
    /// SHA-256 of the frames' words, little-endian, in hexadecimal digits.
    pub sha256: String,
}

/// The vectors that a list of hashes names. Miri leaves out those of more than 1.5 KB, which take it minutes.
pub fn vectors(list: &str) -> Vec<Vector> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/vectors/v1");
    let sums = fs::read_to_string(folder.join(list)).unwrap();
    let vectors = sums.lines().map(|line| {
        let (sha256, name) = line.split_once("  ").unwrap();
        let bytes = fs::read(folder.join(name)).unwrap();
        Vector { name: name.to_owned(), bytes, sha256: sha256.to_owned() }
    });
    vectors.filter(|vector| !cfg!(miri) || vector.bytes.len() < 1500).collect()
}

/// Memory for a decoder of mclip.
pub struct Lent {
    pose: Vec<I16F16>,
    states: Vec<State>,
    correlations: Vec<Correlation>,
    words: Vec<u16>,
}

impl Lent {
    /// Exactly what is needed, with something in it.
    pub fn new(needs: Needs) -> Self {
        Self {
            pose: vec![I16F16::MAX; needs.channels],
            states: vec![State::EMPTY; needs.channels],
            correlations: vec![Correlation::EMPTY; needs.correlations],
            words: vec![0xa5a5; needs.words],
        }
    }

    pub fn memory(&mut self) -> Memory<'_> {
        let Self { pose, states, correlations, words } = self;
        Memory { pose, states, correlations, words }
    }

    /// Takes an element off one of the four, in the order of [`Memory`].
    pub fn shrink(&mut self, part: usize) {
        match part {
            0 => drop(self.pose.pop()),
            1 => drop(self.states.pop()),
            2 => drop(self.correlations.pop()),
            _ => drop(self.words.pop()),
        }
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&*self.pose)
            + size_of_val(&*self.states)
            + size_of_val(&*self.correlations)
            + size_of_val(&*self.words)
    }
}

/// A buffer for the longest block of a clip.
pub fn block_buffer(header: &Header<'_>) -> Vec<u8> {
    vec![0; usize::from(header.opening().block_bytes).max(BLOCK_HEADER_BYTES)]
}

/// Bytes before a clip's first block.
pub fn header_bytes(bytes: &[u8]) -> usize {
    Prefix::read(bytes).unwrap().header_bytes
}

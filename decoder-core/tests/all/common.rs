//! The golden vectors, and memory for decoders.

use decoder_core::mclip::{BLOCK_HEADER_BYTES, Header, Memory, Needs, Prefix, State};
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

/// Memory for a decoder of mclip, from the heap.
pub struct Heap {
    pose: Vec<I16F16>,
    states: Vec<State>,
    words: Vec<u32>,
    halves: Vec<u16>,
}

impl Heap {
    /// Exactly what is needed, with something in it.
    pub fn new(needs: Needs) -> Self {
        Self {
            pose: vec![I16F16::MAX; needs.channels],
            states: vec![State::EMPTY; needs.channels],
            words: vec![0xa5a5_a5a5; needs.words],
            halves: vec![0xa5a5; needs.halves],
        }
    }

    pub fn memory(&mut self) -> Memory<'_> {
        let Self { pose, states, words, halves } = self;
        Memory { pose, states, words, halves }
    }

    /// Takes an element off one of the four, in the order of [`Memory`].
    pub fn shrink(&mut self, part: usize) {
        match part {
            0 => drop(self.pose.pop()),
            1 => drop(self.states.pop()),
            2 => drop(self.words.pop()),
            _ => drop(self.halves.pop()),
        }
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&*self.pose)
            + size_of_val(&*self.states)
            + size_of_val(&*self.words)
            + size_of_val(&*self.halves)
    }
}

/// A buffer for the longest block of a clip.
pub fn block_buffer(header: &Header<'_>) -> Vec<u8> {
    vec![0; usize::from(header.fields().block_bytes).max(BLOCK_HEADER_BYTES)]
}

/// Bytes before a clip's first block.
pub fn header_bytes(bytes: &[u8]) -> usize {
    Prefix::read(bytes).unwrap().header_bytes
}

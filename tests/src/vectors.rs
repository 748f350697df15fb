//! The golden vectors of `tests/vectors`.

use crate::workspace;
use sha2::{Digest, Sha256};
use std::fs;
use std::path::PathBuf;

/// A small clip, and the hash of the frames in it.
pub struct Vector {
    /// Name of its file.
    pub name: String,
    /// The clip.
    pub bytes: Vec<u8>,
    /// SHA-256 of its frames: channel words, little-endian, frame by frame; as hexadecimal digits.
    pub sha256: String,
}

/// The folder of the vectors.
pub fn folder() -> PathBuf {
    workspace().join("tests/vectors")
}

/// All vectors that SHA256SUMS lists.
///
/// # Panics
/// Where one cannot be read.
pub fn all() -> Vec<Vector> {
    let sums =
        fs::read_to_string(folder().join("SHA256SUMS")).unwrap_or_else(|error| panic!("SHA256SUMS: {error}"));
    let vectors: Vec<Vector> = sums
        .lines()
        .filter_map(|line| line.split_once("  "))
        .map(|(sha256, name)| Vector {
            name: name.to_owned(),
            bytes: fs::read(folder().join(name)).unwrap_or_else(|error| panic!("{name}: {error}")),
            sha256: sha256.to_owned(),
        })
        .collect();
    assert!(!vectors.is_empty(), "SHA256SUMS lists no vectors");
    vectors
}

/// A finished hash as hexadecimal digits.
pub fn hex(sha: Sha256) -> String {
    sha.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

//! The golden vectors of `tests/vectors`.

use crate::{motion, workspace};
use decoder_core::qmd::Clip;
use decoder_core::{Error, I16F16, Limits};
use encoder::qmd::{self, Method, Parameters};
use mocap::{import, sample};
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

/// The folder of the vectors of version 1, which decode for ever to the frames that they decode to now.
pub fn folder() -> PathBuf {
    workspace().join("tests/vectors/v1")
}

/// All vectors that SHA256SUMS lists.
///
/// # Panics
/// Where one cannot be read.
pub fn all() -> Vec<Vector> {
    listed("SHA256SUMS")
}

/// All vectors that a list of hashes in the folder names.
///
/// # Panics
/// Where one cannot be read.
pub fn listed(list: &str) -> Vec<Vector> {
    let sums = fs::read_to_string(folder().join(list)).unwrap_or_else(|error| panic!("{list}: {error}"));
    let vectors: Vec<Vector> = sums
        .lines()
        .filter_map(|line| line.split_once("  "))
        .map(|(sha256, name)| Vector {
            name: name.to_owned(),
            bytes: fs::read(folder().join(name)).unwrap_or_else(|error| panic!("{name}: {error}")),
            sha256: sha256.to_owned(),
        })
        .collect();
    assert!(!vectors.is_empty(), "{list} lists no vectors");
    vectors
}

/// The trials of the QMD paper's Table 1 (subject, trial).
const TRIALS: [(&str, &str); 6] =
    [("16", "16_46"), ("49", "49_04"), ("02", "02_02"), ("02", "02_01"), ("05", "05_03"), ("02", "02_07")];

/// The golden vectors, and with them clips that our encoder makes and hashes of what this machine decodes: the
/// embedded sample, and the six trials where they are there.
///
/// # Panics
/// Where one cannot be read or encoded.
pub fn with_trials() -> Vec<Vector> {
    let mut vectors = all();
    let mut add = |name: &str, clip: &mocap::Clip| {
        let bytes = qmd::encode(clip, Parameters::TABLE_1, Method::ClosedLoop)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        let sha256 = sha256_of_frames(&bytes, true).unwrap_or_else(|error| panic!("{name}: {error}"));
        vectors.push(Vector { name: name.to_owned(), bytes, sha256 });
    };
    add("sample", &sample::clip());
    if let Some(motion) = motion() {
        for (subject, trial) in TRIALS {
            let file = |name: &str, kind| motion.join("cmu").join(name).with_extension(kind);
            let clip = import::load(&file(trial, "amc"), Some(&file(subject, "asf")), None);
            add(trial, &clip.unwrap_or_else(|error| panic!("{error}")));
        }
    }
    vectors
}

/// More than any clip here has, and little enough that a damaged one ends soon.
pub const LIMITS: Limits = Limits { channels: 300, frames: 10_000 };

/// SHA-256 of a clip's frames, decoded in memory; `lend` says whether the decoder gets memory for its table.
///
/// # Errors
/// Where the clip is refused.
pub fn sha256_of_frames(bytes: &[u8], lend: bool) -> Result<String, Error> {
    let clip = Clip::parse(bytes, LIMITS)?;
    let mut pose = vec![I16F16::ZERO; clip.channels()];
    let mut table = vec![0; clip.table_len()];
    let mut decoder = clip.decoder(&mut pose, lend.then_some(table.as_mut_slice()))?;
    let mut sha = Sha256::new();
    while let Some(pose) = decoder.next_frame() {
        pose.iter().for_each(|value| sha.update(value.to_bits().to_le_bytes()));
    }
    Ok(hex(sha))
}

/// A finished hash as hexadecimal digits.
pub fn hex(sha: Sha256) -> String {
    sha.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

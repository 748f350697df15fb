//! What can be wrong with a file.

use std::io;

/// What is wrong with a file; its text is one sentence that names the file and the line.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The file cannot be read.
    #[error("cannot read {file}: {error}")]
    Read {
        /// Path of the file.
        file: String,
        /// What the operating system says.
        error: io::Error,
    },
    /// The file as a whole is not what it should be.
    #[error("{file}: found {found}, expected {expected}")]
    File {
        /// Path of the file.
        file: String,
        /// What it holds.
        found: String,
        /// What it should hold.
        expected: String,
    },
    /// One line is not what it should be.
    #[error("{file}, line {line}: found {found}, expected {expected}")]
    Line {
        /// Path of the file.
        file: String,
        /// Number of the line, from 1.
        line: usize,
        /// What it holds.
        found: String,
        /// What it should hold.
        expected: String,
    },
    /// An AMC file came without its skeleton.
    #[error("{file}: found no skeleton for this AMC file, expected its ASF file (--skeleton NAME.asf)")]
    NoSkeleton {
        /// Path of the AMC file.
        file: String,
    },
    /// The caller's frame rate makes no sense.
    #[error("{file}: found a frame rate of {fps}, expected more than 0 frames per second")]
    Rate {
        /// Path of the file.
        file: String,
        /// The rate that was given.
        fps: f64,
    },
}

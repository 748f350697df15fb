//! Why a motion cannot be written.

use std::io;

use crate::motion::Motion;
use crate::skeleton::Skeleton;

/// Why a motion cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The output does not take it.
    #[error("cannot write: {0}")]
    Write(#[from] io::Error),
    /// The motion has another number of channels than the skeleton.
    #[error("the motion has {found} channels, expected {expected} as in the skeleton")]
    Channels {
        /// The motion's.
        found: usize,
        /// The skeleton's.
        expected: usize,
    },
    /// The format cannot hold it.
    #[error("{format} cannot hold {what}, expected {expected}")]
    Unsupported {
        /// Name of the format.
        format: &'static str,
        /// What it cannot hold.
        what: String,
        /// What it can.
        expected: &'static str,
    },
}

/// Fails unless the motion has the skeleton's channels.
pub(super) fn check_channels(skeleton: &Skeleton, motion: &Motion) -> Result<(), ExportError> {
    let (found, expected) = (motion.channels, skeleton.channels.len());
    if found == expected { Ok(()) } else { Err(ExportError::Channels { found, expected }) }
}

//! Export of motions: AMC, BVH and CSV.
//!
//! Functions write to any [`Write`]; it is the caller who makes files, writes them under a temporary name and
//! renames them.

use std::io::{self, Write};

pub mod amc;
pub mod bvh;
pub mod csv;

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

fn check_channels(skeleton: &crate::Skeleton, motion: &crate::Motion) -> Result<(), ExportError> {
    let (found, expected) = (motion.channels, skeleton.channels.len());
    if found == expected { Ok(()) } else { Err(ExportError::Channels { found, expected }) }
}

/// Writes the shortest number that rounds to the same 15 significant digits: every decimal number of up to
/// 15 digits that was read and scaled comes back as it was.
fn write_number(out: &mut impl Write, value: f64) -> io::Result<()> {
    let shortest = format!("{value:e}");
    let digits = shortest.bytes().take_while(|byte| *byte != b'e').filter(u8::is_ascii_digit).count();
    let value = if digits <= 15 { value } else { format!("{value:.14e}").parse().unwrap_or(value) };
    if value == 0.0 || (1e-5..1e15).contains(&value.abs()) {
        write!(out, "{value}")
    } else {
        write!(out, "{value:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(value: f64) -> String {
        let mut out = Vec::new();
        write_number(&mut out, value).expect("a Vec takes it");
        String::from_utf8(out).expect("digits")
    }

    #[test]
    fn decimals_survive_scaling() {
        let unit = 2.54 / 0.45;
        for printed in ["12.7274", "-2.88238e-15", "0", "-91.3333", "0.00001", "123456789.012345"] {
            let value: f64 = printed.parse().expect("a number");
            assert_eq!(text(value * unit / unit), printed);
        }
    }
}

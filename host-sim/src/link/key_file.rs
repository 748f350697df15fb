//! The key of a line, in a file: what is said on a command line is for all to see.

use crate::files;
use anyhow::{Result, anyhow};
use firmware::link::key::{HmacKey, KEY_BYTES};
use std::path::Path;

/// Reads a key: all bytes of the file, without a line's end behind them.
///
/// # Errors
/// A sentence where the file cannot be read, or has too few or too many bytes.
pub fn read(path: &Path) -> Result<HmacKey> {
    let bytes = files::read(path)?;
    let mut key = bytes.as_slice();
    while let Some((b'\n' | b'\r', rest)) = key.split_last() {
        key = rest;
    }
    HmacKey::new(key).ok_or_else(|| {
        anyhow!(
            "{}: the key has {} bytes, expected {} to {}: make one with `openssl rand -hex 32 > {}`",
            path.display(),
            key.len(),
            KEY_BYTES.start(),
            KEY_BYTES.end(),
            path.display()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_end_is_no_part_of_a_key() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("key");
        for (bytes, is_one) in [
            (&b"0123456789abcdef"[..], true),
            (b"0123456789abcdef\r\n", true),
            (b"0123456789abcde\n", false),
            (&[b'k'; 65], false),
            (b"", false),
        ] {
            std::fs::write(&path, bytes).unwrap();
            let key = read(&path);
            assert_eq!(key.is_ok(), is_one, "{bytes:?}");
            if let Err(error) = key {
                assert!(error.to_string().contains(", expected 16 to 64: make one with"), "{error}");
            }
        }
        assert!(read(&folder.path().join("none")).is_err());
    }
}

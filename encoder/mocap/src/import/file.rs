//! The bytes of a file, as far as a file of this kind may go.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Most bytes of a file that is read whole: ten times as many as an hour of sixty joints takes as text.
pub const MOST_BYTES: u64 = 1 << 30;

/// Reads a whole file, which has an end: a device or a pipe may have none.
///
/// # Errors
/// What the system says, or that the file has more than [`MOST_BYTES`].
///
/// ```
/// let error = mocap::import::read_bytes(std::path::Path::new("not/there.bvh")).unwrap_err();
/// assert_eq!(error.kind(), std::io::ErrorKind::NotFound);
/// ```
pub fn read_bytes(path: &Path) -> io::Result<Vec<u8>> {
    read_most(path, MOST_BYTES)
}

fn read_most(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let too_long =
        || io::Error::other(format!("it has more than {most} bytes, the most that is read of a file"));
    if file.metadata()?.len() > most {
        return Err(too_long());
    }
    let mut bytes = Vec::new();
    let read = file.take(most + 1).read_to_end(&mut bytes)?;
    if read as u64 > most { Err(too_long()) } else { Ok(bytes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_without_an_end_is_refused() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
        let bytes = read_bytes(Path::new(file)).unwrap();
        let len = bytes.len() as u64;
        assert_eq!(read_most(Path::new(file), len).unwrap(), bytes);
        let error = read_most(Path::new(file), len - 1).unwrap_err().to_string();
        assert!(error.contains(&format!("more than {} bytes", len - 1)), "{error}");
        if cfg!(unix) {
            assert!(read_most(Path::new("/dev/zero"), 1000).is_err());
        }
    }
}

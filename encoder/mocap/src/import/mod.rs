//! Import of motion capture: ASF/AMC (Acclaim) and BVH (Biovision).

use std::fs;
use std::path::Path;

use crate::clip::Clip;
use crate::skeleton::Skeleton;

pub mod amc;
pub mod asf;
pub mod bvh;
mod error;
#[cfg(test)]
mod malformed;
mod text;

pub use error::ImportError;

/// Reads a clip from an AMC or BVH file; lengths become centimetres and angles degrees.
///
/// The kind is chosen by the extension, else by the first line. `skeleton` is the ASF file that an AMC file
/// needs (for BVH it is not read). `fps` overrides the file's frame rate; without it an AMC file that names
/// none has [`amc::DEFAULT_FPS`].
///
/// # Errors
/// A file that cannot be read or is malformed, an AMC file without skeleton, a rate that is not above 0.
pub fn load(path: &Path, skeleton: Option<&Path>, fps: Option<f64>) -> Result<Clip, ImportError> {
    let file = path.display().to_string();
    if let Some(fps) = fps
        && !(fps.is_finite() && fps > 0.0)
    {
        return Err(ImportError::Rate { file, fps });
    }
    let bytes = read(path)?;
    match kind(path, &bytes) {
        Some(Kind::Bvh) => {
            let (skeleton, motion) = bvh::parse(&bytes, &file, 1.0, fps)?;
            Ok(Clip { skeleton, motion })
        }
        Some(Kind::Amc) => {
            text::check(&bytes, &file, "an AMC file")?;
            let Some(skeleton) = skeleton else { return Err(ImportError::NoSkeleton { file }) };
            let skeleton = load_skeleton(skeleton)?;
            let motion = amc::parse(&bytes, &file, &skeleton, fps)?;
            Ok(Clip { skeleton, motion })
        }
        None => {
            let expected = "an AMC or BVH file";
            text::check(&bytes, &file, expected)?;
            let found = if has_extension(path, "asf") { "a skeleton (ASF)" } else { "something else" };
            Err(ImportError::File { file, found: found.to_string(), expected: expected.to_string() })
        }
    }
}

/// Reads a skeleton from an ASF file, or from a BVH file's hierarchy (by its extension).
///
/// # Errors
/// A file that cannot be read or is malformed.
pub fn load_skeleton(path: &Path) -> Result<Skeleton, ImportError> {
    let file = path.display().to_string();
    let bytes = read(path)?;
    if has_extension(path, "bvh") {
        bvh::parse(&bytes, &file, 1.0, None).map(|(skeleton, _)| skeleton)
    } else {
        asf::parse(&bytes, &file)
    }
}

fn read(path: &Path) -> Result<Vec<u8>, ImportError> {
    fs::read(path).map_err(|error| ImportError::Read { file: path.display().to_string(), error })
}

enum Kind {
    Amc,
    Bvh,
}

fn kind(path: &Path, bytes: &[u8]) -> Option<Kind> {
    if has_extension(path, "amc") {
        Some(Kind::Amc)
    } else if has_extension(path, "bvh") {
        Some(Kind::Bvh)
    } else if has_extension(path, "asf") {
        None
    } else {
        let start = bytes.trim_ascii_start();
        let is = |word: &[u8]| start.get(..word.len()).is_some_and(|text| text.eq_ignore_ascii_case(word));
        if is(b"HIERARCHY") {
            Some(Kind::Bvh)
        } else if is(b"#!OML") || is(b":FULLY-SPECIFIED") {
            Some(Kind::Amc)
        } else {
            None
        }
    }
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
}

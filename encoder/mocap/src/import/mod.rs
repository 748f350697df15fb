//! Import of motion capture: ASF/AMC (Acclaim), BVH (Biovision), tables (CSV), glTF, and moves as JSON.

use std::path::Path;

use crate::clip::Clip;
use crate::skeleton::Skeleton;

pub mod amc;
pub mod asf;
mod bones;
pub mod bvh;
pub mod csv;
mod error;
mod file;
pub mod glb;
mod imported;
pub mod json;
#[cfg(test)]
mod malformed;
mod names;
mod options;
mod rate;
mod text;
mod timed;
pub mod unit;
mod values;

pub use error::ImportError;
pub use file::{MOST_BYTES, read_bytes};
pub use imported::Imported;
pub use options::Options;
pub use unit::Unit;
pub use values::{GOAL, Values};

/// Reads a clip from an AMC or BVH file, without a word about what had to be guessed: [`read`] has it.
///
/// # Errors
/// Those of [`read`].
pub fn load(path: &Path, skeleton: Option<&Path>, fps: Option<f64>) -> Result<Clip, ImportError> {
    Ok(read(path, &Options { skeleton, fps, ..Options::default() })?.clip)
}

/// Reads a clip from an AMC, BVH, CSV, GLB or JSON file; lengths become centimetres and angles degrees.
///
/// The kind is chosen by the extension, else by the first line. An AMC file that names no rate has
/// [`amc::DEFAULT_FPS`] unless the options say.
///
/// # Errors
/// A file that cannot be read or is malformed, an AMC file without skeleton, a rate that is not above 0.
pub fn read(path: &Path, options: &Options) -> Result<Imported, ImportError> {
    let file = path.display().to_string();
    if let Some(fps) = options.fps
        && !(fps.is_finite() && fps > 0.0)
    {
        return Err(ImportError::Rate { file, fps });
    }
    let bytes = bytes_of(path)?;
    match kind(path, &bytes) {
        Some(Kind::Bvh) => read_bvh(&bytes, &file, options),
        Some(Kind::Csv) => csv::parse(&bytes, &file, options),
        Some(Kind::Glb) => {
            let mut imported = glb::parse(&bytes, &file, path.parent(), options.fps.or(options.sampled_fps))?;
            // The format says metres; who knows better may say so.
            if let Some(unit) = &options.unit {
                unit::scale(&mut imported.clip, unit.cm / 100.0);
            }
            Ok(imported)
        }
        Some(Kind::Json) => json::parse(&bytes, &file, options),
        Some(Kind::Amc) => {
            text::check(&bytes, &file, "an AMC file")?;
            let Some(skeleton) = options.skeleton else { return Err(ImportError::NoSkeleton { file }) };
            let skeleton = load_skeleton(skeleton)?;
            let (motion, own_rate) = amc::read(&bytes, &file, &skeleton, options.fps)?;
            let has_rate = own_rate || options.fps.is_some();
            Ok(Imported { clip: Clip { skeleton, motion }, has_rate, notes: Vec::new() })
        }
        None => {
            let expected = "an AMC, BVH, CSV, GLB or JSON file";
            text::check(&bytes, &file, expected)?;
            let found = if has_extension(path, "asf") { "a skeleton (ASF)" } else { "something else" };
            Err(ImportError::File { file, found: found.to_string(), expected: expected.to_string() })
        }
    }
}

fn read_bvh(bytes: &[u8], file: &str, options: &Options) -> Result<Imported, ImportError> {
    let (mut imported, root) = bvh::read(bytes, file, options.fps)?;
    let cm = match &options.unit {
        Some(unit) => unit.cm,
        None => {
            let guess = unit::guess(&imported.clip, root);
            imported.notes.push(guess.tell());
            guess.unit.cm
        }
    };
    unit::scale(&mut imported.clip, cm);
    Ok(imported)
}

/// Reads a skeleton from an ASF file, or from a BVH file's hierarchy (by its extension), whose unit is guessed.
///
/// # Errors
/// A file that cannot be read or is malformed.
pub fn load_skeleton(path: &Path) -> Result<Skeleton, ImportError> {
    read_skeleton(path, None)
}

/// As [`load_skeleton`], with the unit of a BVH file where the caller knows it.
///
/// # Errors
/// Those of [`load_skeleton`].
pub fn read_skeleton(path: &Path, unit: Option<Unit>) -> Result<Skeleton, ImportError> {
    let file = path.display().to_string();
    let bytes = bytes_of(path)?;
    match kind(path, &bytes) {
        Some(Kind::Bvh) => {
            let options = Options { unit, ..Options::default() };
            Ok(read_bvh(&bytes, &file, &options)?.clip.skeleton)
        }
        Some(Kind::Glb | Kind::Csv | Kind::Json) => Ok(read(path, &Options::default())?.clip.skeleton),
        Some(Kind::Amc) | None => asf::parse(&bytes, &file),
    }
}

fn bytes_of(path: &Path) -> Result<Vec<u8>, ImportError> {
    read_bytes(path).map_err(|error| ImportError::Read { file: path.display().to_string(), error })
}

enum Kind {
    Amc,
    Bvh,
    Csv,
    Glb,
    Json,
}

fn kind(path: &Path, bytes: &[u8]) -> Option<Kind> {
    if has_extension(path, "amc") {
        Some(Kind::Amc)
    } else if has_extension(path, "bvh") {
        Some(Kind::Bvh)
    } else if has_extension(path, "csv") {
        Some(Kind::Csv)
    } else if has_extension(path, "glb") || has_extension(path, "gltf") || bytes.starts_with(b"glTF") {
        Some(Kind::Glb)
    } else if has_extension(path, "json") {
        Some(Kind::Json)
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

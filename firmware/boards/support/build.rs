//! Puts the clip and the joint map into the image.
//!
//! - `BUNRAKU_CLIP`: path of a .qmd or .mclip, absolute or from this folder
//! - `BUNRAKU_MAP`: path of a joint map as postcard bytes (`bunraku image` makes it from a puppet.toml)
//! - `BUNRAKU_CENTIHERTZ`: the rate to play at instead of the clip's own, in hundredths of a hertz
//!
//! Without the first two the image plays the embedded sample on puppets/sample.toml.

use decoder_core::{Limits, mclip, qmd};
use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let (clip, map) = match (path("BUNRAKU_CLIP"), path("BUNRAKU_MAP")) {
        (Some(clip), Some(map)) => (read(&clip), read(&map)),
        (None, None) => sample(),
        _ => panic!("set both BUNRAKU_CLIP and BUNRAKU_MAP, or neither"),
    };
    println!("cargo:rustc-check-cfg=cfg(mclip)");
    let sizes = if clip.starts_with(&mclip::MAGIC) {
        println!("cargo:rustc-cfg=mclip");
        mclip_sizes(&clip)
    } else {
        qmd_sizes(&clip)
    };
    for (name, bytes) in [("clip", clip), ("map.postcard", map), ("sizes.rs", sizes.into_bytes())] {
        fs::write(out.join(name), bytes).unwrap_or_else(|error| panic!("cannot write {name}: {error}"));
    }
    println!("cargo:rerun-if-env-changed=BUNRAKU_CENTIHERTZ");
    let centihertz = env::var("BUNRAKU_CENTIHERTZ").unwrap_or_else(|_| "0".to_owned());
    println!("cargo:rustc-env=BUNRAKU_CENTIHERTZ={centihertz}");
}

/// How much memory the decoder of a .mclip needs.
fn mclip_sizes(clip: &[u8]) -> String {
    let clip = mclip::Clip::parse(clip, Limits::MAX).unwrap_or_else(|error| panic!("BUNRAKU_CLIP: {error}"));
    let needs = clip.header().needs();
    sizes(&[("CHANNELS", needs.channels), ("WORDS", needs.words), ("HALVES", needs.halves)])
}

/// How much memory the decoder of a .qmd is lent: none for a table longer than 256 values, which is read in place.
fn qmd_sizes(clip: &[u8]) -> String {
    let clip = qmd::Clip::parse(clip, Limits::MAX).unwrap_or_else(|error| panic!("BUNRAKU_CLIP: {error}"));
    let table = if clip.table_len() <= 256 { clip.table_len() } else { 0 };
    sizes(&[("CHANNELS", clip.channels()), ("TABLE", table)])
}

fn sizes(sizes: &[(&str, usize)]) -> String {
    let lines = sizes
        .iter()
        .map(|(name, size)| format!("/// Elements that the decoder needs.\nconst {name}: usize = {size};\n"));
    lines.collect()
}

fn path(variable: &str) -> Option<PathBuf> {
    println!("cargo:rerun-if-env-changed={variable}");
    env::var_os(variable).map(PathBuf::from)
}

fn read(path: &Path) -> Vec<u8> {
    println!("cargo:rerun-if-changed={}", path.display());
    fs::read(path).unwrap_or_else(|error| panic!("cannot read {}: {error}", path.display()))
}

/// The embedded clip and its puppet.
#[cfg(feature = "sample")]
fn sample() -> (Vec<u8>, Vec<u8>) {
    use encoder::qmd::{Method, Parameters, encode};
    use puppet_file::Puppet;

    let clip = mocap::sample::clip();
    let bytes = encode(&clip, Parameters::TABLE_1, Method::ClosedLoop).expect("the sample fits the format");
    let puppet = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../puppets/sample.toml");
    println!("cargo:rerun-if-changed={}", puppet.display());
    let map = Puppet::read(&puppet).and_then(|puppet| puppet.map_bytes(&clip.skeleton));
    (bytes, map.unwrap_or_else(|error| panic!("{error:#}")))
}

#[cfg(not(feature = "sample"))]
fn sample() -> (Vec<u8>, Vec<u8>) {
    panic!("without the feature `sample`, BUNRAKU_CLIP and BUNRAKU_MAP must be set");
}

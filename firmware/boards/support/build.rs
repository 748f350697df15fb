//! Puts the clip and the joint map into the image.
//!
//! - `BUNRAKU_CLIP`: path of a .qmd or .mclip, absolute or from this folder
//! - `BUNRAKU_MAP`: path of a joint map, the bytes of docs/MAP.md (`bunraku image` makes it from a puppet.toml)
//! - `BUNRAKU_CENTIHERTZ`: the rate to play at instead of the clip's own, in hundredths of a hertz
//!
//! Without the first two the image plays the embedded sample on puppets/sample.toml.

#[path = "../clip_sizes.rs"]
mod clip_sizes;

use clip_sizes::{Sizes, constants};
use decoder_core::mclip;
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
    if clip.starts_with(&mclip::MAGIC) {
        println!("cargo:rustc-cfg=mclip");
    }
    let sizes = sizes(&clip);
    for (name, bytes) in [("clip", clip), ("map.postcard", map), ("sizes.rs", sizes.into_bytes())] {
        fs::write(out.join(name), bytes).unwrap_or_else(|error| panic!("cannot write {name}: {error}"));
    }
    println!("cargo:rerun-if-env-changed=BUNRAKU_CENTIHERTZ");
    let centihertz = env::var("BUNRAKU_CENTIHERTZ").unwrap_or_else(|_| "0".to_owned());
    println!("cargo:rustc-env=BUNRAKU_CENTIHERTZ={centihertz}");
}

/// The constants of a clip's decoder. A table of a .qmd that is longer than 256 values is read in place.
fn sizes(clip: &[u8]) -> String {
    let Sizes { channels, words, halves, table } = Sizes::of("BUNRAKU_CLIP", clip);
    if clip.starts_with(&mclip::MAGIC) {
        constants(&[("CHANNELS", channels), ("WORDS", words), ("HALVES", halves)])
    } else {
        constants(&[("CHANNELS", channels), ("TABLE", if table <= 256 { table } else { 0 })])
    }
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

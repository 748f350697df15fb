//! Puts the clip and the joint map into the image, and names the linker scripts.
//!
//! - `BUNRAKU_CLIP`: path of a .qmd or .mclip, absolute or from this folder
//! - `BUNRAKU_MAP`: path of a joint map as postcard bytes (`bunraku play --on qemu` makes it from a puppet.toml)
//! - `BUNRAKU_CENTIHERTZ`: the rate to play at instead of the clip's own, in hundredths of a hertz
//!
//! Without the first two the image plays the embedded sample on puppets/sample.toml.

use decoder_core::{Limits, mclip};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// The top of the workspace.
const WORKSPACE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../..");

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let (clip, map) = match (path("BUNRAKU_CLIP"), path("BUNRAKU_MAP")) {
        (Some(clip), Some(map)) => (read(&clip), read(&map)),
        (None, None) => sample(),
        _ => panic!("set both BUNRAKU_CLIP and BUNRAKU_MAP, or neither"),
    };
    println!("cargo:rustc-check-cfg=cfg(mclip)");
    let mut sizes = String::new();
    if clip.starts_with(&mclip::MAGIC) {
        println!("cargo:rustc-cfg=mclip");
        sizes = self::sizes(&clip);
    }
    for (name, bytes) in [("clip", clip), ("map.postcard", map), ("sizes.rs", sizes.into_bytes())] {
        fs::write(out.join(name), bytes).unwrap_or_else(|error| panic!("cannot write {name}: {error}"));
    }
    println!("cargo:rerun-if-env-changed=BUNRAKU_CENTIHERTZ");
    let centihertz = env::var("BUNRAKU_CENTIHERTZ").unwrap_or_else(|_| "0".to_owned());
    println!("cargo:rustc-env=BUNRAKU_CENTIHERTZ={centihertz}");

    // The map of this board's memory, memory.x, is at the top of the workspace.
    println!("cargo:rustc-link-search={WORKSPACE}");
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}

/// How much memory the decoder of a .mclip needs.
fn sizes(clip: &[u8]) -> String {
    let clip = mclip::Clip::parse(clip, Limits::MAX).unwrap_or_else(|error| panic!("BUNRAKU_CLIP: {error}"));
    let needs = clip.header().needs();
    [("CHANNELS", needs.channels), ("CORRELATIONS", needs.correlations), ("WORDS", needs.words)]
        .map(|(name, size)| format!("/// Elements that the decoder needs.\nconst {name}: usize = {size};\n"))
        .concat()
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
    use host_sim::puppet::Puppet;

    let clip = encoder::sample::clip();
    let bytes = encode(&clip, Parameters::TABLE_1, Method::ClosedLoop).expect("the sample fits the format");
    let puppet = Path::new(WORKSPACE).join("puppets/sample.toml");
    println!("cargo:rerun-if-changed={}", puppet.display());
    let map = Puppet::read(&puppet).and_then(|puppet| puppet.map_bytes(&clip.skeleton));
    (bytes, map.unwrap_or_else(|error| panic!("{error:#}")))
}

#[cfg(not(feature = "sample"))]
fn sample() -> (Vec<u8>, Vec<u8>) {
    panic!("without the feature `sample`, BUNRAKU_CLIP and BUNRAKU_MAP must be set");
}

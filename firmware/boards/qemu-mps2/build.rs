//! Puts the clip and the joint map into the image, and names the linker scripts.
//!
//! - `BUNRAKU_CLIP`: path of a .qmd
//! - `BUNRAKU_MAP`: path of a joint map as postcard bytes (`bunraku play` makes it from a puppet.toml)
//! - `BUNRAKU_CENTIHERTZ`: the rate to play at instead of the clip's own, in hundredths of a hertz
//!
//! Without the first two the image plays the embedded sample.

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    link_in("BUNRAKU_CLIP", &out.join("clip.qmd"));
    link_in("BUNRAKU_MAP", &out.join("map.postcard"));
    println!("cargo:rerun-if-env-changed=BUNRAKU_CENTIHERTZ");
    let centihertz = env::var("BUNRAKU_CENTIHERTZ").unwrap_or_else(|_| "0".to_owned());
    println!("cargo:rustc-env=BUNRAKU_CENTIHERTZ={centihertz}");

    // The map of this board's memory, memory.x, is at the top of the workspace.
    println!("cargo:rustc-link-search={}/../../..", env!("CARGO_MANIFEST_DIR"));
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}

/// Copies the file that the variable names to where main.rs includes it.
fn link_in(variable: &str, to: &Path) {
    println!("cargo:rerun-if-env-changed={variable}");
    let Some(from) = env::var_os(variable).map(PathBuf::from) else {
        panic!("{variable} is not set");
    };
    println!("cargo:rerun-if-changed={}", from.display());
    if let Err(error) = fs::copy(&from, to) {
        panic!("{variable}: cannot read {}: {error}", from.display());
    }
}

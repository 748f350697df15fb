//! Puts the clip into the image, and as much memory as its decoder needs.
//!
//! - `BUNRAKU_CLIP`: path of a .qmd; a golden vector unless given
//! - `BUNRAKU_MCLIP`: path of a .mclip, for the image `decode-mclip`; a golden vector unless given. Where it is given, the
//!   images `tick` and `wearable` play it
//! - `BUNRAKU_VERIFY`: `blocks` to have the .mclip's blocks checked as they are entered, and not all before
//! - `BUNRAKU_TABLE`: `none` to lend the decoder no memory for its table
//! - `BUNRAKU_MAP`: path of a joint map as postcard bytes, for the images `tick` and `wearable`
//! - `BUNRAKU_OUTPUT_HZ`, `BUNRAKU_CLOCK_HZ`: ticks a second and the core's clock, for the image `wearable`
//! - `BUNRAKU_NOPS`: instructions to waste in every frame, so that tests have a slower decoder to find

#[path = "../../firmware/boards/board_x.rs"]
mod board_x;

use decoder_core::{Limits, mclip, qmd::Clip};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// The top of the workspace.
const WORKSPACE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let path = variable("BUNRAKU_CLIP")
        .unwrap_or_else(|| format!("{WORKSPACE}/tests/vectors/v1/qmd-many-channels.qmd"));
    let bytes = read(Path::new(&path));
    let clip = Clip::parse(&bytes, Limits::MAX).unwrap_or_else(|error| panic!("{path}: {error}"));
    let table =
        if variable("BUNRAKU_TABLE").is_some_and(|lent| lent == "none") { 0 } else { clip.table_len() };
    let nops = variable("BUNRAKU_NOPS").map_or(0, |nops| nops.parse().expect("BUNRAKU_NOPS is a number"));
    let sizes = format!(
        "/// Channels of the clip.\nconst CHANNELS: usize = {};\n/// Words lent for its table.\nconst TABLE: usize = {table};\n",
        clip.channels()
    );
    write(&out, "sizes.rs", sizes.as_bytes());
    let nops = format!("/// Instructions to waste in every frame.\nconst NOPS: usize = {nops};\n");
    write(&out, "nops.rs", nops.as_bytes());
    write(&out, "clip.qmd", &bytes);
    mclip(&out);
    if ["CARGO_FEATURE_TICK", "CARGO_FEATURE_WEARABLE"].iter().any(|feature| env::var_os(feature).is_some()) {
        let map = variable("BUNRAKU_MAP").expect("this image needs a map: set BUNRAKU_MAP");
        write(&out, "map.postcard", &read(Path::new(&map)));
    }
    let number = |name| variable(name).map_or(0, |number| number.parse::<u32>().expect("a number"));
    let wearable = format!(
        "/// Ticks a second.\nconst OUTPUT_HZ: u16 = {};\n/// The core's clock.\nconst CLOCK_HZ: u32 = {};\n",
        number("BUNRAKU_OUTPUT_HZ"),
        number("BUNRAKU_CLOCK_HZ")
    );
    write(&out, "wearable.rs", wearable.as_bytes());

    // The map of memory, memory.x, is that of QEMU's board: flash at 0, RAM at 0x2000_0000, 4 MiB of each.
    board_x::lay_out(&format!("{WORKSPACE}/firmware/boards/qemu-mps2"));
    for argument in ["--nmagic", "-Tlink.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}

/// The clip of the image `decode-mclip`.
fn mclip(out: &Path) {
    let given = variable("BUNRAKU_MCLIP");
    println!("cargo:rustc-check-cfg=cfg(mclip)");
    if given.is_some() {
        println!("cargo:rustc-cfg=mclip");
    }
    let path = given.unwrap_or_else(|| format!("{WORKSPACE}/tests/vectors/v1/dpcm-many-channels.mclip"));
    let bytes = read(Path::new(&path));
    let clip = mclip::Clip::parse(&bytes, Limits::MAX).unwrap_or_else(|error| panic!("{path}: {error}"));
    let needs = clip.header().needs();
    let sizes = [("CHANNELS", needs.channels), ("WORDS", needs.words), ("HALVES", needs.halves)]
        .map(|(name, size)| format!("/// Elements that the decoder needs.\nconst {name}: usize = {size};\n"));
    let blocks = variable("BUNRAKU_VERIFY").is_some_and(|when| when == "blocks");
    let verify = format!(
        "/// Whether blocks are checked as they are entered.\nconst VERIFY_BLOCKS: bool = {blocks};\n"
    );
    write(out, "mclip_sizes.rs", sizes.concat().as_bytes());
    write(out, "verify.rs", verify.as_bytes());
    write(out, "clip.mclip", &bytes);
}

fn variable(name: &str) -> Option<String> {
    println!("cargo:rerun-if-env-changed={name}");
    env::var(name).ok()
}

fn read(path: &Path) -> Vec<u8> {
    println!("cargo:rerun-if-changed={}", path.display());
    fs::read(path).unwrap_or_else(|error| panic!("cannot read {}: {error}", path.display()))
}

fn write(folder: &Path, name: &str, bytes: &[u8]) {
    fs::write(folder.join(name), bytes).unwrap_or_else(|error| panic!("cannot write {name}: {error}"));
}

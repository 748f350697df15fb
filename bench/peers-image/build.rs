//! Puts stored motion into the image.
//!
//! - `BUNRAKU_STORE`: path of the motion as it is stored; a small one as int16 unless given
//! - `BUNRAKU_CHANNELS`: values of a frame
//! - `BUNRAKU_BLOCK_FRAMES`: frames that are packed together
//! - `BUNRAKU_WINDOW_BITS`: bits of tamp's window
//! - `BUNRAKU_DELTA`: `1` where frames are stored as differences to the frame before

#[path = "../../firmware/boards/board_x.rs"]
mod board_x;

use std::path::PathBuf;
use std::{env, fs};

/// The top of the workspace.
const WORKSPACE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let store = variable("BUNRAKU_STORE").map_or(vec![0; 8], |path| {
        println!("cargo:rerun-if-changed={path}");
        fs::read(&path).unwrap_or_else(|error| panic!("cannot read {path}: {error}"))
    });
    let number = |name: &str, default: usize| {
        variable(name).map_or(default, |text| text.parse().unwrap_or_else(|_| panic!("{name} is no number")))
    };
    let sizes = format!(
        "/// Values of a frame.\nconst CHANNELS: usize = {};\n/// Whether frames are stored as differences.\nconst DELTA: bool = {};\n",
        number("BUNRAKU_CHANNELS", 2),
        number("BUNRAKU_DELTA", 0) == 1
    );
    let block = format!(
        "/// Frames that are packed together.\nconst BLOCK_FRAMES: usize = {};\n",
        number("BUNRAKU_BLOCK_FRAMES", 1)
    );
    let window = format!(
        "/// Bits of tamp's window.\nconst WINDOW_BITS: u16 = {};\n",
        number("BUNRAKU_WINDOW_BITS", 10)
    );
    let texts = [("sizes.rs", &sizes), ("block.rs", &block), ("window.rs", &window)];
    let texts = texts.map(|(name, text)| (name, text.as_bytes()));
    for (name, text) in texts.into_iter().chain([("store", store.as_slice())]) {
        fs::write(out.join(name), text).unwrap_or_else(|error| panic!("cannot write {name}: {error}"));
    }
    board_x::lay_out(&format!("{WORKSPACE}/firmware/boards/qemu-mps2"));
    for argument in ["--nmagic", "-Tlink.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}

fn variable(name: &str) -> Option<String> {
    println!("cargo:rerun-if-env-changed={name}");
    env::var(name).ok()
}

//! Tells the images the sizes of the motion that they play, which an engineer knows when the player is built.
//!
//! - `BUNRAKU_CHANNELS`: values of a frame
//! - `BUNRAKU_BLOCK_FRAMES`: frames that are packed together
//! - `BUNRAKU_WINDOW_BITS`: bits of tamp's window

#[path = "../../firmware/boards/board_x.rs"]
mod board_x;

use std::path::PathBuf;
use std::{env, fs};

/// The top of the workspace.
const WORKSPACE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let sizes = [
        ("CHANNELS", "usize", "2", "Values of a frame."),
        ("BLOCK_FRAMES", "usize", "1", "Frames that are packed together."),
        ("WINDOW_BITS", "u16", "10", "Bits of tamp's window."),
    ];
    let sizes = sizes.map(|(name, kind, default, doc)| {
        let variable = format!("BUNRAKU_{name}");
        println!("cargo:rerun-if-env-changed={variable}");
        let number = env::var(&variable).unwrap_or(default.to_owned());
        // Not every image needs all of them.
        format!("/// {doc}\n#[allow(dead_code)]\npub const {name}: {kind} = {number};\n")
    });
    fs::write(out.join("sizes.rs"), sizes.concat()).expect("cargo's OUT_DIR can be written to");
    board_x::lay_out(&format!("{WORKSPACE}/firmware/boards/qemu-mps2"));
    for argument in ["--nmagic", "-Tlink.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}

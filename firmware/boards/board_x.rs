//! A part of build scripts: lays a board's map of memory where the linker looks for board.x, which memory.x at the top of the
//! workspace includes.

use std::path::Path;
use std::{env, fs};

/// Takes the memory.x in this folder.
pub fn lay_out(folder: &str) {
    let map = Path::new(folder).join("memory.x");
    println!("cargo:rerun-if-changed={}", map.display());
    let out = env::var("OUT_DIR").unwrap_or_else(|error| panic!("OUT_DIR: {error}"));
    fs::copy(&map, Path::new(&out).join("board.x"))
        .unwrap_or_else(|error| panic!("cannot copy {}: {error}", map.display()));
    println!("cargo:rustc-link-search={out}");
    // Where cargo does not run the linker at the top of the workspace.
    println!("cargo:rustc-link-search={folder}/../../..");
}

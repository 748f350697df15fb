//! What must hold for any bytes: a target for every input of the project that others write.
//!
//! A target is a plain function that panics where something does not hold. A test calls each with many changed seeds,
//! on every toolchain and the same on every run; libFuzzer calls it with what it finds by coverage
//! (docs/TESTING.md).
#![forbid(unsafe_code)]

pub mod amc;
pub mod asf;
pub mod bvh;
pub mod dynamixel;
pub mod link;
pub mod mclip;
pub mod mutate;
pub mod qmd;
mod random;
mod text;

pub use random::Random;

use std::fs;
use std::path::Path;

/// An input of the project, and what must hold for it.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name, which is that of its libFuzzer harness.
    pub name: &'static str,
    /// Panics where something does not hold; says whether the bytes were accepted.
    pub check: fn(&[u8]) -> bool,
    /// Inputs that are accepted.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// All targets.
pub const TARGETS: [Target; 7] = [
    Target { name: "qmd", check: qmd::check, seeds: qmd::seeds },
    Target { name: "mclip", check: mclip::check, seeds: mclip::seeds },
    Target { name: "asf", check: asf::check, seeds: asf::seeds },
    Target { name: "amc", check: amc::check, seeds: amc::seeds },
    Target { name: "bvh", check: bvh::check, seeds: bvh::seeds },
    Target { name: "dynamixel", check: dynamixel::check, seeds: dynamixel::seeds },
    Target { name: "link", check: link::check, seeds: link::seeds },
];

/// The golden vectors that a list of hashes names.
fn vectors(list: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/vectors/v1");
    let read = |name: &str| {
        let path = folder.join(name);
        fs::read(&path).unwrap_or_else(|error| panic!("cannot read {}: {error}", path.display()))
    };
    let sums = String::from_utf8_lossy(&read(list)).into_owned();
    sums.lines().filter_map(|line| line.split_once("  ")).map(|(_, name)| read(name)).collect()
}

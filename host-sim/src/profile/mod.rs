//! What a clip costs on a microcontroller: cycles, memory and energy, from the machine code that would run there.
//!
//! The clip is linked into a bare image (`tests/profile-image`), which is built for the core and run on the simulator
//! in [`thumb`](crate::thumb). A frame's cycles are those from the first instruction of its function to the return,
//! so measuring adds nothing to the image; every frame is compared with what the decoder gives on this machine.

pub mod baseline;
pub mod elf;
pub mod flame;
pub mod html;
pub mod measure;
pub mod parts;
pub mod report;
mod svg;

pub use measure::Measured;
pub use report::{CoreReport, Report};

use crate::image::Image;
use anyhow::Result;

/// Builds the image that decodes `clip` for each of Rust's `targets`, whose decoder is lent memory for its table or
/// not.
///
/// # Errors
/// As [`Image::build`].
pub fn images(clip: &[u8], targets: &[&str], lent: bool) -> Result<Vec<Vec<u8>>> {
    let image = Image {
        package: "profile-image",
        source: "tests/profile-image",
        binary: "decode",
        features: "",
        targets,
        folder: "profile",
        files: &[("BUNRAKU_CLIP", "clip.qmd", clip)],
        variables: &[("BUNRAKU_TABLE", if lent { "lent" } else { "none" })],
    };
    image.build()
}

/// Builds the image that decodes `clip`, a .mclip, for each of Rust's `targets`. Its blocks are checked all before the
/// first frame, or with `verify_blocks` each when it is entered.
///
/// # Errors
/// As [`Image::build`].
pub fn mclip_images(clip: &[u8], targets: &[&str], verify_blocks: bool) -> Result<Vec<Vec<u8>>> {
    let image = Image {
        package: "profile-image",
        source: "tests/profile-image",
        binary: "decode-mclip",
        features: "",
        targets,
        folder: "profile",
        files: &[("BUNRAKU_MCLIP", "clip.mclip", clip)],
        variables: &[("BUNRAKU_VERIFY", if verify_blocks { "blocks" } else { "once" })],
    };
    image.build()
}

/// Builds the image that decodes prefix codes by a table and bit by bit, for each of Rust's `targets`. What is measured of it is
/// a frame of codes, by the table first and then bit by bit, in turns.
///
/// # Errors
/// As [`Image::build`].
pub fn prefix_images(targets: &[&str]) -> Result<Vec<Vec<u8>>> {
    let image = Image {
        package: "profile-image",
        source: "tests/profile-image",
        binary: "prefix",
        features: "",
        targets,
        folder: "profile",
        files: &[],
        variables: &[],
    };
    image.build()
}

/// Builds the image that plays `clip` on the servos of a joint map, given as its bytes, as [`images`] does. What is
/// measured of it is a tick.
///
/// # Errors
/// As [`Image::build`].
pub fn tick_images(clip: &[u8], map: &[u8], targets: &[&str], lent: bool) -> Result<Vec<Vec<u8>>> {
    let image = Image {
        package: "profile-image",
        source: "tests/profile-image",
        binary: "tick",
        features: "tick",
        targets,
        folder: "profile",
        files: &[("BUNRAKU_CLIP", "clip.qmd", clip), ("BUNRAKU_MAP", "map.postcard", map)],
        variables: &[("BUNRAKU_TABLE", if lent { "lent" } else { "none" })],
    };
    image.build()
}

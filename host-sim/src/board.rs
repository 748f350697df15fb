//! Builds the image of the board `qemu-mps2` with a clip and a joint map in it.

use crate::files;
use crate::image::Image;
use crate::puppet::{self, Map};
use anyhow::Result;
use std::path::Path;

/// QEMU's name of the board.
pub const MACHINE: &str = "mps2-an386";

/// The board's clock in hertz (Arm AN386, "Clocks").
pub const CLOCK_HZ: u32 = 25_000_000;

const PACKAGE: &str = "qemu-mps2";
const TARGET: &str = "thumbv7em-none-eabi";

/// Builds the image that plays `clip` (the bytes of a .qmd or .mclip) by `map`, and puts it at `to`.
///
/// `centihertz` is the rate to play at, in hundredths of a hertz, or 0 for the clip's own. Cargo's messages go to
/// standard error.
///
/// # Errors
/// A sentence that says what is missing: the source, cargo, the target, or what cargo could not build.
pub fn build(clip: &[u8], map: &Map, centihertz: u16, to: &Path) -> Result<()> {
    let image = Image {
        package: PACKAGE,
        source: "firmware/boards/qemu-mps2",
        binary: PACKAGE,
        features: "",
        targets: &[TARGET],
        folder: "play",
        files: &[("BUNRAKU_CLIP", "clip", clip), ("BUNRAKU_MAP", "map.postcard", &puppet::to_bytes(map)?)],
        variables: &[("BUNRAKU_CENTIHERTZ", &centihertz.to_string()), ("DEFMT_LOG", "info")],
    };
    let elf = image.build()?.concat();
    files::write(to, |file| Ok(file.write_all(&elf)?))
}

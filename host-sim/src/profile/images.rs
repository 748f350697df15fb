//! Builds the bare images that are measured.

use crate::clip::is_mclip;
use crate::image::Image;
use anyhow::Result;

/// The image that decodes a .qmd. The others differ from it in what is linked in.
const DECODE: Image<'static> = Image {
    package: "profile-image",
    source: "tests/profile-image",
    binary: "decode",
    features: "",
    targets: &[],
    folder: "profile",
    files: &[],
    variables: &[],
};

/// Builds the image that decodes `clip` for each of Rust's `targets`. A .qmd's decoder is lent memory for its table or
/// not; a .mclip's is always lent what it needs.
///
/// # Errors
/// As [`Image::build`].
pub fn images(clip: &[u8], targets: &[&str], lent: bool) -> Result<Vec<Vec<u8>>> {
    if is_mclip(clip) {
        return mclip_images(clip, targets, false);
    }
    Image { targets, files: &[file(clip)], variables: &[table(lent)], ..DECODE }.build()
}

/// Builds the image that decodes `clip`, a .mclip, for each of Rust's `targets`. Its blocks are checked all before the
/// first frame, or with `verify_blocks` each when it is entered.
///
/// # Errors
/// As [`Image::build`].
pub fn mclip_images(clip: &[u8], targets: &[&str], verify_blocks: bool) -> Result<Vec<Vec<u8>>> {
    let variables = &[("BUNRAKU_VERIFY", if verify_blocks { "blocks" } else { "once" })];
    Image { binary: "decode-mclip", targets, files: &[file(clip)], variables, ..DECODE }.build()
}

/// Builds the image that decodes prefix codes by a table and bit by bit, for each of Rust's `targets`. What is measured of
/// it is a frame of codes, by the table first and then bit by bit, in turns.
///
/// # Errors
/// As [`Image::build`].
pub fn prefix_images(targets: &[&str]) -> Result<Vec<Vec<u8>>> {
    Image { binary: "prefix", targets, ..DECODE }.build()
}

/// Builds the image that plays `clip` on the servos of a joint map, given as its bytes, as [`images`] does. What is
/// measured of it is a tick.
///
/// # Errors
/// As [`Image::build`].
pub fn tick_images(clip: &[u8], map: &[u8], targets: &[&str], lent: bool) -> Result<Vec<Vec<u8>>> {
    let files = &[file(clip), ("BUNRAKU_MAP", "map.postcard", map)];
    Image { binary: "tick", features: "tick", targets, files, variables: &[table(lent)], ..DECODE }.build()
}

/// Builds the image of a wearable that plays `clip` on the outputs of a joint map, given as its bytes, for one of Rust's
/// targets. Its outputs change `output_hz` times a second of a clock of `clock_hz`.
///
/// # Errors
/// As [`Image::build`].
pub fn wearable_image(
    clip: &[u8],
    map: &[u8],
    target: &str,
    output_hz: u16,
    clock_hz: u32,
) -> Result<Vec<u8>> {
    let files = &[file(clip), ("BUNRAKU_MAP", "map.postcard", map)];
    let (output_hz, clock_hz) = (output_hz.to_string(), clock_hz.to_string());
    let variables = &[table(true), ("BUNRAKU_OUTPUT_HZ", &*output_hz), ("BUNRAKU_CLOCK_HZ", &*clock_hz)];
    let features = "wearable";
    let image = Image { binary: "wearable", features, targets: &[target], files, variables, ..DECODE };
    Ok(image.build()?.concat())
}

/// The clip as the build script takes it.
fn file(clip: &[u8]) -> (&str, &str, &[u8]) {
    if is_mclip(clip) { ("BUNRAKU_MCLIP", "clip.mclip", clip) } else { ("BUNRAKU_CLIP", "clip.qmd", clip) }
}

fn table(lent: bool) -> (&'static str, &'static str) {
    ("BUNRAKU_TABLE", if lent { "lent" } else { "none" })
}

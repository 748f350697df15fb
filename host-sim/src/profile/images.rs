//! Builds the bare images that are measured, and loads them with a clip.

use super::loaded::{Contents, LoadedImage};
use crate::clip::is_mclip;
use crate::image::Image;
use anyhow::{Context, Result};
use decoder_core::{Limits, mclip, qmd};

/// The image that decodes a .qmd. The others differ from it in their binary and features.
const DECODE: Image<'static> = Image {
    package: "profile-image",
    source: "tests/profile-image",
    binary: "decode",
    features: "all",
    targets: &[],
    folder: "profile",
    files: &[],
    variables: &[],
};

/// The image that decodes `clip` for each of Rust's `targets`. A .qmd's decoder is lent memory for its table or not; a
/// .mclip's is always lent what it needs.
///
/// # Errors
/// As [`Image::build`], and where the clip is not sound.
pub fn images(clip: &[u8], targets: &[&str], lent: bool) -> Result<Vec<LoadedImage>> {
    if is_mclip(clip) {
        return mclip_images(clip, targets, false);
    }
    let features = if lent { "all" } else { "all,no-table" };
    let memory = DecoderMemory::of(clip, lent)?;
    let contents = Contents { files: &[("CLIP", clip)], numbers: &memory.elements, lent_bytes: memory.bytes };
    load(Image { features, targets, ..DECODE }, contents)
}

/// The image that decodes `clip`, a .mclip, for each of Rust's `targets`. Its blocks are checked all before the first
/// frame, or with `verify_blocks` each when it is entered.
///
/// # Errors
/// As [`images`].
pub fn mclip_images(clip: &[u8], targets: &[&str], verify_blocks: bool) -> Result<Vec<LoadedImage>> {
    mclip_decoders(targets)?.into_iter().map(|elf| load_mclip(elf, clip, verify_blocks)).collect()
}

/// The image that decodes a .mclip for each of Rust's `targets`, without a clip.
///
/// # Errors
/// As [`Image::build`].
pub fn mclip_decoders(targets: &[&str]) -> Result<Vec<Vec<u8>>> {
    Image { binary: "decode-mclip", targets, ..DECODE }.build()
}

/// One of [`mclip_decoders`] with its clip, as [`mclip_images`] gives it.
///
/// # Errors
/// Where the clip is not sound.
pub fn load_mclip(decoder: Vec<u8>, clip: &[u8], verify_blocks: bool) -> Result<LoadedImage> {
    let DecoderMemory { mut elements, bytes } = DecoderMemory::of(clip, true)?;
    elements.push(("VERIFY_BLOCKS", verify_blocks.into()));
    LoadedImage::new(decoder, Contents { files: &[("CLIP", clip)], numbers: &elements, lent_bytes: bytes })
}

/// The image that decodes prefix codes by a table and bit by bit, for each of Rust's `targets`. What is measured of it is
/// a frame of codes, by the table first and then bit by bit, in turns.
///
/// # Errors
/// As [`Image::build`].
pub fn prefix_images(targets: &[&str]) -> Result<Vec<LoadedImage>> {
    load(Image { binary: "prefix", targets, ..DECODE }, Contents::default())
}

/// The image that plays `clip` on the servos of a joint map, given as its bytes, as [`images`] does. What is measured of it
/// is a tick.
///
/// # Errors
/// As [`images`].
pub fn tick_images(clip: &[u8], map: &[u8], targets: &[&str], lent: bool) -> Result<Vec<LoadedImage>> {
    let features = match (is_mclip(clip), lent) {
        (true, _) => "tick,mclip,all",
        (false, true) => "tick,all",
        (false, false) => "tick,all,no-table",
    };
    let memory = DecoderMemory::of(clip, lent)?;
    let files = &[("CLIP", clip), ("MAP", map)];
    let contents = Contents { files, numbers: &memory.elements, lent_bytes: memory.bytes };
    load(Image { binary: "tick", features, targets, ..DECODE }, contents)
}

/// The image of a wearable that plays `clip` on the outputs of a joint map, given as its bytes, for one of Rust's targets.
/// Its outputs change `output_hz` times a second of a clock of `clock_hz`.
///
/// # Errors
/// As [`images`].
pub fn wearable_image(
    clip: &[u8],
    map: &[u8],
    target: &str,
    output_hz: u16,
    clock_hz: u32,
) -> Result<LoadedImage> {
    let features = if is_mclip(clip) { "wearable,mclip,all" } else { "wearable,all" };
    let DecoderMemory { mut elements, bytes } = DecoderMemory::of(clip, true)?;
    elements.extend([("OUTPUT_HZ", output_hz.into()), ("CLOCK_HZ", clock_hz)]);
    let image = Image { binary: "wearable", features, targets: &[target], ..DECODE };
    let files = &[("CLIP", clip), ("MAP", map)];
    let images = load(image, Contents { files, numbers: &elements, lent_bytes: bytes })?;
    images.into_iter().next().context("no image was built")
}

/// Builds the image unless it is built, and loads what it is to find.
fn load(image: Image<'_>, contents: Contents<'_>) -> Result<Vec<LoadedImage>> {
    image.build()?.into_iter().map(|elf| LoadedImage::new(elf, contents)).collect()
}

/// Memory that a clip's decoder is lent: elements, by the names of the image's statics, and bytes.
struct DecoderMemory {
    elements: Vec<(&'static str, u32)>,
    bytes: usize,
}

impl DecoderMemory {
    fn of(clip: &[u8], with_table: bool) -> Result<Self> {
        let (elements, bytes) = if is_mclip(clip) {
            let needs = mclip::Clip::parse(clip, Limits::MAX)?.header().needs();
            let elements =
                vec![("CHANNELS", needs.channels), ("WORDS", needs.words), ("HALVES", needs.halves)];
            (elements, needs.bytes())
        } else {
            let clip = qmd::Clip::parse(clip, Limits::MAX)?;
            let table = with_table.then(|| ("TABLE", clip.table_len()));
            let elements: Vec<_> = [("CHANNELS", clip.channels())].into_iter().chain(table).collect();
            let words: usize = elements.iter().map(|(_, words)| words).sum();
            (elements, words * size_of::<u32>())
        };
        let elements = elements.into_iter().map(|(name, elements)| Ok((name, u32::try_from(elements)?)));
        Ok(Self { elements: elements.collect::<Result<_>>()?, bytes })
    }
}

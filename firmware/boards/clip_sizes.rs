//! A part of build scripts: how much memory the decoder of a clip needs.

use decoder_core::{Limits, mclip, qmd};

/// Elements of memory that a decoder is lent.
#[derive(Clone, Copy, Default)]
pub struct Sizes {
    /// Channels of a frame.
    pub channels: usize,
    /// Words of a .mclip's decoder.
    pub words: usize,
    /// Half words of a .mclip's decoder.
    pub halves: usize,
    /// Values in the table of a .qmd.
    pub table: usize,
}

impl Sizes {
    /// What the clip needs that came from `name`.
    pub fn of(name: &str, clip: &[u8]) -> Self {
        if clip.starts_with(&mclip::MAGIC) {
            let clip =
                mclip::Clip::parse(clip, Limits::MAX).unwrap_or_else(|error| panic!("{name}: {error}"));
            let needs = clip.header().needs();
            Self { channels: needs.channels, words: needs.words, halves: needs.halves, table: 0 }
        } else {
            let clip = qmd::Clip::parse(clip, Limits::MAX).unwrap_or_else(|error| panic!("{name}: {error}"));
            Self { channels: clip.channels(), table: clip.table_len(), ..Self::default() }
        }
    }
}

/// Rust source that defines these constants.
pub fn constants(sizes: &[(&str, usize)]) -> String {
    let line = |(name, size): &(&str, usize)| {
        format!("/// Elements that the decoder needs.\nconst {name}: usize = {size};\n")
    };
    sizes.iter().map(line).collect()
}

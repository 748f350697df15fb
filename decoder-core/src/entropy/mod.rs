//! Entropy stages: from bits to the codes of channels.
//!
//! Source: the waveform-coding document, section 7.4. One file a stage, all behind [`Stage`]. A **code** is what
//! a quantiser takes: a signed number. Prefix codes number them 0, −1, 1, −2, 2 …: these are their symbols.

pub(crate) mod linked;
pub(crate) mod list;
pub mod stage;
pub mod symbols;

macro_rules! modules {
    ($($(#[$doc:meta])* $id:literal $Variant:ident($module:ident $(<$life:lifetime>)?) $name:literal [];)*) => {
        $(pub mod $module;)*
    };
}

list::for_each_stage!(modules);

pub use crate::ids::EntropyId;
pub use adaptive_huffman::AdaptiveHuffman;
pub use fixed_width::FixedWidth;
pub use huffman::Huffman;
pub use stage::{FrameLoops, Stage};
pub use symbols::SymbolSource;

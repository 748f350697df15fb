//! From motion capture to compressed clips: encoders for `.mclip` and `.qmd`.
//!
//! Floating point chooses here, but never reconstructs: every encoder decodes with `decoder-core`.
#![forbid(unsafe_code)]

pub mod mclip;
pub mod qmd;

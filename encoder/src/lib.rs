//! From motion capture to compressed clips: encoders for `.mclip` and `.qmd`.
//!
//! Floating point chooses here, but never reconstructs: every encoder decodes with `decoder-core`.
#![forbid(unsafe_code)]

pub mod codec;
pub mod column;
mod entropy;
pub mod error;
pub mod lloyd_max;
pub mod mclip;
pub mod memory;
pub mod qmd;
mod quality;
pub mod source;
pub mod task;
pub mod train;

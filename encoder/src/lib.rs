//! From motion capture to compressed clips: import, kinematics, error metrics, encoders.
//!
//! Floating point chooses here, but never reconstructs: every encoder decodes with `decoder-core`.
#![forbid(unsafe_code)]

pub mod angles;
pub mod export;
pub mod import;
pub mod kinematics;
pub mod mclip;
pub mod metrics;
pub mod motion;
pub mod qmd;
pub mod sample;
pub mod skeleton;

pub use import::Clip;
pub use motion::Motion;
pub use skeleton::Skeleton;

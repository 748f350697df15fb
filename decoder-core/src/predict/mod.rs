//! Predictors: what a channel's next value is likely to be, from the decoded ones before it.
//!
//! Source: the waveform-coding document, sections 7.5 and 7.6.

pub mod adaptive;
pub mod fixed;
pub mod window;

pub use adaptive::{CORRELATION_WORDS, Correlation, ONE, movement, solve};
pub use fixed::{Constant, First, FirstByHalves, Predict, Second};
pub use window::Ring;

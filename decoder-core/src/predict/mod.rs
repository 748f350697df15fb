//! Predictors: what a channel's next value is likely to be, from the decoded ones before it.
//!
//! Source: the waveform-coding document, sections 7.5 and 7.6. Coefficients are 16384ths ([`ONE`]).

pub mod adaptive;
pub mod fixed;
pub mod window;

pub use adaptive::Correlation;
pub use fixed::{First, Last, Predict, Second};
pub use window::Slots;

/// A coefficient of 1.
pub const ONE: i16 = 1 << 14;

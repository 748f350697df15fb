//! Everything that is drawn: pages by maud, and pictures by plotters.
//!
//! A page ([`page`]) takes its colours from the reader's light or dark style, and says what is under the pointer. So the
//! drawings on it are elements of the page itself: [`bars`], [`flame`], [`lines`], [`spans`]. A picture that stands alone
//! ([`chart`], [`scatter`]) is drawn by plotters as SVG, which [`png`] makes pixels of.

pub mod bars;
pub mod chart;
pub mod flame;
pub mod lines;
pub mod page;
#[cfg(feature = "png")]
pub mod png;
pub mod scale;
pub mod scatter;
pub mod spans;

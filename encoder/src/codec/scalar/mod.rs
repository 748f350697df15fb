//! What encoders share of codecs with a code a channel and frame: a step and a predictor for each channel, the decoder's
//! own loop, and the way from codes to a clip.

pub mod allocate;
pub mod contract;
pub mod encode;
pub mod simulate;
mod write;

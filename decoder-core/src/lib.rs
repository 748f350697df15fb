//! Integer-only, allocation-free, panic-free decoders for recorded human motion.
//!
//! Bytes go in, one frame at a time comes out, in memory of the caller's. The same code runs on Cortex-M, x86 and wasm, and
//! gives the same bits: what a decoder computes is defined in integers in docs/FORMAT.md.
//!
//! A channel value is an [`I16F16`], in degrees for rotations and centimetres for translations.
//!
//! The promise: any bytes give `Ok` or `Err`. Never a panic, an endless loop, or a write past the output.
//!
//! ```
//! use decoder_core::Limits;
//! use decoder_core::mclip::{Clip, Workspace};
//!
//! let bytes = include_bytes!("../examples/clip.mclip");
//! // What this caller is ready to hold; a clip with more is refused.
//! let limits = Limits { channels: 16, frames: 1000 };
//! let clip = Clip::parse(bytes, limits)?.verify()?;
//! // Room for 16 channels, and for the table of this clip's Huffman codes.
//! let mut memory = Workspace::<16, 0, 2048>::EMPTY;
//! let mut decoder = clip.decoder(memory.lend())?;
//! while let Some(pose) = decoder.next_frame()? {
//!     // The value of each channel, in the order of `clip.header().channels()`.
//!     println!("{pose:?}");
//! }
//! # assert_eq!(decoder.position(), clip.frames());
//! // Any frame can be had: decoding goes on from the last entry point before it.
//! assert!(decoder.seek(250)?.is_some());
//! # Ok::<(), decoder_core::Error>(())
//! ```
//!
//! # Rooms
//!
//! - [`mclip`] and [`qmd`] are the containers: headers, blocks, entry points, seeking, streams.
//! - [`codec`] has a file for each codec of a `.mclip`, and the one list of them.
//! - [`entropy`], [`predict`] and [`quantise`] have the stages that codecs are composed of, each usable alone.
//! - [`bits`], [`word`] and [`arithmetic`] are what all others stand on.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
// Without some codecs and stages, parts of what they share have no user.
#![cfg_attr(not(feature = "default"), allow(dead_code, unused_imports, unused_variables))]
#![cfg_attr(
    not(test),
    deny(
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::float_arithmetic
    )
)]

pub mod arithmetic;
pub mod bits;
mod channel;
pub mod codec;
pub mod entropy;
mod error;
mod ids;
pub mod mclip;
mod memory;
pub mod predict;
pub mod qmd;
pub mod quantise;
mod state;
#[cfg(test)]
mod testing;
pub mod word;

pub use channel::Rules;
pub use error::{Error, Field, Limits};
pub use fixed::types::I16F16;
pub use ids::Feature;

/// The examples of README.md are tested with those of the crate.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;

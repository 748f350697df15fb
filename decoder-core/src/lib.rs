//! Integer-only, allocation-free, panic-free decoders for recorded human motion.
//!
//! Bytes in, the caller's slices out. The same code runs on Cortex-M, x86 and wasm, and gives the same bits:
//! what a decoder computes is defined in integers in docs/FORMAT.md.
//!
//! A channel value is an [`I16F16`], in degrees for rotations and centimetres for translations.
//!
//! The promise: any bytes give `Ok` or `Err`. Never a panic, an endless loop, or a write past the output.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
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

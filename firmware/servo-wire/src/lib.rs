//! Servo buses: the bytes on the wire, and clients that speak them.
//!
//! `no_std`, no allocation. Nothing here panics or trusts a length that came over the wire.
//!
//! - [`bus`]: what a player asks of servos, whatever wire they hang on
//! - [`dynamixel`]: Dynamixel protocol 2.0
//! - [`protocol1`]: Dynamixel protocol 1.0, and the frame that Feetech servos share
//! - [`feetech`]: Feetech STS, SMS and SCS
//! - [`blender`]: the live frames of the Blender add-on Servo Animation
//! - [`pwm`], [`pca9685`]: hobby servos
//! - [`port`]: a half-duplex serial port; [`blocking`]: the same without an executor
//! - [`both`]: two buses as one
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

pub mod blender;
pub mod blocking;
pub mod bus;
pub mod dynamixel;
pub mod feetech;
pub mod joined;
pub mod pca9685;
pub mod port;
pub mod protocol1;
pub mod pwm;
mod read_schedule;
mod receive_buffer;
#[cfg(test)]
mod testing;

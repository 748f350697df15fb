//! Dynamixel protocol 1.0: AX and MX servos, and the frame that Feetech servos share.
//!
//! Source: ROBOTIS e-Manual, "DYNAMIXEL Protocol 1.0" and "AX-12A" (control table).
//!
//! - [`packet`]: one packet, and packets out of a stream of bytes
//! - [`client`]: every instruction over a port, with its answers
//! - [`bus`]: AX and MX servos as a [`ServoBus`](crate::bus::ServoBus)

pub mod bus;
pub mod client;
pub mod packet;

pub use bus::Protocol1Bus;
pub use client::Protocol1Client;

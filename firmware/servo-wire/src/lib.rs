//! The bytes on a servo's wire, and clients that speak them: Dynamixel, Feetech, hobby servos.
//!
//! `no_std`, no allocation. The promise: no bytes that come over a wire make this crate panic, read or write out of
//! bounds, or wait for ever.
//!
//! The protocols, each with its packets, its client and its servos as a [`ServoBus`](bus::ServoBus):
//!
//! - [`dynamixel`]: Dynamixel protocol 2.0
//! - [`protocol1`]: Dynamixel protocol 1.0, whose frame Feetech servos share
//! - [`feetech`]: Feetech STS, SMS and SCS
//! - [`pwm`], [`pca9685`]: hobby servos
//! - [`blender`]: the live frames of the Blender add-on Servo Animation
//!
//! What they stand on:
//!
//! - [`bus`]: what a player asks of servos, whatever wire they are on
//! - [`joined`]: several buses as one
//! - [`port`]: a half-duplex serial port, with time limits
//! - [`blocking`]: the same buses over blocking drivers
//!
//! Packets need no hardware:
//!
//! ```
//! use servo_wire::bus::Goal;
//! use servo_wire::dynamixel::{Framer, goal_positions};
//!
//! // One packet that sends servo 1 to position 150 and servo 2 to 170.
//! let mut buffer = [0; 64];
//! let goals = [Goal { id: 1, position: 150 }, Goal { id: 2, position: 170 }];
//! let packet = goal_positions(&mut buffer, &goals)?;
//! assert_eq!(packet.len(), 24);
//!
//! // The answer of servo 1 to a read, behind noise, as a UART may give it.
//! let mut bytes: &[u8] = &[
//!     0x00, 0xFF, 0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x08, 0x00, 0x55, 0x00, 0xA6, 0x00, 0x00, 0x00, 0x8C, 0xC0,
//! ];
//! let mut framer = Framer::<64>::new();
//! let packet = framer.feed(&mut bytes).expect("a packet")?;
//! let status = packet.status().expect("an answer");
//! assert_eq!((status.id, status.error, status.parameters), (1, 0, &[0xA6, 0, 0, 0][..]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A bus goes over a UART, a direction pin and a timer of `embedded-hal`'s kinds:
//!
//! ```
//! use embedded_hal_async::delay::DelayNs;
//! use embedded_io_async::{Read, Write};
//! use servo_wire::bus::{BusError, Goal, ServoBus};
//! use servo_wire::dynamixel::{DynamixelBus, DynamixelClient};
//! use servo_wire::port::{Automatic, LineConfig, Port};
//!
//! /// Finds two servos, has them hold, and sends them to the middle of their turns.
//! async fn to_the_middle(uart: impl Read + Write, timer: impl DelayNs) -> Result<(), BusError> {
//!     let port = Port::new(uart, Automatic, timer, LineConfig::uart(1_000_000));
//!     let mut bus: DynamixelBus<_, _, _> = DynamixelBus::new(DynamixelClient::new(port));
//!     let ids = [1, 2];
//!     for index in 0..ids.len() {
//!         bus.ping(&ids, index).await?;
//!         bus.set_torque(&ids, index, true).await?;
//!     }
//!     bus.write_goals(&ids.map(|id| Goal { id, position: 2048 })).await
//! }
//! ```
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

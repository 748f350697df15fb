//! Virtual servos: bytes and the time go in, bytes come out.
//!
//! - [`dynamixel_bus`]: Dynamixel X in full, the device side of protocol 2.0
//! - [`protocol1`]: Dynamixel AX and MX, Feetech STS and SCS, as far as a player needs them
//! - [`blender`]: what takes the live frames of the Blender add-on Servo Animation
//! - [`hobby`]: hobby servos on the pins of a virtual board: a PCA9685 and PWM pins
//! - [`virtual_bus`]: what all of them have in common, and what can happen to servos from outside
//! - [`serve`]: a bus on a pseudo terminal or a TCP port, in real time
//! - [`uart`]: a bus as the UART of a client in the same program
//!
//! What a Dynamixel X does follows ROBOTIS' e-Manual ("DYNAMIXEL Protocol 2.0", "XM430-W350"). Where the manual is
//! silent, the documentation of the function says what was chosen.
//!
//! Not simulated: load, heat, supply, and the time that bytes take on a wire. Answers are there at once.
//!
//! ```
//! use servo_wire::dynamixel::table::TORQUE_ENABLE;
//! use servo_wire::dynamixel::DynamixelClient;
//! use servo_wire::port::{Automatic, LineConfig, Port};
//! use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
//! use virtual_servos::uart::{InProcessUart, ZeroDelay};
//! use virtual_servos::virtual_bus::VirtualBus;
//!
//! // Two servos that answer to what is written to a UART.
//! let mut servos = DynamixelServos::new(&DynamixelConfig::with_ids(&[1, 2]))?;
//! let mut now_us = 0;
//! let uart = InProcessUart::new(|bytes: &[u8]| {
//!     now_us += 1000;
//!     servos.receive(bytes, now_us, &mut |event| println!("{event:?}"))
//! });
//!
//! // A client of servo-wire on that UART.
//! let port = Port::new(uart, Automatic, ZeroDelay, LineConfig::uart(1_000_000));
//! let mut client: DynamixelClient<_, _, _> = DynamixelClient::new(port);
//! let found = embassy_futures::block_on(client.ping(2))?;
//! assert_eq!(found.model, 1020);
//! let torque_on = embassy_futures::block_on(client.write(2, TORQUE_ENABLE.address, &[1]))?;
//! assert!(!torque_on, "no hardware error");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub mod blender;
pub mod config;
mod control_table;
pub mod dynamixel_bus;
mod dynamixel_servo;
mod group;
pub mod hobby;
mod instructions;
mod memory;
mod motion;
pub mod protocol1;
pub mod protocol1_models;
pub mod serve;
#[cfg(test)]
mod tests;
pub mod uart;
pub mod virtual_bus;

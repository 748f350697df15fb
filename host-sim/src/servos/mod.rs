//! Virtual servos: Dynamixel X-series in full ([`Bus`], the device side of protocol 2.0), Dynamixel AX and MX, Feetech STS and
//! SCS as far as a player needs them ([`ClassicBus`]), and what takes Blender's live frames ([`BlenderSink`]).
//!
//! Each is pure: bytes and the time go in, bytes come out. [`serve`] puts one on a pseudo terminal or a TCP port.
//! What a Dynamixel X does follows ROBOTIS' e-Manual ("DYNAMIXEL Protocol 2.0", "XM430-W350"); where the manual is silent
//! the doc comment of the function says what was chosen.
//!
//! - `model`: the XM430-W350's control table: defaults, ranges, access
//! - `memory`: that table with its rules for reading and writing
//! - `motion`: profile and movement of the shaft
//! - `servo`: one servo: memory, motion, torque, faults, watchdog
//! - `instructions`: one packet carried out on all servos
//! - `bus`: packets out of bytes, and time
//! - `series`, `classic`: servos with the frame of protocol 1.0, by their tables
//! - `blender`: what takes live frames
//! - `crowd`: the servos of a wire, time, and what happens to them from outside
//! - [`pins`]: hobby servos on a board's pins
//! - [`config`]: the servos that a `puppet.toml` names
//! - [`serve`]: a bus on a pty or a TCP port in real time

mod blender;
mod bus;
mod classic;
pub mod config;
mod crowd;
mod instructions;
pub mod line;
mod memory;
mod model;
mod motion;
pub mod pins;
mod series;
pub mod serve;
mod servo;
#[cfg(test)]
mod tests;

pub use blender::BlenderSink;
pub use bus::{Bus, BusConfig, ConfigError, Event, Wire};
pub use classic::ClassicBus;
pub use crowd::{Deed, START_US};
pub use servo::ServoConfig;

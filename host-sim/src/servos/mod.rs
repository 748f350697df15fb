//! Virtual Dynamixel X-series servos: the device side of protocol 2.0.
//!
//! [`Bus`] is pure: bytes and the time go in, bytes come out. [`serve`] puts one on a pseudo terminal or a TCP port.
//! What a servo does follows ROBOTIS' e-Manual ("DYNAMIXEL Protocol 2.0", "XM430-W350"); where the manual is silent
//! the doc comment of the function says what was chosen.
//!
//! - `model`: the XM430-W350's control table: defaults, ranges, access
//! - `memory`: that table with its rules for reading and writing
//! - `motion`: profile and movement of the shaft
//! - `servo`: one servo: memory, motion, torque, faults, watchdog
//! - `instructions`: one packet carried out on all servos
//! - `bus`: packets out of bytes, and time
//! - [`config`]: the servos that a `puppet.toml` names
//! - [`serve`]: a bus on a pty or a TCP port in real time

mod bus;
pub mod config;
mod instructions;
pub mod line;
mod memory;
mod model;
mod motion;
pub mod serve;
mod servo;
#[cfg(test)]
mod tests;

pub use bus::{Bus, BusConfig, ConfigError, Deed, Event, START_US};
pub use servo::ServoConfig;

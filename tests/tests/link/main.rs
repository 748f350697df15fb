//! The link between a host and a device: end to end on the virtual device, over lines that break, and fuzzed.
#![allow(clippy::unwrap_used)]

mod device_command;
mod flash;
mod fuzz;
mod session;
mod soak;
mod stranger;
mod uploads;
mod virtual_device;
mod wrong_devices;

//! The parts of the command `bunraku` that tests and boards use as a library.
#![forbid(unsafe_code)]

pub mod files;
mod qemu_log;
pub mod puppet;
pub mod qemu;
pub mod servos;

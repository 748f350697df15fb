//! The parts of the command `bunraku` that tests and boards use as a library.
#![forbid(unsafe_code)]

pub mod board;
pub mod clip;
pub mod cycle_limit;
pub mod device;
pub mod files;
pub mod flash;
pub mod image;
pub mod link;
pub mod peers;
pub mod play;
pub mod plot;
pub mod ports;
pub mod profile;
pub mod puppet;
pub mod qemu;
mod qemu_log;
pub mod rd;
pub mod rp2040js;
pub mod servos;
pub mod show;

//! One file per subcommand: its arguments and what it does.

pub mod bench;
pub mod compare;
pub mod decode;
pub mod demo;
pub mod device;
pub mod emulate;
pub mod encode;
mod frames;
pub mod image;
pub mod info;
mod input;
pub mod monitor;
pub mod optimize;
pub mod play;
pub mod profile;
pub mod puppet;
pub mod push;
pub mod qemu;
pub mod rd;
mod rd_psnr;
pub mod servos;
pub mod show;
pub mod stream;
pub mod table1;
pub mod train;
pub mod wearable;

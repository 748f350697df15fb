//! One file per subcommand: its arguments and what it does.

pub mod bench;
pub mod compare;
pub mod decode;
pub mod demo;
pub mod encode;
pub mod image;
pub mod info;
mod input;
pub mod optimize;
pub mod play;
pub mod profile;
pub mod puppet;
pub mod qemu;
pub mod rd;
mod rd_psnr;
pub mod servos;
pub mod show;
pub mod table1;
pub mod train;
pub mod wearable;

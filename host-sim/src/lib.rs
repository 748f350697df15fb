//! The command `bunraku` as a library: all of it but the reading of arguments and the printing of results, which are in
//! `src/main.rs` and `src/commands`. Tests use this library; boards do not.
//!
//! # Rooms
//!
//! What is here binds other crates together. What can stand alone is a crate of its own: `puppet-file` reads
//! puppet.toml, `virtual-servos` answers bus packets, `thumb-cycles` simulates a Cortex-M, `mocap` reads recordings,
//! `encoder` makes clips, and `firmware` plays them.
//!
//! | room | what it does |
//! |---|---|
//! | [`files`], [`clip`] | reads and writes files; opens a clip of either container |
//! | [`signals`], [`terminal`] | ends in order and leaves nothing behind; shows names out of files |
//! | [`puppet`] | holds a puppet against a clip: channels, limits, time on its buses; writes what was calibrated |
//! | [`play`] | plays a clip on virtual servos: here, on a simulated core, under QEMU, on an emulated Pico |
//! | [`ports`] | plays a clip on servos on serial ports of this machine |
//! | [`live_frames`] | takes the live frames of the Blender add-on, which [`ports`] follows |
//! | [`puppet_servos`] | the virtual servos of a puppet, and what happens to them in a show |
//! | [`show`] | plays a show of several clips, and reports it |
//! | [`device`], [`flash`] | a virtual device: the firmware with clips in virtual flash, which a host talks to |
//! | [`link`] | the host's side of the link to a device |
//! | [`board`], [`image`] | builds images for boards |
//! | [`qemu`], [`rp2040js`] | runs an image in another program's emulator |
//! | [`profile`], [`cycle_limit`] | counts cycles of the decoder; finds a clip whose frames a core can afford |
//! | [`rd`], [`peers`] | curves of rate and distortion; our codecs beside general compressors |
//! | [`plot`] | draws what others measured |
#![forbid(unsafe_code)]

pub mod board;
pub mod clip;
pub mod cycle_limit;
pub mod device;
mod file_kind;
pub mod files;
pub mod filmstrip;
pub mod flash;
pub mod flash_file;
pub mod image;
pub mod link;
pub mod live_frames;
pub mod peers;
pub mod play;
pub mod plot;
pub mod ports;
pub mod profile;
pub mod puppet;
pub mod puppet_servos;
pub mod qemu;
mod qemu_log;
pub mod rd;
pub mod rp2040js;
pub mod settings;
pub mod show;
pub mod signals;
pub mod terminal;

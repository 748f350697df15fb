//! The host's side of a link to a device (docs/LINK.md): over a serial port, a pseudo terminal or TCP.
//!
//! - [`port`]: lines, with a time limit on everything
//! - [`key_file`]: the key of a line that needs one
//! - [`client`]: requests until they are answered, and what a device says unasked
//! - [`upload`]: a clip into a device's flash, also over a line that breaks
//! - [`streaming`]: a clip block by block while it plays

pub mod client;
pub mod key_file;
pub mod port;
pub mod streaming;
pub mod upload;

pub use client::{Client, Line, LinkError, PATIENCE};

//! What all boards share: the linked-in clip and map, the show that plays them, and what happens after a panic.
//!
//! A board's `main` brings a UART, a direction pin, a trigger pin, a watchdog and the reason of its start ([`Wiring`]), and
//! [`Puppet::play`] does the rest. Clip and map are chosen when the image is built: see build.rs.
#![no_std]

#[cfg(feature = "rtt")]
mod buffers;
#[cfg_attr(mclip, path = "clip_mclip.rs")]
#[cfg_attr(not(mclip), path = "clip_qmd.rs")]
mod clip;
#[cfg(feature = "link")]
mod flash;
#[cfg(feature = "rtt")]
mod halt;
#[cfg(feature = "link")]
mod hobby;
#[cfg(feature = "link")]
mod host;
mod idle_line;
mod show;

#[cfg(feature = "rtt")]
pub use buffers::buffers;
#[cfg(feature = "link")]
pub use buffers::host_buffers;
#[cfg(feature = "link")]
pub use flash::{InPlace, NoFlash};
#[cfg(feature = "link")]
pub use hobby::Hobby;
#[cfg(feature = "link")]
pub use host::Host;
pub use idle_line::{Busy, IdleLine};
pub use show::{Button, Puppet, Wiring};

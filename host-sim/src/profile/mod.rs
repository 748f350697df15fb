//! What a clip costs on a microcontroller: cycles, memory and energy, from the machine code that would run there.
//!
//! The clip is linked into a bare image (`tests/profile-image`), which is built for the core and run on the simulator
//! in `thumb-cycles`. A frame's cycles are those from the first instruction of its function to the return,
//! so measuring adds nothing to the image; every frame is compared with what the decoder gives on this machine. With a
//! puppet, a whole tick stands where a frame would.

pub mod baseline;
pub mod elf;
mod expect;
pub mod flame;
pub mod html;
mod images;
pub mod measure;
pub mod parts;
pub mod report;
pub(crate) mod svg;
pub mod wearable;

pub use expect::{frames, ticks};
pub use images::{images, mclip_images, prefix_images, tick_images, wearable_image};
pub use measure::Measured;
pub use report::{CoreReport, Report};

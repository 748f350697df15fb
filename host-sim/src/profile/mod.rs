//! What a clip costs on a microcontroller: cycles, memory and energy, from the machine code that would run there.
//!
//! A bare image (`tests/profile-image`) is built for the core once, the clip is put into simulated flash beside it, and
//! both run on the simulator `thumb-cycles`. A frame's cycles are those from the first instruction of its function to the return,
//! so measuring adds nothing to the image; every frame is compared with what the decoder gives on this machine. With a
//! puppet, a whole tick stands where a frame would.

pub mod baseline;
pub mod elf;
mod expect;
mod flame;
pub mod html;
mod images;
pub mod loaded;
pub mod measure;
pub mod parts;
pub mod report;
pub mod wearable;

pub use expect::{frames, ticks};
pub use images::{
    images, load_mclip, mclip_decoders, mclip_images, prefix_images, tick_images, wearable_image,
};
pub use loaded::LoadedImage;
pub use measure::Measured;
pub use report::{CoreReport, Report};

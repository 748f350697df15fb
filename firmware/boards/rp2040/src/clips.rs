//! The flash for clips: its second megabyte, by the boot ROM's functions, and mapped into memory.

use board_support::InPlace;
use embassy_rp::Peri;
use embassy_rp::flash::{Blocking, Flash};
use embassy_rp::peripherals::FLASH;
use embedded_storage::nor_flash::NorFlash;
use firmware::store::Layout;

const MB: usize = 1 << 20;

/// Flash that is used: the image's and the clips'. The Pico 2 has more.
const BYTES: usize = 2 * MB;

type Driver = Flash<'static, FLASH, Blocking, BYTES>;

const SECTOR: u32 = <Driver as NorFlash>::ERASE_SIZE as u32;

/// Behind the image: memory.x keeps it out of here.
const START: u32 = MB as u32;

const END: u32 = BYTES as u32;

/// Two sectors for the directory, the others for clips.
pub const LAYOUT: Layout = Layout { directory: [START, START + SECTOR], clips: START + 2 * SECTOR..END };

/// The flash.
pub type Clips = InPlace<Driver, 0x1000_0000, BYTES>;

/// Takes it over.
pub fn flash(flash: Peri<'static, FLASH>) -> Clips {
    // SAFETY: the chip maps it there, the image runs from it, and memory.x keeps the image out of the clips.
    unsafe { Clips::new(Flash::new_blocking(flash), START..END) }
}

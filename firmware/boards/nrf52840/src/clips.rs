//! The flash for clips: the second half of the chip's own, in place.

use board_support::InPlace;
use embassy_nrf::Peri;
use embassy_nrf::nvmc::{FLASH_SIZE, Nvmc, PAGE_SIZE};
use embassy_nrf::peripherals::NVMC;
use firmware::store::Layout;

const PAGE: u32 = PAGE_SIZE as u32;

/// Behind the image: memory.x keeps it out of here.
const START: u32 = FLASH_SIZE as u32 / 2;

const END: u32 = FLASH_SIZE as u32;

/// Two pages for the directory, the others for clips.
pub const LAYOUT: Layout = Layout { directory: [START, START + PAGE], clips: START + 2 * PAGE..END };

/// The flash.
pub type Clips = InPlace<Nvmc<'static>, 0, FLASH_SIZE>;

/// Takes it over.
pub fn flash(flash: Peri<'static, NVMC>) -> Clips {
    // SAFETY: the chip's flash begins at address 0, the image runs from it, and memory.x keeps the image out of the clips.
    unsafe { Clips::new(Nvmc::new(flash), START..END) }
}

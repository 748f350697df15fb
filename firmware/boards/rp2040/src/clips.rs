//! The flash for clips: its second megabyte, by the boot ROM's functions, and mapped into memory.

use core::slice::from_raw_parts;
use embassy_rp::Peri;
use embassy_rp::flash::{Blocking, Error, Flash};
use embassy_rp::peripherals::FLASH;
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use firmware::store::{Layout, Mapped};

const MB: usize = 1 << 20;

/// Flash that is used: the image's and the clips'. The Pico 2 has more.
const BYTES: usize = 2 * MB;

/// Where flash is in memory.
const BASE: usize = 0x1000_0000;

const SECTOR: u32 = <Flash<'_, FLASH, Blocking, BYTES> as NorFlash>::ERASE_SIZE as u32;

/// Behind the image: memory.x keeps it out of here.
const START: u32 = MB as u32;

/// Two sectors for the directory, the others for clips.
pub const LAYOUT: Layout =
    Layout { directory: [START, START + SECTOR], clips: START + 2 * SECTOR..BYTES as u32 };

/// The flash.
pub struct Clips(Flash<'static, FLASH, Blocking, BYTES>);

impl Clips {
    /// Takes it over.
    pub fn new(flash: Peri<'static, FLASH>) -> Self {
        Self(Flash::new_blocking(flash))
    }
}

impl ErrorType for Clips {
    type Error = Error;
}

impl ReadNorFlash for Clips {
    const READ_SIZE: usize = 1;

    fn read(&mut self, at: u32, bytes: &mut [u8]) -> Result<(), Error> {
        ReadNorFlash::read(&mut self.0, at, bytes)
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for Clips {
    const WRITE_SIZE: usize = <Flash<'_, FLASH, Blocking, BYTES> as NorFlash>::WRITE_SIZE;
    const ERASE_SIZE: usize = SECTOR as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        NorFlash::erase(&mut self.0, from, to)
    }

    fn write(&mut self, at: u32, bytes: &[u8]) -> Result<(), Error> {
        NorFlash::write(&mut self.0, at, bytes)
    }
}

impl Mapped for Clips {
    fn mapped(&self, at: u32, bytes: u32) -> Option<&[u8]> {
        self.lend(at, bytes)
    }

    fn lend(&self, at: u32, bytes: u32) -> Option<&'static [u8]> {
        let (at, bytes) = (at as usize, bytes as usize);
        let inside = at.checked_add(bytes).is_some_and(|end| end <= BYTES);
        // SAFETY: flash is there for ever, and any bytes are valid. The store erases and writes nothing that is lent.
        inside.then(|| unsafe { from_raw_parts((BASE + at) as *const u8, bytes) })
    }
}

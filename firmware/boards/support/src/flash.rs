//! Flash that is mapped into memory, for clips.

use core::slice::from_raw_parts;
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use firmware::store::Mapped;

/// A driver's flash, whose byte 0 is at the address `BASE`. Of it `BYTES` are used: the image's and the clips'.
pub struct InPlace<F, const BASE: usize, const BYTES: usize>(F);

impl<F: NorFlash, const BASE: usize, const BYTES: usize> InPlace<F, BASE, BYTES> {
    /// Takes it over.
    ///
    /// # Safety
    /// The driver's flash can be read at `BASE`, all `BYTES` of it and for ever.
    pub const unsafe fn new(flash: F) -> Self {
        Self(flash)
    }
}

impl<F: ErrorType, const BASE: usize, const BYTES: usize> ErrorType for InPlace<F, BASE, BYTES> {
    type Error = F::Error;
}

impl<F: ReadNorFlash, const BASE: usize, const BYTES: usize> ReadNorFlash for InPlace<F, BASE, BYTES> {
    const READ_SIZE: usize = F::READ_SIZE;

    fn read(&mut self, at: u32, bytes: &mut [u8]) -> Result<(), F::Error> {
        self.0.read(at, bytes)
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl<F: NorFlash, const BASE: usize, const BYTES: usize> NorFlash for InPlace<F, BASE, BYTES> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), F::Error> {
        self.0.erase(from, to)
    }

    fn write(&mut self, at: u32, bytes: &[u8]) -> Result<(), F::Error> {
        self.0.write(at, bytes)
    }
}

impl<F: NorFlash, const BASE: usize, const BYTES: usize> Mapped for InPlace<F, BASE, BYTES> {
    fn mapped(&self, at: u32, bytes: u32) -> Option<&[u8]> {
        self.lend(at, bytes)
    }

    fn lend(&self, at: u32, bytes: u32) -> Option<&'static [u8]> {
        let (at, bytes) = (at as usize, bytes as usize);
        let inside = at.checked_add(bytes).is_some_and(|end| end <= BYTES);
        // SAFETY: what `new` was promised, and any bytes are valid. The store erases and writes nothing that is lent.
        inside.then(|| unsafe { from_raw_parts((BASE + at) as *const u8, bytes) })
    }
}

/// The flash of a board that keeps no clips: there is none.
pub enum NoFlash {}

impl ErrorType for NoFlash {
    type Error = core::convert::Infallible;
}

impl ReadNorFlash for NoFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, _: u32, _: &mut [u8]) -> Result<(), Self::Error> {
        match *self {}
    }

    fn capacity(&self) -> usize {
        match *self {}
    }
}

impl NorFlash for NoFlash {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = 1;

    fn erase(&mut self, _: u32, _: u32) -> Result<(), Self::Error> {
        match *self {}
    }

    fn write(&mut self, _: u32, _: &[u8]) -> Result<(), Self::Error> {
        match *self {}
    }
}

impl Mapped for NoFlash {
    fn mapped(&self, _: u32, _: u32) -> Option<&[u8]> {
        match *self {}
    }

    fn lend(&self, _: u32, _: u32) -> Option<&'static [u8]> {
        match *self {}
    }
}

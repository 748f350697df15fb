//! Flash that is mapped into memory, for clips.

use core::ops::Range;
use core::slice::from_raw_parts;
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use firmware::store::{GuardedFlash, Lease, Leases, MappedFlash};

/// A driver's flash, whose byte 0 is at the address `BASE`. It has `BYTES`, of which some are for clips; the others, where the
/// image is, are only read.
pub struct InPlace<F, const BASE: usize, const BYTES: usize>(GuardedFlash<F>);

impl<F: NorFlash, const BASE: usize, const BYTES: usize> InPlace<F, BASE, BYTES> {
    /// Takes it over. `clips` is what may be erased and written.
    ///
    /// # Safety
    /// The driver's flash can be read at `BASE`, all `BYTES` of it and for ever; nothing else changes it; and no variable of the
    /// program is in `clips`.
    pub const unsafe fn new(flash: F, clips: Range<u32>) -> Self {
        Self(GuardedFlash::new(flash, clips))
    }

    /// The bytes, and no longer than the caller says.
    ///
    /// # Safety
    /// They are not erased or written in the meantime.
    unsafe fn bytes<'b>(at: u32, bytes: u32) -> Option<&'b [u8]> {
        let (at, bytes) = (at as usize, bytes as usize);
        let inside = at.checked_add(bytes).is_some_and(|end| end <= BYTES);
        // SAFETY: `new` was promised that they can be read, any bytes are valid, and the caller promises that they stay.
        inside.then(|| unsafe { from_raw_parts((BASE + at) as *const u8, bytes) })
    }
}

impl<F: NorFlash, const BASE: usize, const BYTES: usize> ErrorType for InPlace<F, BASE, BYTES> {
    type Error = <GuardedFlash<F> as ErrorType>::Error;
}

impl<F: NorFlash, const BASE: usize, const BYTES: usize> ReadNorFlash for InPlace<F, BASE, BYTES> {
    const READ_SIZE: usize = F::READ_SIZE;

    fn read(&mut self, at: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.0.read(at, bytes)
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl<F: NorFlash, const BASE: usize, const BYTES: usize> NorFlash for InPlace<F, BASE, BYTES> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.0.erase(from, to)
    }

    fn write(&mut self, at: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        self.0.write(at, bytes)
    }
}

impl<F: NorFlash, const BASE: usize, const BYTES: usize> MappedFlash for InPlace<F, BASE, BYTES> {
    fn mapped(&self, at: u32, bytes: u32) -> Option<&[u8]> {
        // SAFETY: to erase or write, the flash has to be borrowed mutably, which it is not as long as these bytes are.
        unsafe { Self::bytes(at, bytes) }
    }

    fn lend(&mut self, at: u32, bytes: u32) -> Option<Lease> {
        // SAFETY: the bytes are only read through the lease, until which is back `GuardedFlash` erases and writes none of them. A
        // lease that is refused is not read.
        let bytes = unsafe { Self::bytes(at, bytes)? };
        self.0.lend(at, bytes)
    }

    fn take_back(&mut self, lease: Lease) {
        self.0.take_back(lease);
    }

    fn leases(&self) -> &Leases {
        self.0.leases()
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

impl MappedFlash for NoFlash {
    fn mapped(&self, _: u32, _: u32) -> Option<&[u8]> {
        match *self {}
    }

    fn lend(&mut self, _: u32, _: u32) -> Option<Lease> {
        match *self {}
    }

    fn take_back(&mut self, _: Lease) {
        match *self {}
    }

    fn leases(&self) -> &Leases {
        match *self {}
    }
}

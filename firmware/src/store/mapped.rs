//! Flash that clips are read from in place.

use embedded_storage::nor_flash::NorFlash;

/// Bytes that are written in one operation.
pub const PAGE_BYTES: usize = 256;

/// NOR flash that is mapped into memory.
///
/// A board implements this with its own `unsafe`: reads go to the address at which its flash is mapped. What makes that
/// sound is kept by [`Store`], for all flash of its [`Layout`]: it never erases or writes where a slice that
/// [`lend`](Self::lend) gave is in use, and those of [`mapped`](Self::mapped) end with the borrow of the flash.
pub trait Mapped: NorFlash {
    /// Bytes in place; `None` outside the flash.
    fn mapped(&self, at: u32, bytes: u32) -> Option<&[u8]>;

    /// Bytes in place for as long as the caller keeps them. The host's flash, which has no address, leaks a copy.
    fn lend(&self, at: u32, bytes: u32) -> Option<&'static [u8]>;

    /// Bytes of the sector that begins at `at`: what an erase takes. Flash of different sectors says it here.
    fn sector_bytes(&self, at: u32) -> u32 {
        let _ = at;
        u32::try_from(Self::ERASE_SIZE).unwrap_or(u32::MAX)
    }
}

impl<F: Mapped> Mapped for &mut F {
    fn mapped(&self, at: u32, bytes: u32) -> Option<&[u8]> {
        F::mapped(self, at, bytes)
    }

    fn lend(&self, at: u32, bytes: u32) -> Option<&'static [u8]> {
        F::lend(self, at, bytes)
    }

    fn sector_bytes(&self, at: u32) -> u32 {
        F::sector_bytes(self, at)
    }
}

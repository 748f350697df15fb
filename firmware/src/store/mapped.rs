//! Flash that clips are read from in place.

use super::lease::{Lease, Leases};
use core::ops::Range;
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// Bytes that are written in one operation.
pub const PAGE_BYTES: usize = 256;

/// NOR flash that is mapped into memory, so that its bytes are read in place.
///
/// Bytes can be read in two ways, and neither can be misused:
///
/// - [`mapped`](Self::mapped) borrows the flash, and `erase` and `write` need that borrow to have ended:
///
///   ```compile_fail,E0502
///   # fn with<F: firmware::store::MappedFlash>(flash: &mut F) -> Option<u8> {
///   let bytes = flash.mapped(0, 4096)?;
///   flash.erase(0, 4096).ok()?;
///   bytes.first().copied()
///   # }
///   ```
///
/// - [`lend`](Self::lend) gives a [`Lease`], which does not borrow the flash: a decoder reads a clip while another one is
///   uploaded beside it. The flash itself refuses to erase or write what is lent.
///
/// A board implements this over [`GuardedFlash`], with `unsafe` for the one thing that only the board knows: at which address
/// its flash can be read.
pub trait MappedFlash: NorFlash {
    /// Bytes in place; `None` outside the flash.
    fn mapped(&self, at: u32, bytes: u32) -> Option<&[u8]>;

    /// Bytes in place that stay as they are until [`take_back`](Self::take_back); `None` outside of what is erased and written
    /// here, and where [`LEASES`](super::LEASES) are out. The host's flash, which has no address, leaks a copy.
    fn lend(&mut self, at: u32, bytes: u32) -> Option<Lease>;

    /// Takes a lease back that nobody reads any more.
    fn take_back(&mut self, lease: Lease);

    /// What is lent.
    fn leases(&self) -> &Leases;

    /// Bytes of the sector that begins at `at`: what an erase takes. Flash of different sectors says it here.
    fn sector_bytes(&self, at: u32) -> u32 {
        let _ = at;
        u32::try_from(Self::ERASE_SIZE).unwrap_or(u32::MAX)
    }
}

impl<F: MappedFlash> MappedFlash for &mut F {
    fn mapped(&self, at: u32, bytes: u32) -> Option<&[u8]> {
        F::mapped(self, at, bytes)
    }

    fn lend(&mut self, at: u32, bytes: u32) -> Option<Lease> {
        F::lend(self, at, bytes)
    }

    fn take_back(&mut self, lease: Lease) {
        F::take_back(self, lease);
    }

    fn leases(&self) -> &Leases {
        F::leases(self)
    }

    fn sector_bytes(&self, at: u32) -> u32 {
        F::sector_bytes(self, at)
    }
}

/// Why a guarded flash does not erase or write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum GuardedFlashError<E> {
    /// The bytes are not among those that are for clips: the image is there, or nothing.
    Outside,
    /// A decoder reads the bytes.
    Lent,
    /// The driver's own.
    Driver(E),
}

impl<E: NorFlashError> NorFlashError for GuardedFlashError<E> {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Outside => NorFlashErrorKind::OutOfBounds,
            Self::Lent => NorFlashErrorKind::Other,
            Self::Driver(error) => error.kind(),
        }
    }
}

/// A driver's flash that erases and writes nothing outside of what is for clips, and nothing that is lent.
///
/// All of it is read through the driver; `erase` and `write` of anything else are errors. So what the linker placed in the same
/// chip stays as it is, and so does what a decoder reads.
#[derive(Debug)]
pub struct GuardedFlash<F> {
    driver: F,
    clips: Range<u32>,
    leases: Leases,
}

impl<F: NorFlash> GuardedFlash<F> {
    /// Takes a driver over. `clips` is what may be erased and written.
    pub const fn new(driver: F, clips: Range<u32>) -> Self {
        Self { driver, clips, leases: Leases::new() }
    }

    /// Whether these bytes are among those that may be erased and written.
    pub fn is_for_clips(&self, at: u32, bytes: u32) -> bool {
        at >= self.clips.start && at.checked_add(bytes).is_some_and(|end| end <= self.clips.end)
    }

    /// Notes that bytes are read in place; `None` where that is refused. `bytes` is what is at `at` of the flash.
    pub fn lend(&mut self, at: u32, bytes: &'static [u8]) -> Option<Lease> {
        let inside = u32::try_from(bytes.len()).is_ok_and(|length| self.is_for_clips(at, length));
        if inside { self.leases.lend(at, bytes) } else { None }
    }

    /// Takes a lease back.
    pub fn take_back(&mut self, lease: Lease) {
        self.leases.take_back(lease);
    }

    /// What is lent.
    pub const fn leases(&self) -> &Leases {
        &self.leases
    }

    fn check(&self, from: u32, to: u32) -> Result<(), GuardedFlashError<F::Error>> {
        if from < self.clips.start || to > self.clips.end {
            return Err(GuardedFlashError::Outside);
        }
        if self.leases.may_change(from, to) { Ok(()) } else { Err(GuardedFlashError::Lent) }
    }
}

impl<F: ErrorType> ErrorType for GuardedFlash<F> {
    type Error = GuardedFlashError<F::Error>;
}

impl<F: NorFlash> ReadNorFlash for GuardedFlash<F> {
    const READ_SIZE: usize = F::READ_SIZE;

    fn read(&mut self, at: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.driver.read(at, bytes).map_err(GuardedFlashError::Driver)
    }

    fn capacity(&self) -> usize {
        self.driver.capacity()
    }
}

impl<F: NorFlash> NorFlash for GuardedFlash<F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.check(from, to)?;
        self.driver.erase(from, to).map_err(GuardedFlashError::Driver)
    }

    fn write(&mut self, at: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        let length = u32::try_from(bytes.len()).map_err(|_| GuardedFlashError::Outside)?;
        self.check(at, at.checked_add(length).ok_or(GuardedFlashError::Outside)?)?;
        self.driver.write(at, bytes).map_err(GuardedFlashError::Driver)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flash of 16 sectors of 256 bytes that counts what it is asked.
    #[derive(Default)]
    struct Counting {
        erased: u32,
        written: u32,
    }

    impl ErrorType for Counting {
        type Error = NorFlashErrorKind;
    }

    impl ReadNorFlash for Counting {
        const READ_SIZE: usize = 1;

        fn read(&mut self, _: u32, _: &mut [u8]) -> Result<(), NorFlashErrorKind> {
            Ok(())
        }

        fn capacity(&self) -> usize {
            4096
        }
    }

    impl NorFlash for Counting {
        const WRITE_SIZE: usize = 4;
        const ERASE_SIZE: usize = 256;

        fn erase(&mut self, _: u32, _: u32) -> Result<(), NorFlashErrorKind> {
            self.erased += 1;
            Ok(())
        }

        fn write(&mut self, _: u32, _: &[u8]) -> Result<(), NorFlashErrorKind> {
            self.written += 1;
            Ok(())
        }
    }

    #[test]
    fn the_image_and_what_is_lent_are_neither_erased_nor_written() {
        static CLIP: [u8; 300] = [7; 300];
        let mut flash = GuardedFlash::new(Counting::default(), 1024..3072);
        assert_eq!(flash.erase(768, 1280), Err(GuardedFlashError::Outside));
        assert_eq!(flash.erase(2816, 3328), Err(GuardedFlashError::Outside));
        assert_eq!(flash.write(1020, &[0; 8]), Err(GuardedFlashError::Outside));
        assert_eq!(flash.write(u32::MAX, &[0; 8]), Err(GuardedFlashError::Outside));
        assert!(flash.lend(1000, &CLIP).is_none() && flash.lend(3000, &CLIP).is_none());
        let lease = flash.lend(1280, &CLIP).unwrap();
        assert_eq!(flash.erase(1024, 1536), Err(GuardedFlashError::Lent));
        assert_eq!(flash.erase(1536, 1792), Err(GuardedFlashError::Lent));
        assert_eq!(flash.write(1576, &[0; 4]), Err(GuardedFlashError::Lent));
        assert_eq!((flash.driver.erased, flash.driver.written), (0, 0));
        flash.erase(1024, 1280).unwrap();
        flash.write(1580, &[0; 4]).unwrap();
        flash.take_back(lease);
        flash.erase(1024, 3072).unwrap();
        flash.write(1280, &[0; 256]).unwrap();
        assert_eq!((flash.driver.erased, flash.driver.written), (2, 2));
    }
}

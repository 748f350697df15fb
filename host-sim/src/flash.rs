//! NOR flash whose power can be cut in the middle of every operation.
//!
//! As strict as [`NorFlash`] allows: a word that was written is not written again before a whole erase, and after a cut the
//! words that were being written, or the sector that was being erased, hold what [`Tear`] says.

use crate::flash_file;
use anyhow::Context;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use firmware::store::{Lease, Leases, MappedFlash};
use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

/// Bytes of a word.
const WORD: usize = 4;

/// What a cut leaves of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tear {
    /// It had not begun.
    Nothing,
    /// It was done for the first half of its bytes.
    FirstHalf,
    /// It was done for the second half.
    SecondHalf,
    /// It was done for some of the bits, by this seed.
    Bits(u64),
    /// The bytes hold anything, by this seed.
    Garbage(u64),
    /// It was done.
    Whole,
}

impl Tear {
    /// One of each.
    pub const ALL: [Self; 6] =
        [Self::Nothing, Self::FirstHalf, Self::SecondHalf, Self::Bits(1), Self::Garbage(2), Self::Whole];
}

/// Flash of sectors of `SECTOR` bytes.
#[derive(Debug)]
pub struct Flash<const SECTOR: usize> {
    bytes: Vec<u8>,
    /// Whether a word was written since its erase.
    written: Vec<bool>,
    file: Option<File>,
    operations: u64,
    erases: Vec<u32>,
    cut: Option<(u64, Tear)>,
    dead: bool,
    leases: Leases,
}

impl<const SECTOR: usize> Clone for Flash<SECTOR> {
    /// A copy that is in no file.
    fn clone(&self) -> Self {
        let Self { bytes, written, operations, erases, cut, dead, leases, file: _ } = self;
        let (bytes, written, erases, leases) =
            (bytes.clone(), written.clone(), erases.clone(), leases.clone());
        Self { bytes, written, erases, file: None, operations: *operations, cut: *cut, dead: *dead, leases }
    }
}

impl<const SECTOR: usize> Flash<SECTOR> {
    /// Erased flash of so many sectors.
    pub fn new(sectors: usize) -> Self {
        Self::from_image(vec![0xff; sectors * SECTOR])
    }

    /// Flash that holds these bytes: whole sectors, or erased behind them.
    pub fn from_image(mut bytes: Vec<u8>) -> Self {
        bytes.resize(bytes.len().next_multiple_of(SECTOR), 0xff);
        let written = bytes.chunks(WORD).map(|word| word.iter().any(|&byte| byte != 0xff)).collect();
        let erases = vec![0; bytes.len() / SECTOR];
        let leases = Leases::new();
        Self { bytes, written, file: None, operations: 0, erases, cut: None, dead: false, leases }
    }

    /// Flash of so many sectors that is kept in a file ([`flash_file`]). Every operation writes through.
    ///
    /// # Errors
    /// As [`flash_file::open`], and where the file cannot be written.
    pub fn open(path: &Path, sectors: usize) -> anyhow::Result<Self> {
        let (file, bytes) = flash_file::open(path, sectors, SECTOR)?;
        let mut flash = Self { file: Some(file), ..Self::from_image(bytes) };
        flash.write_through(0, sectors * SECTOR).context("cannot write the flash's file")?;
        Ok(flash)
    }

    /// Writes a range of bytes to the file.
    fn write_through(&mut self, from: usize, to: usize) -> std::io::Result<()> {
        let Some(file) = &mut self.file else { return Ok(()) };
        file.seek(SeekFrom::Start(from as u64))?;
        file.write_all(&self.bytes[from..to])
    }

    /// All bytes.
    pub fn image(&self) -> &[u8] {
        &self.bytes
    }

    /// All bytes, to be damaged.
    pub fn image_mut(&mut self) -> &mut [u8] {
        &mut self.bytes
    }

    /// Writes and erases so far.
    pub const fn operations(&self) -> u64 {
        self.operations
    }

    /// How often each sector was erased.
    pub fn erases(&self) -> &[u32] {
        &self.erases
    }

    /// Cuts the power in the write or erase after `operations` more of them. All that follow fail, until
    /// [`power_on`](Self::power_on).
    pub const fn cut_after(&mut self, operations: u64, tear: Tear) {
        self.cut = Some((self.operations + operations, tear));
    }

    /// Whether the power is cut.
    pub const fn is_dead(&self) -> bool {
        self.dead
    }

    /// The power comes back, and is not to be cut any more.
    pub const fn power_on(&mut self) {
        self.dead = false;
        self.cut = None;
    }

    fn check_leases(&self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        if self.leases.may_change(from, to) { Ok(()) } else { Err(NorFlashErrorKind::Other) }
    }

    /// Brings the bytes from `at` to `goal`, or what a cut leaves of that.
    fn operate(&mut self, at: usize, goal: &[u8], erases: bool) -> Result<(), NorFlashErrorKind> {
        if self.dead {
            return Err(NorFlashErrorKind::Other);
        }
        let end = at + goal.len();
        let cut = self.cut.filter(|&(operation, _)| operation == self.operations).map(|(_, tear)| tear);
        self.operations += 1;
        self.dead = cut.is_some();
        let tear = cut.unwrap_or(Tear::Whole);
        let half = goal.len() / 2;
        let bytes = &mut self.bytes[at..end];
        match tear {
            Tear::Nothing => {}
            Tear::FirstHalf => bytes[..half].copy_from_slice(&goal[..half]),
            Tear::SecondHalf => bytes[half..].copy_from_slice(&goal[half..]),
            Tear::Bits(seed) => {
                let mask = random(seed ^ self.operations);
                bytes.iter_mut().zip(goal).zip(mask).for_each(|((byte, goal), mask)| {
                    *byte = *byte & !mask | goal & mask;
                });
            }
            Tear::Garbage(seed) => {
                let garbage = random(seed ^ self.operations);
                bytes.iter_mut().zip(garbage).for_each(|(byte, garbage)| *byte = garbage);
            }
            Tear::Whole => bytes.copy_from_slice(goal),
        }
        let whole = erases && tear == Tear::Whole;
        self.written[at / WORD..end / WORD].fill(!whole);
        if erases {
            self.erases[at / SECTOR] += 1;
        }
        self.write_through(at, end).map_err(|_| NorFlashErrorKind::Other)?;
        if self.dead { Err(NorFlashErrorKind::Other) } else { Ok(()) }
    }
}

/// Bytes without a pattern.
fn random(seed: u64) -> impl Iterator<Item = u8> {
    let mut rng = fastrand::Rng::with_seed(seed);
    std::iter::repeat_with(move || rng.u8(..))
}

impl<const SECTOR: usize> ErrorType for Flash<SECTOR> {
    type Error = NorFlashErrorKind;
}

impl<const SECTOR: usize> ReadNorFlash for Flash<SECTOR> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        let at = offset as usize;
        bytes.copy_from_slice(&self.bytes[at..at + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const SECTOR: usize> NorFlash for Flash<SECTOR> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        self.check_leases(from, to)?;
        (from as usize..to as usize)
            .step_by(SECTOR)
            .try_for_each(|at| self.operate(at, &[0xff; SECTOR], true))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        let at = offset as usize;
        self.check_leases(offset, (at + bytes.len()) as u32)?;
        let words = at / WORD..(at + bytes.len()) / WORD;
        if self.written[words].iter().any(|&written| written) {
            return Err(NorFlashErrorKind::Other);
        }
        self.operate(at, bytes, false)
    }
}

impl<const SECTOR: usize> MappedFlash for Flash<SECTOR> {
    fn mapped(&self, at: u32, bytes: u32) -> Option<&[u8]> {
        self.bytes.get(at as usize..)?.get(..bytes as usize)
    }

    /// Leaks a copy: a vector has no address for ever.
    fn lend(&mut self, at: u32, bytes: u32) -> Option<Lease> {
        let copy = self.mapped(at, bytes)?.to_vec();
        self.leases.lend(at, Box::leak(copy.into_boxed_slice()))
    }

    fn take_back(&mut self, lease: Lease) {
        self.leases.take_back(lease);
    }

    fn leases(&self) -> &Leases {
        &self.leases
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Small = Flash<256>;

    #[test]
    fn a_word_is_written_once_after_an_erase() {
        let mut flash = Small::new(2);
        assert_eq!(flash.write(0, &[1, 2, 3, 4]), Ok(()));
        assert_eq!(flash.write(0, &[0; 4]), Err(NorFlashErrorKind::Other));
        assert_eq!(flash.write(2, &[0; 4]), Err(NorFlashErrorKind::NotAligned));
        assert_eq!(flash.write(512, &[0; 4]), Err(NorFlashErrorKind::OutOfBounds));
        assert_eq!(flash.mapped(0, 5), Some(&[1, 2, 3, 4, 0xff][..]));
        assert_eq!(flash.erase(0, 256), Ok(()));
        assert_eq!(flash.write(0, &[5; 4]), Ok(()));
        let lease = flash.lend(0, 4).unwrap();
        assert_eq!(lease.bytes(), [5; 4]);
        assert_eq!(flash.erase(0, 256), Err(NorFlashErrorKind::Other), "it is read");
        flash.take_back(lease);
        assert_eq!((flash.operations(), flash.erases()), (3, &[1, 0][..]));
        assert_eq!(flash.mapped(500, 13), None);
    }

    #[test]
    fn a_cut_leaves_what_it_says_and_nothing_works_after_it() {
        for tear in Tear::ALL {
            let mut flash = Small::new(2);
            flash.write(0, &[0; 256]).unwrap();
            flash.cut_after(1, tear);
            flash.write(256, &[7; 4]).unwrap();
            assert_eq!(flash.erase(0, 256), Err(NorFlashErrorKind::Other));
            assert!(flash.is_dead());
            let image = flash.image()[..256].to_vec();
            let count = |byte| image.iter().filter(|&&found| found == byte).count();
            match tear {
                Tear::Nothing => assert_eq!(count(0), 256),
                Tear::FirstHalf => assert!(image[..128] == [0xff; 128] && image[128..] == [0; 128]),
                Tear::SecondHalf => assert!(image[..128] == [0; 128] && image[128..] == [0xff; 128]),
                Tear::Bits(_) | Tear::Garbage(_) => assert!(count(0) < 20 && count(0xff) < 20),
                Tear::Whole => assert_eq!(count(0xff), 256),
            }
            assert_eq!(flash.write(260, &[7; 4]), Err(NorFlashErrorKind::Other));
            flash.power_on();
            assert_eq!(flash.image()[..256], image);
            assert_eq!(flash.write(260, &[7; 4]), Ok(()));
            // A sector is only erased by a whole erase.
            assert_eq!(flash.write(0, &[0; 4]).is_ok(), tear == Tear::Whole);
        }
    }

    #[test]
    fn a_file_keeps_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flash");
        let mut flash = Small::open(&path, 2).unwrap();
        // As a directory begins: that is what such a file is known by.
        flash.write(256, b"BNKD").unwrap();
        drop(flash);
        let mut flash = Small::open(&path, 2).unwrap();
        assert_eq!(flash.mapped(256, 5), Some(&b"BNKD\xff"[..]));
        assert!(flash.write(256, &[0; 4]).is_err(), "written already");
        flash.erase(256, 512).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), [0xff; 512]);
    }
}

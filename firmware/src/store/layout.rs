//! Where a store is in its flash.

use super::mapped::{MappedFlash, PAGE_BYTES};
use core::ops::Range;

/// Where the store is in the flash. All addresses are those of sectors.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Two sectors for the directory.
    pub directory: [u32; 2],
    /// The sectors for clips.
    pub clips: Range<u32>,
}

impl Layout {
    /// Whether these are sectors of this flash, none of them twice, and pages can be written there.
    pub(super) fn fits<F: MappedFlash>(&self, flash: &F) -> bool {
        let capacity = u32::try_from(flash.capacity()).unwrap_or(u32::MAX);
        let page = PAGE_BYTES as u32;
        let sector = |at: u32| at..at.saturating_add(flash.sector_bytes(at));
        let [first, second] = self.directory.map(sector);
        let ranges = [&first, &second, &self.clips];
        let inside = ranges.iter().all(|range| {
            range.start < range.end
                && range.end <= capacity
                && range.start.is_multiple_of(page)
                && range.end.is_multiple_of(page)
        });
        let apart = |a: &Range<u32>, b: &Range<u32>| a.end <= b.start || b.end <= a.start;
        let mut end = self.clips.start;
        while end < self.clips.end {
            end = end.saturating_add(flash.sector_bytes(end).max(1));
        }
        let whole = end == self.clips.end;
        let disjoint = apart(&first, &second) && apart(&first, &self.clips) && apart(&second, &self.clips);
        PAGE_BYTES.is_multiple_of(F::WRITE_SIZE) && inside && whole && disjoint
    }
}

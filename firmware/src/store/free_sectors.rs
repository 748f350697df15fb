//! Free sectors for a clip.

use super::extent::Extent;
use super::layout::Layout;

/// The lowest free sectors in a row that take `bytes`, as their first address; otherwise the bytes that would fit. `sector_bytes` is the size of the
/// sector at an address. `taken` gives what is in use; time grows with the square of their number.
pub(super) fn find<T: Iterator<Item = Extent>>(
    layout: &Layout,
    sector_bytes: impl Fn(u32) -> u32,
    taken: impl Fn() -> T,
    bytes: u32,
) -> Result<u32, u32> {
    let end = |extent: Extent| {
        let mut end = extent.at;
        while end < extent.at.saturating_add(extent.bytes) {
            end = end.saturating_add(sector_bytes(end).max(1));
        }
        end
    };
    // Free bytes from here to what is in use next; none inside of it.
    let gap = |from: u32| {
        taken().fold(layout.clips.end.saturating_sub(from), |gap, extent| {
            if extent.at >= from {
                gap.min(extent.at.saturating_sub(from))
            } else if end(extent) > from {
                0
            } else {
                gap
            }
        })
    };
    let starts = || core::iter::once(layout.clips.start).chain(taken().map(end));
    let fitting = starts().filter(|&start| gap(start) >= bytes).min();
    fitting.ok_or_else(|| starts().map(gap).max().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn layout(clips: core::ops::Range<u32>) -> Layout {
        Layout { directory: [0, 4096], clips }
    }

    fn found(taken: &[(u32, u32)], bytes: u32) -> Result<u32, u32> {
        let taken = || taken.iter().map(|&(at, bytes)| Extent { at, bytes });
        find(&layout(8192..40960), |_| 4096, taken, bytes)
    }

    #[test]
    fn the_lowest_gap_that_fits_is_taken() {
        assert_eq!(found(&[], 32768), Ok(8192));
        assert_eq!(found(&[], 32769), Err(32768));
        let taken = [(16384, 1), (8192, 4096), (28672, 4097)];
        assert_eq!(found(&taken, 4096), Ok(12288));
        assert_eq!(found(&taken, 4097), Ok(20480));
        assert_eq!(found(&taken, 8193), Err(8192));
    }

    /// The last sectors of an STM32F4 are of 16, 64 and 128 KiB.
    #[test]
    fn sectors_may_have_several_sizes() {
        let size = |at: u32| match at {
            0..0x10000 => 0x4000,
            0x10000..0x20000 => 0x10000,
            _ => 0x20000,
        };
        let layout = layout(0xc000..0x80000);
        let taken = || [Extent { at: 0xc000, bytes: 0x4001 }].into_iter();
        assert_eq!(find(&layout, size, taken, 5), Ok(0x20000));
        let taken = || [Extent { at: 0xc000, bytes: 0x4000 }].into_iter();
        assert_eq!(find(&layout, size, taken, 5), Ok(0x10000));
    }

    proptest! {
        /// Against a map of all sectors.
        #[test]
        fn what_is_found_is_free(
            taken in proptest::collection::vec((2u32..10, 1u32..9000), 0..6), bytes in 1u32..40000
        ) {
            let taken: Vec<_> = taken.into_iter().map(|(sector, bytes)| (sector * 4096, bytes)).collect();
            let is_free = |sector: u32| taken.iter().all(|&(at, bytes)| {
                sector + 4096 <= at || sector >= at + bytes
            });
            let fits = |start: u32| (start..start + bytes).step_by(4096).all(|sector| sector < 40960 && is_free(sector));
            let expected = (8192..40960).step_by(4096).find(|&start| fits(start));
            prop_assert_eq!(found(&taken, bytes).ok(), expected);
        }
    }
}

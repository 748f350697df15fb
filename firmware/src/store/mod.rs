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

mod check;
mod clip_store;
mod directory;
mod entry;
mod error;
mod extent;
mod free_sectors;
mod layout;
mod lease;
mod mapped;
mod record;

pub use clip_store::{Status, Store};
pub use entry::{Entry, NAME_BYTES, Name};
pub use error::StoreError;
pub use layout::Layout;
pub use lease::{LEASES, Lease, Leases};
pub use mapped::{GuardedFlash, GuardedFlashError, MappedFlash, PAGE_BYTES};

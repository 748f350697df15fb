//! Bytes of flash that stay as they are while somebody reads them.

use super::extent::Extent;

/// Leases that may be out at a time: a library has two decoders.
pub const LEASES: usize = 2;

/// Bytes that a decoder reads in place.
///
/// While a lease of a flash is out, that flash refuses to erase or write these bytes ([`Leases`]); it ends when the flash
/// gets the lease back. A lease that is never given back is out for ever: its sectors are lost for uploads, and nothing
/// worse.
///
/// The bytes cannot be kept longer than the lease:
///
/// ```compile_fail,E0505
/// # fn with<F: firmware::store::MappedFlash>(store: &mut firmware::store::Store<F>) -> Option<u8> {
/// let lease = store.lease(1)?;
/// let bytes = lease.bytes();
/// store.release(lease);
/// bytes.first().copied() // An upload may have erased them.
/// # }
/// ```
///
/// Read before the lease is given back, they can:
///
/// ```
/// # fn with<F: firmware::store::MappedFlash>(store: &mut firmware::store::Store<F>) -> Option<u8> {
/// let lease = store.lease(1)?;
/// let first = lease.bytes().first().copied();
/// store.release(lease);
/// first
/// # }
/// ```
#[derive(Debug)]
pub struct Lease {
    bytes: &'static [u8],
}

impl Lease {
    /// A lease of bytes that nobody ever changes, as those of the image. It need not be given back.
    pub const fn of_static(bytes: &'static [u8]) -> Self {
        Self { bytes }
    }

    /// The bytes, as long as the lease is not given back.
    pub const fn bytes(&self) -> &[u8] {
        self.bytes
    }
}

/// What is out: where it is in the flash, and where in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Lent {
    extent: Extent,
    address: usize,
}

/// The leases that are out of a flash, at most [`LEASES`].
///
/// A flash asks [`may_change`](Self::may_change) before every erase and write. That is what makes its leases sound, so it is
/// the flash that does it, not who uses the flash.
#[derive(Clone, Debug, Default)]
pub struct Leases {
    out: [Option<Lent>; LEASES],
}

impl Leases {
    /// None is out.
    pub const fn new() -> Self {
        Self { out: [None; LEASES] }
    }

    /// Notes that the bytes at `at` of the flash are read from now on; `None` where [`LEASES`] are out.
    pub fn lend(&mut self, at: u32, bytes: &'static [u8]) -> Option<Lease> {
        let place = self.out.iter_mut().find(|lent| lent.is_none())?;
        let extent = Extent { at, bytes: u32::try_from(bytes.len()).ok()? };
        *place = Some(Lent { extent, address: bytes.as_ptr().addr() });
        Some(Lease { bytes })
    }

    /// Takes a lease back. One that is not of this flash changes nothing.
    pub fn take_back(&mut self, lease: Lease) {
        let (address, length) = (lease.bytes.as_ptr().addr(), lease.bytes.len());
        let is_it = |lent: &Lent| lent.address == address && lent.extent.bytes as usize == length;
        if let Some(place) = self.out.iter_mut().find(|lent| lent.as_ref().is_some_and(is_it)) {
            *place = None;
        }
    }

    /// Whether nobody reads bytes of the flash from `from` to `to`, the latter not counted.
    pub fn may_change(&self, from: u32, to: u32) -> bool {
        self.extents().all(|extent| extent.at.saturating_add(extent.bytes) <= from || to <= extent.at)
    }

    /// Where in the flash bytes are read.
    pub(super) fn extents(&self) -> impl Iterator<Item = Extent> {
        self.out.iter().flatten().map(|lent| lent.extent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    static FIRST: [u8; 100] = [1; 100];
    static SECOND: [u8; 50] = [2; 50];

    #[test]
    fn bytes_that_are_read_may_not_change_until_the_last_lease_of_them_is_back() {
        let mut leases = Leases::new();
        let (one, other) = (leases.lend(1000, &FIRST).unwrap(), leases.lend(1000, &FIRST).unwrap());
        assert!(leases.lend(5000, &SECOND).is_none(), "two are out");
        for (from, to, may) in [(0, 1000, true), (0, 1001, false), (1099, 1100, false), (1100, 9999, true)] {
            assert_eq!(leases.may_change(from, to), may, "{from} to {to}");
        }
        leases.take_back(one);
        assert!(!leases.may_change(1050, 1051));
        leases.take_back(other);
        assert!(leases.may_change(0, u32::MAX));
    }

    #[test]
    fn a_lease_of_something_else_ends_none() {
        let mut leases = Leases::new();
        let lease = leases.lend(1000, &FIRST).unwrap();
        leases.take_back(Lease::of_static(&SECOND));
        leases.take_back(Lease::of_static(&FIRST[..99]));
        assert_eq!(lease.bytes(), FIRST);
        assert!(!leases.may_change(1000, 1001), "one that is never given back stays out");
    }
}

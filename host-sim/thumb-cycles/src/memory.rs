//! Memory regions, each with the decoded instructions and the cycle counts of what was executed in it.

use crate::error::Error;
use crate::fault::AccessError;
use crate::insn::Insn;
use crate::wait_states::WaitStates;

/// A block of memory.
#[derive(Clone, Debug)]
pub struct Region {
    /// Its name in messages.
    pub name: &'static str,
    /// First address.
    pub base: u32,
    /// Its bytes.
    pub data: Vec<u8>,
    /// RAM.
    pub writable: bool,
    /// Wait states.
    pub wait_states: WaitStates,
    /// Decoded instructions, one for each halfword up to the last that was executed.
    pub(crate) code: Vec<Insn>,
    /// Cycles spent on each of them.
    pub(crate) cycles: Vec<u64>,
}

impl Region {
    /// `size` bytes of zeroes at `base`.
    pub fn new(name: &'static str, base: u32, size: usize, writable: bool) -> Self {
        Self {
            name,
            base,
            data: vec![0; size],
            writable,
            wait_states: WaitStates::NONE,
            code: Vec::new(),
            cycles: Vec::new(),
        }
    }
}

/// What is at no address.
pub(crate) const NO_REGION: u8 = u8::MAX;

/// All regions. Peripherals are elsewhere: what is not found here may be theirs.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    pub(crate) regions: Vec<Region>,
    /// For each 16 MB, its region.
    map: Vec<u8>,
}

impl Memory {
    /// # Errors
    /// [`Error::RegionsOverlap`] where two regions lie in the same 16 MB, which is more than the map tells apart.
    pub fn new(regions: Vec<Region>) -> Result<Self, Error> {
        let mut map = vec![NO_REGION; 256];
        for (number, region) in regions.iter().enumerate() {
            let last = region.base.saturating_add((region.data.len() as u32).saturating_sub(1));
            for block in region.base >> 24..=last >> 24 {
                let entry = &mut map[block as usize];
                if *entry != NO_REGION {
                    let second = regions[usize::from(*entry)].name;
                    return Err(Error::RegionsOverlap { first: region.name, second, address: block << 24 });
                }
                *entry = number as u8;
            }
        }
        Ok(Self { regions, map })
    }

    /// The region of an address and the offset in it.
    #[inline]
    pub(crate) fn locate(&self, address: u32) -> Option<(usize, usize)> {
        let number = usize::from(*self.map.get((address >> 24) as usize)?);
        let region = self.regions.get(number)?;
        let offset = address.wrapping_sub(region.base) as usize;
        (offset < region.data.len()).then_some((number, offset))
    }

    /// Little-endian bytes.
    #[inline]
    pub(crate) fn read<const N: usize>(&self, address: u32) -> Option<[u8; N]> {
        let number = usize::from(*self.map.get((address >> 24) as usize)?);
        let region = self.regions.get(number)?;
        let offset = address.wrapping_sub(region.base) as usize;
        region.data.get(offset..offset.wrapping_add(N))?.try_into().ok()
    }

    /// Writes bytes and forgets what was decoded there.
    #[inline]
    pub(crate) fn write<const N: usize>(&mut self, address: u32, bytes: [u8; N]) -> Result<(), AccessError> {
        let number = self.map.get((address >> 24) as usize).map_or(NO_REGION, |&number| number);
        let region = self.regions.get_mut(usize::from(number)).ok_or(AccessError::Unmapped)?;
        let offset = address.wrapping_sub(region.base) as usize;
        let place = region.data.get_mut(offset..offset.wrapping_add(N)).ok_or(AccessError::Unmapped)?;
        if !region.writable {
            return Err(AccessError::ReadOnly);
        }
        place.copy_from_slice(&bytes);
        if !region.code.is_empty() {
            region.forget(offset, N);
        }
        Ok(())
    }

    /// The decoded instruction at `pc`, if it is decoded, and the number of its region.
    #[inline]
    pub(crate) fn fetch(&self, pc: u32) -> Option<(usize, usize, &Insn)> {
        let number = usize::from(*self.map.get((pc >> 24) as usize)?);
        let region = self.regions.get(number)?;
        let at = (pc.wrapping_sub(region.base) >> 1) as usize;
        Some((number, at, region.code.get(at)?))
    }

    /// Counts cycles for an instruction that [`Memory::fetch`] gave.
    #[inline]
    pub(crate) fn count(&mut self, region: usize, at: usize, cycles: u32) {
        if let Some(sum) = self.regions.get_mut(region).and_then(|region| region.cycles.get_mut(at)) {
            *sum = sum.wrapping_add(u64::from(cycles));
        }
    }

    /// Keeps a decoded instruction.
    pub(crate) fn set_code(&mut self, address: u32, insn: Insn) {
        if let Some(region) = self.region_mut(address) {
            let at = (address.wrapping_sub(region.base) >> 1) as usize;
            region.grow(at);
            if let Some(place) = region.code.get_mut(at) {
                *place = insn;
            }
        }
    }

    /// Forgets what was decoded at an address.
    pub(crate) fn forget_code(&mut self, address: u32) {
        if let Some(region) = self.region_mut(address)
            && let Some(place) = region.code.get_mut((address.wrapping_sub(region.base) >> 1) as usize)
        {
            *place = Insn::UNDECODED;
        }
    }

    /// Sets all cycle counts to zero.
    pub(crate) fn forget_counts(&mut self) {
        for region in &mut self.regions {
            region.cycles.fill(0);
        }
    }

    /// The region with an address, to change its wait states.
    pub fn region_mut(&mut self, address: u32) -> Option<&mut Region> {
        let (number, _) = self.locate(address)?;
        self.regions.get_mut(number)
    }

    /// The regions.
    pub fn regions(&self) -> &[Region] {
        &self.regions
    }

    /// Bytes from `address` on, as far as they are there.
    pub fn bytes(&self, address: u32, len: usize) -> Option<&[u8]> {
        let (number, offset) = self.locate(address)?;
        self.regions.get(number)?.data.get(offset..offset.checked_add(len)?)
    }

    /// Puts bytes anywhere, flash too, as a programmer does; `false` where there is no memory.
    pub fn program(&mut self, address: u32, bytes: &[u8]) -> bool {
        let Some((number, offset)) = self.locate(address) else {
            return bytes.is_empty();
        };
        let Some(region) = self.regions.get_mut(number) else {
            return false;
        };
        let Some(place) = region.data.get_mut(offset..offset + bytes.len()) else {
            return false;
        };
        place.copy_from_slice(bytes);
        region.forget(offset, bytes.len());
        true
    }
}

impl Region {
    /// Forgets decoded instructions that overlap a range, with those that begin a halfword before it.
    fn forget(&mut self, offset: usize, len: usize) {
        let first = (offset / 2).saturating_sub(1);
        let end = ((offset + len).div_ceil(2)).min(self.code.len());
        if let Some(range) = self.code.get_mut(first..end.max(first)) {
            range.fill(Insn::UNDECODED);
        }
    }

    /// Makes room for decoded instructions up to `at`.
    pub(crate) fn grow(&mut self, at: usize) {
        if at >= self.code.len() {
            let len = (at + 1).next_multiple_of(1024);
            self.code.resize(len, Insn::UNDECODED);
            self.cycles.resize(len, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn memory() -> Memory {
        let regions =
            vec![Region::new("flash", 0, 0x1000, false), Region::new("RAM", 0x2000_0000, 0x100, true)];
        Memory::new(regions).unwrap()
    }

    #[test]
    fn accesses_end_with_the_region() {
        let mut memory = memory();
        assert_eq!(memory.write(0x2000_00fc, [1, 2, 3, 4]), Ok(()));
        assert_eq!(memory.read(0x2000_00fc), Some([1, 2, 3, 4]));
        assert_eq!(memory.read::<4>(0x2000_00fd), None);
        assert_eq!(memory.write(0x2000_0100, [0]), Err(AccessError::Unmapped));
        assert_eq!(memory.write(0x1fff_ffff, [0]), Err(AccessError::Unmapped));
        assert_eq!(memory.write(0x10, [0]), Err(AccessError::ReadOnly));
        assert_eq!(memory.read::<4>(0xffff_ffff), None);
    }

    #[test]
    fn regions_that_cannot_be_told_apart_are_refused() {
        let regions =
            vec![Region::new("flash", 0, 0x1000, false), Region::new("RAM", 0x10_0000, 0x100, true)];
        assert!(Memory::new(regions).unwrap_err().to_string().contains("RAM and flash"));
    }
}

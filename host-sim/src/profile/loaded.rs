//! An image for the simulator, with the files that it works on beside it in simulated flash.
//!
//! An image is built once for each target. The statics by which it finds its files (`tests/profile-image/src/loaded.rs`)
//! are written into its ELF file for each run.

use anyhow::{Context, Result, anyhow, bail};
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader};
use object::{Endianness, Object, ObjectSymbol};
use std::collections::HashMap;

/// A clip or a joint map lies at a multiple of this: flash is erased in pages and clips lie at their beginnings.
const ALIGNMENT: u32 = 4;

/// What an image is to find in memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contents<'a> {
    /// Files in flash, each with the name of the image's static for it.
    pub files: &'a [(&'a str, &'a [u8])],
    /// Numbers, each with the name of the image's static for it.
    pub numbers: &'a [(&'a str, u32)],
    /// Bytes of RAM that the image lends its decoder, beside its own.
    pub lent_bytes: usize,
}

/// An image and its files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LoadedImage {
    /// The ELF file; its statics say where the files are.
    pub elf: Vec<u8>,
    /// Address and bytes of the files.
    pub files: Vec<(u32, Vec<u8>)>,
    /// Bytes of RAM that it lends its decoder, beside its own.
    pub lent_bytes: usize,
}

impl LoadedImage {
    /// An image that works on nothing but itself.
    pub fn alone(elf: Vec<u8>) -> Self {
        Self { elf, ..Self::default() }
    }

    /// Writes into an image where its files are, which come after it in flash, and its numbers.
    ///
    /// # Errors
    /// A sentence where this is no ELF file, or has no static of such a name.
    pub fn new(mut elf: Vec<u8>, contents: Contents<'_>) -> Result<Self> {
        let statics = Statics::of(&elf)?;
        let mut files = Vec::new();
        let mut end = statics.end;
        for &(name, bytes) in contents.files {
            let address = end.next_multiple_of(ALIGNMENT);
            let len = u32::try_from(bytes.len()).with_context(|| format!("{name} is above 4 GB"))?;
            statics.write(&mut elf, name, &[address, len])?;
            end = address.checked_add(len).with_context(|| format!("no flash is left for {name}"))?;
            files.push((address, bytes.to_vec()));
        }
        for &(name, number) in contents.numbers {
            statics.write(&mut elf, name, &[number])?;
        }
        Ok(Self { elf, files, lent_bytes: contents.lent_bytes })
    }

    /// Bytes of all files.
    pub fn file_bytes(&self) -> usize {
        self.files.iter().map(|(_, bytes)| bytes.len()).sum()
    }
}

/// Where statics are in an ELF file, and where the image ends in flash.
struct Statics {
    offsets: HashMap<String, usize>,
    end: u32,
}

impl Statics {
    fn of(elf: &[u8]) -> Result<Self> {
        let wrong = "the image is no ELF file of 32 bits";
        let header = FileHeader32::<Endianness>::parse(elf).context(wrong)?;
        let endian = header.endian().context(wrong)?;
        let loaded: Vec<_> = (header.program_headers(endian, elf).context(wrong)?.iter())
            .filter(|segment| segment.p_type(endian) == PT_LOAD && segment.p_filesz(endian) > 0)
            .map(|segment| {
                (
                    segment.p_vaddr(endian),
                    segment.p_paddr(endian),
                    segment.p_filesz(endian),
                    segment.p_offset(endian),
                )
            })
            .collect();
        let end = loaded.iter().map(|&(_, paddr, size, _)| paddr.saturating_add(size)).max();
        let file = object::File::parse(elf).context(wrong)?;
        let offset = |address: u32| {
            let segment = loaded
                .iter()
                .find(|&&(vaddr, _, size, _)| (vaddr..vaddr.saturating_add(size)).contains(&address));
            segment.map(|&(vaddr, _, _, offset)| (address - vaddr + offset) as usize)
        };
        let offsets = (file.symbols())
            .filter_map(|symbol| Some((symbol.name().ok()?.to_owned(), offset(symbol.address() as u32)?)))
            .collect();
        Ok(Self { offsets, end: end.ok_or_else(|| anyhow!("the image has nothing to load"))? })
    }

    fn write(&self, elf: &mut [u8], name: &str, words: &[u32]) -> Result<()> {
        let offset = self.offsets.get(name);
        let place = offset.and_then(|&offset| elf.get_mut(offset..offset + 4 * words.len()));
        let Some(place) = place else { bail!("the image has no static {name}") };
        for (place, word) in place.chunks_exact_mut(4).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_file_is_refused() {
        let error = LoadedImage::new(b"\x7fELF".to_vec(), Contents::default()).unwrap_err();
        assert!(error.to_string().contains("no ELF file"), "{error}");
    }
}

//! An ELF file as it was built: what to load where, and the names of its functions.

use crate::error::Error;
use crate::memory::Memory;
use addr2line::gimli;
use object::elf::PT_LOAD;
use object::read::elf::{FileHeader, ProgramHeader};
use object::{Endianness, Object, ObjectSection, ObjectSymbol, SymbolKind};
use std::collections::HashMap;

/// A function of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Function {
    /// Name, demangled.
    pub name: String,
    /// First address.
    pub address: u32,
    /// Bytes.
    pub size: u32,
}

/// A parsed image.
#[derive(Clone, Debug)]
pub struct Image {
    /// Physical address and bytes of what is loaded.
    segments: Vec<(u32, Vec<u8>)>,
    /// By address.
    functions: Vec<Function>,
    /// All named addresses, as they are in the file (mangled).
    symbols: HashMap<String, u32>,
    /// The file, for its debug info.
    elf: Vec<u8>,
}

impl Image {
    /// Parses an ELF file for a 32-bit little-endian Arm.
    ///
    /// # Errors
    /// [`Error::NotElf`], [`Error::OtherProcessor`] or [`Error::SegmentCutOff`] where it is no such file.
    pub fn parse(elf: &[u8]) -> Result<Self, Error> {
        let header = object::elf::FileHeader32::<Endianness>::parse(elf)?;
        let endian = header.endian()?;
        let machine = header.e_machine(endian);
        if machine != object::elf::EM_ARM || endian != Endianness::Little {
            return Err(Error::OtherProcessor { machine });
        }
        let mut segments = Vec::new();
        for segment in header.program_headers(endian, elf)? {
            if segment.p_type(endian) != PT_LOAD || segment.p_filesz(endian) == 0 {
                continue;
            }
            let address = segment.p_paddr(endian);
            let data = segment.data(endian, elf).map_err(|()| Error::SegmentCutOff { address })?;
            segments.push((address, data.to_vec()));
        }
        let file = object::File::parse(elf)?;
        let mut functions = Vec::new();
        let mut symbols = HashMap::new();
        for symbol in file.symbols() {
            let Ok(name) = symbol.name() else { continue };
            if name.is_empty() || name.starts_with('$') || symbol.is_undefined() {
                continue;
            }
            let address = symbol.address() as u32;
            symbols.entry(name.to_owned()).or_insert(address);
            if symbol.kind() == SymbolKind::Text {
                functions.push(Function {
                    name: format!("{:#}", rustc_demangle::demangle(name)),
                    address: address & !1,
                    size: symbol.size() as u32,
                });
            }
        }
        functions.sort_by(|a, b| (a.address, b.size, &a.name).cmp(&(b.address, a.size, &b.name)));
        functions.dedup_by_key(|function| function.address);
        // Assembly often has no sizes: up to the next function.
        let starts: Vec<u32> = functions.iter().skip(1).map(|function| function.address).collect();
        for (number, function) in functions.iter_mut().enumerate() {
            if function.size == 0 {
                let end = starts.get(number).copied();
                function.size = end.map_or(4, |end| end.saturating_sub(function.address));
            }
        }
        Ok(Self { segments, functions, symbols, elf: elf.to_vec() })
    }

    /// An image of halfwords, each part at its address, without symbols: for code that was assembled by hand.
    pub fn from_halfwords(parts: &[(u32, &[u16])]) -> Self {
        let bytes = |halves: &[u16]| halves.iter().flat_map(|half| half.to_le_bytes()).collect();
        Self {
            segments: parts.iter().map(|&(address, halves)| (address, bytes(halves))).collect(),
            functions: Vec::new(),
            symbols: HashMap::new(),
            elf: Vec::new(),
        }
    }

    /// Copies the image into memory.
    ///
    /// # Errors
    /// [`Error::DoesNotFit`] where there is no memory for a part of it.
    pub fn load_into(&self, memory: &mut Memory) -> Result<(), Error> {
        for &(address, ref data) in &self.segments {
            if !memory.program(address, data) {
                return Err(Error::DoesNotFit { address, bytes: data.len() });
            }
        }
        Ok(())
    }

    /// Bytes that are loaded.
    pub fn loaded_bytes(&self) -> usize {
        self.segments.iter().map(|(_, data)| data.len()).sum()
    }

    /// The functions, by address.
    pub fn functions(&self) -> &[Function] {
        &self.functions
    }

    /// Number of the function that an address is in.
    pub fn function_at(&self, address: u32) -> Option<usize> {
        let next = self.functions.partition_point(|function| function.address <= address);
        let number = next.checked_sub(1)?;
        let function = self.functions.get(number)?;
        (address - function.address < function.size).then_some(number)
    }

    /// Address of a symbol, by its name in the file, or the demangled name of a function.
    pub fn symbol(&self, name: &str) -> Option<u32> {
        let named = || self.functions.iter().find(|function| function.name == name);
        self.symbols.get(name).copied().or_else(|| named().map(|function| function.address))
    }

    /// `file:line` of an address, from the debug info.
    pub fn line(&self, address: u32) -> Option<String> {
        let file = object::File::parse(self.elf.as_slice()).ok()?;
        let sections = gimli::DwarfSections::load(|section| {
            let found = file.section_by_name(section.name());
            let data = found.and_then(|section| section.uncompressed_data().ok());
            Ok::<_, gimli::Error>(data.unwrap_or_default().into_owned())
        })
        .ok()?;
        let dwarf = sections.borrow(|section| gimli::EndianSlice::new(section, gimli::LittleEndian));
        let context = addr2line::Context::from_dwarf(dwarf).ok()?;
        let location = context.find_location(u64::from(address)).ok()??;
        Some(format!("{}:{}", location.file?, location.line?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_files_are_refused() {
        let error = Image::parse(b"\x7fELF").unwrap_err();
        assert!(error.to_string().starts_with("not an image for a Cortex-M"), "{error}");
        // The test itself is an ELF file, but not for a Cortex-M.
        let own = std::fs::read(std::env::current_exe().unwrap()).unwrap();
        assert!(Image::parse(&own).is_err());
    }
}

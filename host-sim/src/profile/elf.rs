//! What an image takes of flash and RAM, from its sections and symbols.

use anyhow::{Context, Result};
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SymbolKind, elf};
use serde::Serialize;

/// A section of an image, and the memory that it takes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Section {
    /// Its name, for instance `.text`.
    pub name: String,
    /// Its bytes.
    pub bytes: u64,
    /// Bytes of flash; initialised variables take both.
    pub flash: bool,
    /// Bytes of RAM.
    pub ram: bool,
}

/// An image's use of memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Memory {
    /// The sections that take any.
    pub sections: Vec<Section>,
    /// Of all functions but those that start the image or end it.
    pub code_bytes: u64,
}

/// Functions that an image has for the core's sake, or for measuring: cortex-m-rt's and the image's own `main`.
const NOT_COUNTED: [&str; 9] = [
    "Reset",
    "main",
    "__cortex_m_rt_main",
    "DefaultHandler_",
    "DefaultPreInit",
    "HardFault_",
    "finished",
    "failed",
    "__pre_init",
];

impl Memory {
    /// Reads it from an ELF file.
    ///
    /// # Errors
    /// A sentence where that is no ELF file.
    pub fn of(image: &[u8]) -> Result<Self> {
        let file = object::File::parse(image).context("the image is no ELF file")?;
        let mut sections = Vec::new();
        for section in file.sections() {
            let SectionFlags::Elf { sh_flags } = section.flags() else { continue };
            if sh_flags & u64::from(elf::SHF_ALLOC) == 0 || section.size() == 0 {
                continue;
            }
            let flash = section.kind() != object::SectionKind::UninitializedData
                && section.file_range().is_some_and(|(_, size)| size > 0);
            let ram = sh_flags & u64::from(elf::SHF_WRITE) != 0;
            let name = section.name().unwrap_or("?").to_owned();
            sections.push(Section { name, bytes: section.size(), flash, ram });
        }
        let mut functions: Vec<(u64, u64)> = (file.symbols())
            .filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0)
            .filter(|symbol| symbol.name().is_ok_and(counts))
            .map(|symbol| (symbol.address(), symbol.size()))
            .collect();
        // Two names of one function count once.
        functions.sort_unstable();
        functions.dedup_by_key(|&mut (address, _)| address);
        let code_bytes = functions.iter().map(|&(_, size)| size).sum();
        Ok(Self { sections, code_bytes })
    }

    /// The same with files of so many bytes in flash and so many bytes of RAM lent, beside the image.
    #[must_use]
    pub fn with(mut self, files: usize, lent: usize) -> Self {
        let beside = [("clip", files, true, false), ("lent to the decoder", lent, false, true)];
        let beside = beside.into_iter().filter(|&(_, bytes, ..)| bytes > 0);
        self.sections.extend(beside.map(|(name, bytes, flash, ram)| Section {
            name: name.to_owned(),
            bytes: bytes as u64,
            flash,
            ram,
        }));
        self
    }

    /// Bytes of flash.
    pub fn flash_bytes(&self) -> u64 {
        self.sections.iter().filter(|section| section.flash).map(|section| section.bytes).sum()
    }

    /// Bytes of static RAM.
    pub fn ram_bytes(&self) -> u64 {
        self.sections.iter().filter(|section| section.ram).map(|section| section.bytes).sum()
    }
}

/// Whether a function is the decoder's. Mangled names end in the path, whose last part is the name.
fn counts(name: &str) -> bool {
    !NOT_COUNTED.iter().any(|other| name == *other || name.contains(&format!("{}{other}", other.len())))
}

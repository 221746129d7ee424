//! What an image takes of a controller, and what is in it, read from its ELF file.

use std::path::Path;

use anyhow::{Context, Result};
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind, elf};

/// An image's sections and symbols.
#[derive(Debug, Clone)]
pub struct Image {
    pub sections: Vec<Section>,
    pub symbols: Vec<Symbol>,
}

/// A section that takes memory on the controller.
#[derive(Debug, Clone)]
pub struct Section {
    pub name: String,
    pub address: u64,
    pub bytes: u64,
    pub writable: bool,
    /// Its contents are in the image.
    pub stored: bool,
}

/// A function or a static.
#[derive(Debug, Clone)]
pub struct Symbol {
    pub name: String,
    pub address: u64,
    pub bytes: u64,
}

/// Where the test bench has its buffers; no part of a product.
const BENCH: &str = ".bench";

impl Image {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// No file, or another one.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        let file = object::File::parse(&*bytes).with_context(|| format!("{} is no ELF file", path.display()))?;
        let sections = file.sections().filter_map(|s| {
            let SectionFlags::Elf { sh_flags } = s.flags() else { return None };
            let has = |flag: u32| sh_flags & u64::from(flag) != 0;
            (has(elf::SHF_ALLOC) && s.size() > 0).then(|| Section {
                name: s.name().unwrap_or_default().to_owned(),
                address: s.address(),
                bytes: s.size(),
                writable: has(elf::SHF_WRITE),
                stored: s.kind() != SectionKind::UninitializedData,
            })
        });
        let symbols = file.symbols().filter(|s| s.is_definition()).map(|s| Symbol {
            name: s.name().unwrap_or_default().to_owned(),
            address: s.address(),
            bytes: s.size(),
        });
        Ok(Self { sections: sections.collect(), symbols: symbols.collect() })
    }

    /// Bytes of the image.
    pub fn flash_bytes(&self) -> u64 {
        self.sections.iter().filter(|s| s.stored).map(|s| s.bytes).sum()
    }

    /// Bytes of variables, the test bench's and the stack not counted.
    pub fn ram_bytes(&self) -> u64 {
        self.sections.iter().filter(|s| s.writable && s.name != BENCH).map(|s| s.bytes).sum()
    }

    /// Bytes of the test bench's buffers.
    pub fn bench_bytes(&self) -> u64 {
        self.sections.iter().filter(|s| s.name == BENCH).map(|s| s.bytes).sum()
    }

    /// The symbol whose name contains all parts.
    pub fn symbol(&self, parts: &[&str]) -> Option<&Symbol> {
        self.symbols.iter().find(|s| parts.iter().all(|part| s.name.contains(part)))
    }
}

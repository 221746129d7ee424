//! What an image takes of a controller, and what is in it, read from its ELF file.

use std::path::Path;

use anyhow::{Context, Result};
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind, elf};

/// An image's sections and symbols.
#[derive(Debug, Clone)]
pub struct Image {
    pub sections: Vec<Section>,
    pub symbols: Vec<Symbol>,
    /// Source files named in what is stored: those with code that can panic.
    pub sources: Vec<String>,
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

/// A function, a static, or an address that the linker named.
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
        let symbols = file.symbols().filter(|s| !s.is_undefined()).map(|s| Symbol {
            name: s.name().unwrap_or_default().to_owned(),
            address: s.address(),
            bytes: s.size(),
        });
        let sections: Vec<Section> = sections.collect();
        let stored = |name: &str| sections.iter().any(|s| s.stored && s.name == name);
        let mut sources: Vec<String> = file
            .sections()
            .filter(|s| s.name().is_ok_and(stored))
            .flat_map(|s| source_names(s.data().unwrap_or_default()))
            .collect();
        sources.sort();
        sources.dedup();
        Ok(Self { sections, symbols: symbols.collect(), sources })
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

/// Paths that end in `.rs`, whether or not something else stands between two of them.
fn source_names(bytes: &[u8]) -> Vec<String> {
    let mut names = Vec::new();
    let mut from = 0;
    while let Some(end) = bytes[from..].windows(3).position(|w| w == b".rs").map(|at| from + at + 3) {
        let of_a_path = |b: &u8| b.is_ascii_alphanumeric() || b"/\\._-+:".contains(b);
        let start = bytes[from..end].iter().rposition(|b| !of_a_path(b)).map_or(from, |at| from + at + 1);
        names.push(String::from_utf8_lossy(&bytes[start..end]).into_owned());
        from = end;
    }
    names.retain(|name| name.len() > 4);
    names
}

#[cfg(test)]
mod tests {
    use super::source_names;

    #[test]
    fn names_of_sources_are_found_with_and_without_anything_between_them() {
        let bytes = b"\x03\x04src/main.rs\0/a/b-1.0/src/x.rs/c/y.rs\xff.rs";
        assert_eq!(source_names(bytes), ["src/main.rs", "/a/b-1.0/src/x.rs", "/c/y.rs"]);
    }
}

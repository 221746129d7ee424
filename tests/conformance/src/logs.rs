//! The logs that come with the project: what a receiver is fed, and what it has to answer.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use viewshed_harness::bus::traffic::Maps;

use crate::class::Class;
use crate::input::Bus;
use crate::library;
use crate::world::{Looks, World};

/// Where they lie.
pub const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/logs");

/// Most bytes of all of them together.
pub const MOST_BYTES: u64 = 4_200_000;

/// One log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Log {
    pub name: String,
    /// Lines a receiver is fed.
    pub fed: String,
    /// Lines it answers.
    pub answers: String,
}

/// The names of all logs: a bus and a fault each.
pub fn names() -> impl Iterator<Item = (Bus, Class)> {
    Bus::ALL.into_iter().flat_map(|bus| Class::ALL.into_iter().map(move |class| (bus, class)))
}

impl Log {
    /// Makes a log, answered by the library's receiver.
    ///
    /// # Errors
    /// Maps the library's sender refuses.
    pub fn new(maps: &Maps, bus: Bus, class: Class) -> Result<Self> {
        // a stalled queue takes its time to drain
        let seconds = if class == Class::DrainAfterStall { 14 } else { 11 };
        let mut world = World::new(maps, bus, class, 0, seconds * 1_000_000, Looks::Log)?;
        if class == Class::ClockJumps {
            // the clock steps back between two looks: a little, which counts as the latest time, and by more
            world.look_again(15_000);
            world.look_again(25_000);
        }
        let name = format!("{}-{}", bus.name(), class.name());
        Ok(Self { name, fed: world.text(seconds * 1_000_000), answers: library::answers(world.lines()) })
    }

    /// Reads the log of a name.
    ///
    /// # Errors
    /// Names the file that cannot be read.
    pub fn read(name: &str) -> Result<Self> {
        let read = |kind: &str| -> Result<String> {
            let path = path(Path::new(FOLDER), name, kind);
            let file = std::fs::File::open(&path).with_context(|| format!("cannot read {}", path.display()))?;
            let mut text = String::new();
            GzDecoder::new(file)
                .read_to_string(&mut text)
                .with_context(|| format!("cannot read {}", path.display()))?;
            Ok(text)
        };
        Ok(Self { name: name.to_owned(), fed: read("in")?, answers: read("out")? })
    }

    /// Writes it into a folder.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        for (kind, text) in [("in", &self.fed), ("out", &self.answers)] {
            let path = path(folder, &self.name, kind);
            let written = || -> std::io::Result<()> {
                let mut gz = GzEncoder::new(std::fs::File::create(&path)?, Compression::best());
                gz.write_all(text.as_bytes())?;
                gz.finish().map(drop)
            };
            written().with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }
}

fn path(folder: &Path, name: &str, kind: &str) -> PathBuf {
    folder.join(format!("{name}.{kind}.gz"))
}

/// The first answer that differs, in words; `None` where none does.
pub fn difference(name: &str, expected: &str, got: &str) -> Option<String> {
    let (expected, got): (Vec<&str>, Vec<&str>) = (expected.lines().collect(), got.lines().collect());
    let most = expected.len().max(got.len());
    let differing = (0..most).filter(|i| expected.get(*i) != got.get(*i));
    let first = differing.clone().next()?;
    let say = |lines: &[&str]| lines.get(first).copied().unwrap_or("nothing").to_owned();
    let count = differing.count();
    Some(format!(
        "{name}: {count} of {most} answers differ; the first is expected `{}`, is `{}`",
        say(&expected),
        say(&got)
    ))
}

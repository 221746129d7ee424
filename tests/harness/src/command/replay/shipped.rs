//! The recordings and scenes that come with the project.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

/// Where they lie, seen from the project's root and from this crate's sources.
const FOLDERS: [&str; 2] = ["tests/recordings", concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings")];

/// Every shipped recording, by name.
///
/// # Errors
/// None there: the message says what to do instead.
pub fn recordings() -> Result<Vec<PathBuf>> {
    let found = FOLDERS.iter().map(|folder| within(Path::new(folder))).find(|found| !found.is_empty());
    let Some(found) = found else {
        bail!(
            "no recording given and none in tests/recordings here or beside the sources; name one: viewshed replay FILE.mcap"
        );
    };
    Ok(found)
}

/// A file that comes with the project.
///
/// # Errors
/// It is not there.
pub fn file(name: &str) -> Result<PathBuf> {
    let found = FOLDERS.iter().map(|folder| Path::new(folder).join(name)).find(|path| path.exists());
    found.with_context(|| format!("{name} is neither in tests/recordings here nor beside the sources; name a file"))
}

fn within(folder: &Path) -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut found: Vec<PathBuf> = files.filter(|p| p.extension().is_some_and(|e| e == "mcap")).collect();
    found.sort();
    found
}

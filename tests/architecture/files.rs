//! The files of the repository that these tests look at.

use std::fs;
use std::path::{Path, PathBuf};

/// Files below a folder, but for what was built and what is hidden, that end in one of these; of a folder that is left out
/// none.
pub fn below(folder: &Path, endings: &[&str], is_left_out: &dyn Fn(&Path) -> bool) -> Vec<PathBuf> {
    let (mut all, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(at) = folders.pop() {
        for entry in fs::read_dir(at).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                if !name.starts_with('.') && !["target", "out"].contains(&name.as_str()) && !is_left_out(&path) {
                    folders.push(path);
                }
            } else if endings.iter().any(|ending| name.ends_with(ending)) {
                all.push(path);
            }
        }
    }
    all.sort();
    all
}

/// A path seen from a folder.
pub fn name(path: &Path, folder: &Path) -> String {
    path.strip_prefix(folder).unwrap().display().to_string()
}

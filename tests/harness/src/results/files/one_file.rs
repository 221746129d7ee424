//! Whether two paths name one file, also through links. The daemon of `boards/linux` uses this file too.

use std::path::{Path, PathBuf};

/// Whether writing to one path changes what is read from the other.
///
/// Symbolic and hard links are followed. Paths of files that do not exist yet are compared by folder and name.
pub fn is_one_file(a: &Path, b: &Path) -> bool {
    is_one_inode(a, b) || place(a) == place(b)
}

#[cfg(unix)]
fn is_one_inode(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let number = |path: &Path| path.metadata().ok().map(|m| (m.dev(), m.ino()));
    number(a).is_some_and(|a| number(b) == Some(a))
}

#[cfg(not(unix))]
fn is_one_inode(_: &Path, _: &Path) -> bool {
    false
}

/// The file itself where it exists, else its name in its folder.
fn place(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let in_folder = || Some(folder.canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}

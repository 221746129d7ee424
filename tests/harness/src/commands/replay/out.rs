//! What `--out` leaves in a folder: the table as text, and pictures.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use super::{SHOWN, pictures};
use crate::commands::write_file;
use crate::evaluation::examples::Example;
use crate::evaluation::replay::Replay;
use crate::options::Settings;
use crate::report::ORIGIN;

/// The folder of each recording: the one named for a single recording, one inside it for each of several.
///
/// # Errors
/// Two recordings of one name: the second would overwrite the first.
pub fn folders(dir: &Path, recordings: &[PathBuf]) -> Result<Vec<PathBuf>> {
    if recordings.len() == 1 {
        return Ok(vec![dir.to_owned()]);
    }
    let folders: Vec<PathBuf> = recordings.iter().map(|path| dir.join(path.file_stem().unwrap_or_default())).collect();
    let mut distinct = folders.clone();
    distinct.sort();
    distinct.dedup();
    ensure!(distinct.len() == folders.len(), "--out: two of the recordings have one name; replay them one by one");
    Ok(folders)
}

/// Fills one recording's folder.
pub fn write(folder: &Path, text: &str, replay: &Replay, examples: &[Example], settings: &Settings) -> Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    write_file(&folder.join("table.txt"), &format!("{text}\n{ORIGIN}\n"))?;
    pictures::write(folder, replay, SHOWN, examples, settings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_recordings_have_a_folder_each() {
        let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        assert_eq!(folders(Path::new("o"), &paths(&["a/x.mcap"])).unwrap(), paths(&["o"]));
        assert_eq!(folders(Path::new("o"), &paths(&["a/x.mcap", "y.mcap"])).unwrap(), paths(&["o/x", "o/y"]));
        assert!(folders(Path::new("o"), &paths(&["a/x.mcap", "b/x.mcap"])).is_err());
    }
}

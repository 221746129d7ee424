//! Building a board's image.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use super::{Board, Profile};

/// Builds a program of a board and gives its path.
///
/// # Errors
/// What the compiler says, or that there is none for the board.
pub fn build(board: Board, profile: Profile, program: &str) -> Result<PathBuf> {
    // the small grid is for small controllers, which have no room for learnt lanes, and want fewer instructions and have the
    // flash for that
    let options: &[&str] = match profile {
        Profile::Reference => &["--features", "learning"],
        Profile::Small => &["--features", "small", "--config", "profile.release.opt-level=2"],
    };
    build_in(board.folder(), program, options)
}

/// Builds a program of a folder of `boards/` with options for cargo and gives its path.
///
/// # Errors
/// What the compiler says, or that there is none for the board.
pub fn build_in(folder: &str, program: &str, options: &[&str]) -> Result<PathBuf> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../boards/build.sh");
    if !script.exists() {
        bail!("{} is not there: --board builds the firmware from the project's sources", script.display());
    }
    let mut command = Command::new("sh");
    command.arg(&script).args([folder, program]).args(options).stderr(Stdio::piped());
    let output = command.output().context("cannot run sh")?;
    if !output.status.success() {
        bail!("cannot build the firmware of {folder}: {}", String::from_utf8_lossy(&output.stderr).trim());
    }
    Ok(PathBuf::from(String::from_utf8_lossy(&output.stdout).trim()))
}

//! The receivers that come with the project, beside the library's.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::program::Program;

const HERE: &str = env!("CARGO_MANIFEST_DIR");

/// The C receiver, built into a folder; `None` without a compiler `cc`.
///
/// # Errors
/// What the compiler complains of.
pub fn c(folder: &Path) -> Result<Option<Program>> {
    if Command::new("cc").arg("--version").output().is_err() {
        return Ok(None);
    }
    let target: PathBuf = folder.join("receiver-in-c");
    let output = Command::new("cc")
        .args(["-std=c11", "-O3", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&target)
        .arg(Path::new(HERE).join("receiver.c"))
        .output()
        .context("cannot run cc")?;
    if !output.status.success() {
        bail!("tests/conformance/receiver.c: {}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(Some(Program::of([target])))
}

/// The Python receiver.
fn script() -> PathBuf {
    Path::new(HERE).join("receiver.py")
}

/// Whether there is a Python receiver.
pub fn python_there() -> bool {
    script().exists()
}

/// The Python receiver; `None` without python3.
pub fn python() -> Option<Program> {
    python_with(&[])
}

/// The Python receiver that holds the plane of visibility alone; `None` without python3.
pub fn python_of_one_plane() -> Option<Program> {
    python_with(&["--without-probability"])
}

fn python_with(arguments: &[&str]) -> Option<Program> {
    let found = Command::new("python3").args(["-c", "import zlib"]).output();
    let there = found.is_ok_and(|output| output.status.success());
    let words = [PathBuf::from("python3"), script()].into_iter().chain(arguments.iter().map(PathBuf::from));
    there.then(|| Program::of(words))
}

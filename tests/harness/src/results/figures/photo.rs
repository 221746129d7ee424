//! Pictures of pages: what a command drew, or a page as a browser shows it.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

/// Where packages put a Chromium. The wrapper in /usr/bin comes last: it would leave its child behind.
const PLACES: [&str; 5] = [
    "/usr/lib/chromium/chromium-headless-shell",
    "/usr/bin/chromium-headless-shell",
    "/usr/bin/chromium",
    "/usr/bin/google-chrome",
    "/usr/bin/chromium-browser",
];

/// Of a page, in pixels.
const SIZE: &str = "--window-size=1120,820";

/// A browser to photograph with; `VIEWSHED_BROWSER` names another.
pub fn browser() -> Option<PathBuf> {
    let named = std::env::var_os("VIEWSHED_BROWSER").map(PathBuf::from);
    named.into_iter().chain(PLACES.map(PathBuf::from)).find(|path| path.exists())
}

/// Puts a picture where a page shows it.
///
/// # Errors
/// A file that is not there, or cannot be written; a page, and no browser on this machine.
pub fn make(of: &Path, picture: &Path) -> Result<()> {
    if of.extension().is_none_or(|kind| kind != "html") {
        std::fs::copy(of, picture).with_context(|| format!("{} for {}", of.display(), picture.display()))?;
        return Ok(());
    }
    let program = browser().with_context(|| {
        format!(
            "{}: no Chromium to photograph a page with (apt-get install chromium-headless-shell)",
            picture.display()
        )
    })?;
    let address = format!("file://{}", of.display());
    let to = format!("--screenshot={}", std::path::absolute(picture)?.display());
    let shown = Command::new(&program)
        .args(["--headless", "--no-sandbox", "--hide-scrollbars", "--disable-gpu", SIZE, &to, &address])
        .output()
        .with_context(|| program.display().to_string())?;
    ensure!(shown.status.success(), "{}: {}", program.display(), String::from_utf8_lossy(&shown.stderr).trim());
    Ok(())
}

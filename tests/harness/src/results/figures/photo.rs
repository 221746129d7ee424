//! Pictures of pages: what a command drew, or a page as a browser shows it.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

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
const SIZE: &str = "--window-size=1240,900";
/// Milliseconds of its own time that a page has to draw.
const PATIENCE: &str = "--virtual-time-budget=12000";

/// A browser to photograph with; `VIEWSHED_BROWSER` names another.
pub fn browser() -> Option<PathBuf> {
    let named = std::env::var_os("VIEWSHED_BROWSER").map(PathBuf::from);
    named.into_iter().chain(PLACES.map(PathBuf::from)).find(|path| path.exists())
}

/// Puts a picture where a page shows it: a file of a part's folder, a page there as a browser shows it, or with `view ...` in
/// place of a file what the viewer shows, at the moment behind `#`.
///
/// # Errors
/// A file that is not there, or cannot be written; a page, and no browser on this machine.
pub fn make(of: &str, [folder, root]: [&Path; 2], picture: &Path) -> Result<()> {
    if let Some(command) = of.strip_prefix("view ") {
        let (arguments, moment) = command.split_once('#').unwrap_or((command, ""));
        return viewer(arguments, moment, root, picture);
    }
    let file = folder.join(of);
    if file.extension().is_some_and(|kind| kind == "html") {
        return photograph(&format!("file://{}", file.display()), picture);
    }
    std::fs::copy(&file, picture).with_context(|| format!("{} for {}", file.display(), picture.display()))?;
    Ok(())
}

/// The page of `viewshed view`.
fn viewer(arguments: &str, moment: &str, root: &Path, picture: &Path) -> Result<()> {
    let program = std::env::current_exe().context("this program's own path")?;
    let mut server = Command::new(program)
        .args(["view", "--no-open"])
        .args(arguments.split_whitespace())
        .current_dir(root)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .context("viewshed view")?;
    let printed = server.stdout.take().map(BufReader::new);
    let address =
        printed.and_then(|lines| lines.lines().map_while(Result::ok).find(|line| line.starts_with("http://")));
    let photographed = address
        .with_context(|| format!("viewshed view {arguments}: it printed no address"))
        .and_then(|address| photograph(&format!("{address}#{moment}"), picture));
    let ended = server.kill().and_then(|()| server.wait()).context("viewshed view");
    photographed.and(ended.map(drop))
}

fn photograph(address: &str, picture: &Path) -> Result<()> {
    let program = browser().with_context(|| {
        format!(
            "{}: no Chromium to photograph a page with (apt-get install chromium-headless-shell)",
            picture.display()
        )
    })?;
    let to = format!("--screenshot={}", std::path::absolute(picture)?.display());
    let shown = Command::new(&program)
        .args(["--headless", "--no-sandbox", "--hide-scrollbars", "--use-angle=swiftshader"])
        .args(["--enable-unsafe-swiftshader", PATIENCE, SIZE, &to, address])
        .output()
        .with_context(|| program.display().to_string())?;
    ensure!(shown.status.success(), "{}: {}", program.display(), String::from_utf8_lossy(&shown.stderr).trim());
    Ok(())
}

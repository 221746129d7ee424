//! Emulated boards: a job goes in as a file, the answer comes out as one.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use viewshed::settings::Settings;

use super::Board;
use super::scans::{Scan, job};

/// Longer than any recording that is worth emulating takes.
const TIME_LIMIT: Duration = Duration::from_secs(900);

/// Runs a job in batch mode and gives the answer.
///
/// # Errors
/// No emulator, one that does not end, one that ends without an answer.
pub fn batch(board: Board, image: &Path, settings: &Settings, scans: &[Scan], dump: Option<usize>) -> Result<Vec<u8>> {
    let folder = Folder::new()?;
    let dump = dump.and_then(|frame| u32::try_from(frame).ok());
    std::fs::write(folder.0.join("job.bin"), job(settings, scans, dump)).context("cannot write the job")?;
    let (program, arguments) = emulator(board);
    let mut command = Command::new(program);
    command.args(arguments).arg("-kernel").arg(image).current_dir(&folder.0);
    let log = std::fs::File::create(folder.0.join("log")).context("cannot write the emulator's log")?;
    command.stdin(Stdio::null()).stdout(log.try_clone()?).stderr(log);
    let child = command
        .spawn()
        .with_context(|| format!("cannot run {program}; on Debian and Ubuntu: apt-get install qemu-system-arm"))?;
    let code = wait(child)?;
    let answer = std::fs::read(folder.0.join("answer.bin")).unwrap_or_default();
    // 1: refused, with its reason in the closing record
    if code != Some(0) && (code != Some(1) || answer.is_empty()) {
        let log = std::fs::read_to_string(folder.0.join("log")).unwrap_or_default();
        bail!("{} ended with {code:?}: {}", board.name(), log.trim());
    }
    Ok(answer)
}

/// The emulator without the image. An instruction takes 64 ns, so that its timers count instructions.
fn emulator(board: Board) -> (&'static str, Vec<&'static str>) {
    let machine = match board {
        Board::Mps2An386 => "mps2-an386",
        Board::Mps2An500 => "mps2-an500",
    };
    let mut arguments = vec!["-M", machine, "-icount", "shift=6"];
    arguments.extend(["-display", "none", "-monitor", "none", "-serial", "none"]);
    arguments.extend(["-semihosting-config", "enable=on,target=native"]);
    ("qemu-system-arm", arguments)
}

fn wait(mut child: Child) -> Result<Option<i32>> {
    let started = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status.code());
        }
        if started.elapsed() > TIME_LIMIT {
            child.kill()?;
            child.wait()?;
            bail!("the emulator did not end within {} s", TIME_LIMIT.as_secs());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// A folder that goes when it is dropped.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Result<Self> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("viewshed-board-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&path).with_context(|| format!("cannot create {}", path.display()))?;
        Ok(Self(path))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

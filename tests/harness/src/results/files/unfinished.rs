//! A file that is being written: beside its target under another name until it is whole.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, Once, PoisonError};

use anyhow::{Context, Result};

/// Files that are not whole yet. Whoever ends the program removes them.
static PARTS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn parts() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    PARTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file that becomes its target when [`Unfinished::finish`] is called, and nothing when it is dropped before,
/// on Ctrl-C, on SIGTERM or when its terminal closes.
pub struct Unfinished {
    target: PathBuf,
    /// Name until it is whole; `None` for pipes and devices, which are written to as they are.
    part: Option<PathBuf>,
    file: BufWriter<File>,
    /// Told once it is whole.
    whole: Box<dyn Fn() + Send>,
}

impl Unfinished {
    /// Opens the file.
    pub(super) fn create(target: &Path, whole: impl Fn() + Send + 'static) -> Result<Self> {
        let opened = if super::is_stream(target) {
            OpenOptions::new().write(true).open(target).map(|file| (target.to_owned(), None, file))
        } else {
            open_part(target).map(|(target, part, file)| (target, Some(part), file))
        };
        let (target, part, file) = opened.with_context(|| format!("cannot write {}", target.display()))?;
        Ok(Self { target, part, file: BufWriter::new(file), whole: Box::new(whole) })
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// What is held back cannot be written, or the file cannot be renamed; then there is none.
    pub fn finish(mut self) -> Result<()> {
        self.flush().and_then(|()| self.rename()).with_context(|| format!("cannot write {}", self.target.display()))
    }

    fn rename(&mut self) -> io::Result<()> {
        let Some(part) = &self.part else { return Ok(()) };
        // no signal between the two
        let mut parts = parts();
        fs::rename(part, &self.target)?;
        parts.remove(part);
        self.part = None;
        (self.whole)();
        Ok(())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if let Some(part) = &self.part {
            let mut parts = parts();
            // that it cannot be removed is no new error
            let _ = fs::remove_file(part);
            parts.remove(part);
        }
    }
}

impl Write for Unfinished {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Unfinished {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Makes a file in a folder and removes it.
pub(super) fn try_in(folder: &Path) -> io::Result<()> {
    let (_, part, file) = open_part(&folder.join("try"))?;
    drop(file);
    let mut parts = parts();
    parts.remove(&part);
    fs::remove_file(part)
}

/// The target with links resolved, the name it has until it is whole, and the open file.
fn open_part(target: &Path) -> io::Result<(PathBuf, PathBuf, File)> {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    remove_at_signals();
    let target = target.canonicalize().unwrap_or_else(|_| target.to_owned());
    let name = target.file_name().ok_or(io::ErrorKind::InvalidFilename)?.to_string_lossy();
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let part = target.with_file_name(format!(".{name}.{}-{number}.part", std::process::id()));
    let mut parts = parts();
    let file = OpenOptions::new().write(true).create_new(true).open(&part)?;
    parts.insert(part.clone());
    if let Ok(before) = target.metadata() {
        let _ = file.set_permissions(before.permissions());
    }
    Ok((target, part, file))
}

/// Whether Ctrl-C is waited for by the command itself.
static WAITED_FOR: AtomicBool = AtomicBool::new(false);

/// From now on Ctrl-C does not end the program but sets what is returned, once: for commands that go on until then.
///
/// # Errors
/// The system's.
#[cfg(unix)]
pub fn until_ctrl_c() -> io::Result<Arc<AtomicBool>> {
    use signal_hook::consts::SIGINT;

    let stop = Arc::new(AtomicBool::new(false));
    signal_hook::flag::register(SIGINT, stop.clone())?;
    WAITED_FOR.store(true, Ordering::SeqCst);
    Ok(stop)
}

/// Removes what is not whole when the program is ended by Ctrl-C, SIGTERM or a terminal that closes, and lets it end by
/// that.
#[cfg(unix)]
fn remove_at_signals() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // without the handler a part may be left, which has another name than the target
        let hangup = if outlasts_its_terminal() { None } else { Some(SIGHUP) };
        let Ok(mut signals) = Signals::new([SIGINT, SIGTERM].into_iter().chain(hangup)) else { return };
        std::thread::spawn(move || {
            for signal in signals.forever() {
                if signal == SIGINT && WAITED_FOR.load(Ordering::SeqCst) {
                    continue;
                }
                // kept to the end: no file becomes whole or begins any more
                let parts = parts();
                parts.iter().for_each(|part| drop(fs::remove_file(part)));
                let _ = emulate_default_handler(signal);
            }
        });
    });
}

/// Whether hang-ups are ignored, as `nohup` has it; that is kept. Where it cannot be known, too.
#[cfg(unix)]
fn outlasts_its_terminal() -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_none_or(|mask| mask & 1 != 0)
}

#[cfg(not(unix))]
fn remove_at_signals() {}

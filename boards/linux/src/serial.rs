//! A serial port that may go and come back: an unplugged adapter costs what was under way, nothing else.

use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use log::{info, warn};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::termios::{ControlModes, OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};

/// First and longest wait before a port is opened again.
const BACK_OFF: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(5)];

/// A port that held this long is waited for as if it had never failed.
const CALM: Duration = Duration::from_secs(10);

/// What is under way longer than this comes too late: nothing more is put into a queue this long.
const MOST_QUEUED: Duration = Duration::from_millis(50);

/// A message that waits longer for the rest of itself to be taken is cut off.
const PATIENCE: Duration = Duration::from_millis(100);

/// A port by its path.
pub struct Serial {
    path: PathBuf,
    baud: u32,
    /// Wait for room instead of refusing: for test benches, where nothing may be lost.
    patient: bool,
    port: Option<File>,
    opened: Option<Instant>,
    retry_at: Option<Instant>,
    back_off: Duration,
    last_error: String,
    /// What of a message the port has not taken yet, and since when.
    rest: Vec<u8>,
    rest_since: Option<Instant>,
    /// When the line has sent all it was given.
    free_at: Option<Instant>,
    /// Times it was opened and lost.
    pub opens: u32,
    pub losses: u32,
}

impl Serial {
    pub fn new(path: &Path, baud: u32, patient: bool) -> Self {
        Self {
            path: path.to_owned(),
            baud,
            patient,
            port: None,
            opened: None,
            retry_at: None,
            back_off: BACK_OFF[0],
            last_error: String::new(),
            rest: Vec::new(),
            rest_since: None,
            free_at: None,
            opens: 0,
            losses: 0,
        }
    }

    /// Opens the port if it is not open and the time has come.
    pub fn keep_open(&mut self) {
        let now = Instant::now();
        if self.port.is_some() || self.retry_at.is_some_and(|at| now < at) {
            return;
        }
        match open(&self.path, self.baud) {
            Ok(port) => {
                self.opens += 1;
                info!("{}: open, {} baud", self.path.display(), self.baud);
                self.last_error.clear();
                (self.port, self.opened) = (Some(port), Some(now));
            }
            Err(e) => {
                let error = e.to_string();
                // once, not at every attempt
                if error != self.last_error {
                    warn!("{}: {error}; trying again until it opens", self.path.display());
                    self.last_error = error;
                }
                self.wait_longer(now);
            }
        }
    }

    fn wait_longer(&mut self, now: Instant) {
        self.retry_at = Some(now + self.back_off);
        self.back_off = (self.back_off * 2).min(BACK_OFF[1]);
    }

    fn lost(&mut self, why: &str) {
        let now = Instant::now();
        warn!("{}: lost: {why}; trying again until it opens", self.path.display());
        self.losses += 1;
        if self.opened.is_some_and(|opened| now.duration_since(opened) >= CALM) {
            self.back_off = BACK_OFF[0];
        }
        (self.port, self.rest_since, self.free_at) = (None, None, None);
        self.rest.clear();
        self.wait_longer(now);
    }

    /// For waiting until bytes come.
    pub fn fd(&self) -> Option<BorrowedFd<'_>> {
        self.port.as_ref().map(AsFd::as_fd)
    }

    /// Bytes that came; none is no error.
    pub fn read<'b>(&mut self, buffer: &'b mut [u8]) -> &'b [u8] {
        let Some(port) = &mut self.port else { return &[] };
        match port.read(buffer) {
            Ok(0) => self.lost("hung up"),
            Ok(n) => return &buffer[..n],
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(e) => self.lost(&e.to_string()),
        }
        &[]
    }

    /// Sends all of a message or nothing of it; `false` if there is no room or no port.
    pub fn send(&mut self, message: &[u8]) -> bool {
        let now = Instant::now();
        self.push_rest(now);
        if self.port.is_none() || !self.rest.is_empty() {
            return false;
        }
        let free_at = self.free_at.map_or(now, |at| at.max(now));
        if !self.patient && free_at - now > MOST_QUEUED {
            return false;
        }
        let bits = 10 * u32::try_from(message.len()).unwrap_or(u32::MAX);
        self.free_at = Some(free_at + Duration::from_secs(1) * bits / self.baud);
        self.rest.extend_from_slice(message);
        self.rest_since = Some(now);
        self.push_rest(now);
        self.port.is_some()
    }

    /// Hands over what the port did not take before; what waited too long is cut off.
    pub fn push_rest(&mut self, now: Instant) {
        while let (Some(port), false) = (&mut self.port, self.rest.is_empty()) {
            match port.write(&self.rest) {
                Ok(n) => drop(self.rest.drain(..n)),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) if e.kind() == ErrorKind::WouldBlock && self.patient => {
                    let _ = poll(&mut [PollFd::new(port, PollFlags::OUT)], Some(&Timespec { tv_sec: 1, tv_nsec: 0 }));
                }
                Err(e) if e.kind() == ErrorKind::WouldBlock => {
                    if self.rest_since.is_some_and(|since| now.duration_since(since) > PATIENCE) {
                        let _ = tcflush(port, QueueSelector::OFlush);
                        // the zero ends what is cut off
                        self.rest.splice(.., [0]);
                        self.rest_since = Some(now);
                    }
                    return;
                }
                Err(e) => self.lost(&e.to_string()),
            }
        }
    }
}

/// Raw, eight bits, no flow control, never waiting.
fn open(path: &Path, baud: u32) -> std::io::Result<File> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let port = rustix::fs::open(path, flags, Mode::empty())?;
    let mut modes = tcgetattr(&port)?;
    modes.make_raw();
    modes.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL;
    modes.control_modes -= ControlModes::CRTSCTS | ControlModes::CSTOPB;
    modes.set_speed(baud)?;
    tcsetattr(&port, OptionalActions::Now, &modes)?;
    // of others' bytes nothing is wanted
    tcflush(&port, QueueSelector::IOFlush)?;
    Ok(File::from(port))
}

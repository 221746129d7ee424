//! A SocketCAN interface of this machine.

use std::io::ErrorKind;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use socketcan::{CanFdSocket, ShouldRetry, Socket};
use viewshed::wire::frame::CanFrame;

use super::can::CanBus;
use crate::recording::can_log::live::{self, from_socketcan, refused, to_socketcan};

/// Linux's error for a full queue.
const NO_BUFFERS: i32 = 105;
/// How long an interface may take no frame.
const PATIENCE: Duration = Duration::from_secs(2);

/// An open interface.
pub struct Interface {
    name: String,
    socket: CanFdSocket,
}

impl Interface {
    /// Opens it.
    ///
    /// # Errors
    /// None of that name, or one that is down: with what to do.
    pub fn open(name: &str) -> Result<Self> {
        let socket = live::open(name, |socket| socket.set_nonblocking(true))?;
        Ok(Self { name: name.to_owned(), socket })
    }
}

impl CanBus for Interface {
    fn send(&mut self, frame: &CanFrame) -> Result<()> {
        let Some(out) = to_socketcan(frame) else { bail!("{}: a frame that no CAN bus carries", self.name) };
        let begun = Instant::now();
        loop {
            match self.socket.write_frame(&out) {
                Ok(()) => return Ok(()),
                // a full queue empties, unless nobody acknowledges
                Err(e) if (e.should_retry() || e.raw_os_error() == Some(NO_BUFFERS)) && begun.elapsed() < PATIENCE => {
                    std::thread::sleep(Duration::from_millis(1));
                }
                Err(e) if e.should_retry() || e.raw_os_error() == Some(NO_BUFFERS) => {
                    bail!(
                        "{}: frames do not leave: nobody acknowledges them. Is a unit powered and on this bus?",
                        self.name
                    )
                }
                Err(e) => bail!("{}", refused(&self.name, &e)),
            }
        }
    }

    fn receive(&mut self, until: Instant) -> Result<Option<CanFrame>> {
        loop {
            match self.socket.read_frame() {
                Ok(frame) => {
                    if let Some(frame) = from_socketcan(&frame) {
                        return Ok(Some(frame));
                    }
                }
                Err(e) if e.should_retry() || e.kind() == ErrorKind::WouldBlock => {
                    if Instant::now() >= until {
                        return Ok(None);
                    }
                    std::thread::sleep(Duration::from_millis(1));
                }
                Err(e) => bail!("{}", refused(&self.name, &e)),
            }
        }
    }
}

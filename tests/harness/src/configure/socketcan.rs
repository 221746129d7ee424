//! A SocketCAN interface of this machine.

use std::io::ErrorKind;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, bail};
use socketcan::{CanFdSocket, ShouldRetry, Socket};
use viewshed::wire::frame::CanFrame;

use super::can::CanBus;
use crate::recording::can_log::live::{from_socketcan, to_socketcan};

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
        let up = format!("`sudo ip link set {name} up type can bitrate 500000 sample-point 0.8 restart-ms 100`");
        let socket = CanFdSocket::open(name).map_err(|error| match error.raw_os_error() {
            // ENODEV
            Some(19) => anyhow!("{name}: no such CAN interface; `ip -br link show type can` lists those there are"),
            // EAFNOSUPPORT
            Some(97) => anyhow!("{name}: this machine's kernel has no CAN"),
            _ => anyhow!("{name}: {error}"),
        })?;
        // an interface that is down can be opened, and says so afterwards
        if let Some(error) = socket.as_raw_socket().take_error()? {
            bail!("{name}: {error}; {up}");
        }
        socket.set_nonblocking(true)?;
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
                Err(e) if (e.should_retry() || e.raw_os_error() == Some(105)) && begun.elapsed() < PATIENCE => {
                    std::thread::sleep(Duration::from_millis(1));
                }
                Err(e) if e.should_retry() || e.raw_os_error() == Some(105) => {
                    bail!(
                        "{}: frames do not leave: nobody acknowledges them. Is a unit powered and on this bus?",
                        self.name
                    )
                }
                Err(e) => return Err(e).with_context(|| format!("{}: cannot send", self.name)),
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
                Err(e) => return Err(e).with_context(|| format!("{}: the interface is gone", self.name)),
            }
        }
    }
}

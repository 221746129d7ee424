//! A SocketCAN interface as the library's controller. The system sets its bit rate and restarts it after a
//! bus-off; here it is opened, watched and opened again.

use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, SystemTime};

use log::{info, warn};
use rustix::io::Errno;
use socketcan::{CanAnyFrame, CanFdSocket, ShouldRetry, Socket, SocketOptions};
use viewshed::CanFrame;
use viewshed::board::CanPort;

use crate::frames::{from_socketcan, to_socketcan};

/// Bytes of frames under way that the socket may hold; the kernel's least, about five frames.
const SEND_BUFFER: usize = 1;

/// Error class of a controller that went bus-off, `CAN_ERR_BUSOFF`.
const BUS_OFF: u32 = 0x40;

/// An interface by its name.
pub struct Interface {
    name: String,
    /// Nothing but errors is wanted of it.
    errors_only: bool,
    socket: Option<CanFdSocket>,
    off: bool,
    last_error: String,
    /// How long ago the last frame came.
    pub age: Duration,
    /// Times its controller went bus-off; the keeper counts every return, those of a missing interface too.
    pub bus_offs: u16,
}

impl Interface {
    pub fn new(name: &str, errors_only: bool) -> Self {
        let (name, last_error) = (name.to_owned(), String::new());
        Self { name, errors_only, socket: None, off: false, last_error, age: Duration::ZERO, bus_offs: 0 }
    }

    /// For waiting until frames come.
    pub fn fd(&self) -> Option<BorrowedFd<'_>> {
        self.socket.as_ref().map(AsFd::as_fd)
    }

    fn open(&self) -> std::io::Result<CanFdSocket> {
        let socket = CanFdSocket::open(&self.name)?;
        // an interface that is down can be opened, and says so afterwards
        socket.as_raw_socket().take_error()?.map_or(Ok(()), Err)?;
        socket.set_nonblocking(true)?;
        socket.set_error_filter_accept_all()?;
        socket.set_recv_timestamp(true)?;
        // what a socket holds cannot be taken back: little is to wait there
        socket.as_raw_socket().set_send_buffer_size(SEND_BUFFER)?;
        if self.errors_only {
            socket.set_filter_drop_all()?;
        }
        Ok(socket)
    }

    fn failed(&mut self, why: &str) {
        self.off = true;
        self.say(&format!("{why}; trying again until it works"));
    }

    /// Once, not at every attempt.
    fn say(&mut self, what: &str) {
        if what != self.last_error {
            warn!("{}: {what}", self.name);
            what.clone_into(&mut self.last_error);
        }
    }
}

impl CanPort for Interface {
    fn receive(&mut self) -> Option<CanFrame> {
        loop {
            let socket = self.socket.as_ref()?;
            let (frame, stamps) = match socket.read_frame_with_timestamps() {
                Ok(read) => read,
                Err(e) if e.should_retry() => return None,
                Err(e) => {
                    self.failed(&e.to_string());
                    return None;
                }
            };
            if let CanAnyFrame::Error(frame) = &frame
                && frame.error_bits() & BUS_OFF != 0
            {
                self.bus_offs = self.bus_offs.saturating_add(1);
                self.failed("bus-off");
                return None;
            }
            if let Some(frame) = from_socketcan(&frame) {
                self.last_error.clear();
                let age = stamps.socket.and_then(|at| SystemTime::now().duration_since(at).ok());
                self.age = age.unwrap_or_default().min(Duration::from_secs(1));
                return Some(frame);
            }
        }
    }

    fn send(&mut self, frame: &CanFrame) -> bool {
        let (Some(socket), Some(frame)) = (&self.socket, to_socketcan(frame)) else { return false };
        match socket.write_frame(&frame) {
            Ok(()) => {
                self.last_error.clear();
                true
            }
            // opened again it would be the same; a frame that it takes is sent as soon as it is set up so
            Err(e) if matches!(frame, CanAnyFrame::Fd(_)) && is(&e, Errno::INVAL) => {
                self.say(&no_fd(&self.name));
                false
            }
            Err(e) if e.should_retry() || is(&e, Errno::NOBUFS) => false,
            Err(e) => {
                self.failed(&e.to_string());
                false
            }
        }
    }

    fn abort(&mut self) {
        self.socket = None;
    }

    fn bus_off(&mut self) -> bool {
        self.off
    }

    fn start(&mut self, _silent: bool) {
        if self.socket.is_some() && !self.off {
            return;
        }
        match self.open() {
            Ok(socket) => {
                info!("{}: open", self.name);
                (self.socket, self.off) = (Some(socket), false);
            }
            Err(e) => self.failed(&e.to_string()),
        }
    }
}

fn is(e: &std::io::Error, errno: Errno) -> bool {
    e.raw_os_error() == Some(errno.raw_os_error())
}

/// Why an interface refuses frames of CAN FD.
fn no_fd(name: &str) -> String {
    format!(
        "takes no CAN FD frames; set it up for them: `ip link set {name} type can bitrate 500000 dbitrate 2000000 fd on`, or \
         medium = \"can\""
    )
}

//! Frames of a SocketCAN interface as they come, as lines of a log.

use std::io::ErrorKind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context, Result, anyhow, bail};
use socketcan::{CanAnyFrame, CanFdSocket, EmbeddedFrame, Id, ShouldRetry, Socket, SocketOptions};
use viewshed::wire::frame::CanId;

use super::{Content, Line};

/// The daemon's, which knows the same frames.
#[allow(dead_code)]
#[path = "../../../../../boards/linux/src/frames.rs"]
mod frames;
pub use frames::{from_socketcan, to_socketcan};

/// How long a silent bus is waited for at a time.
const WAIT: Duration = Duration::from_millis(50);

/// Linux's errors that say what is to be done.
const NO_SUCH_DEVICE: i32 = 19;
const NO_CAN_IN_KERNEL: [i32; 2] = [93, 97];
const IS_DOWN: i32 = 100;

/// Kind of a network interface in `/sys/class/net/NAME/type` that is one of a CAN bus.
const KIND_CAN: &str = "280";

/// An open interface.
pub struct Bus {
    name: String,
    socket: CanFdSocket,
}

impl Bus {
    /// Opens an interface to listen; nothing is ever sent.
    ///
    /// # Errors
    /// No such interface, one that is down, a kernel without CAN, no permission; each with what to do.
    pub fn open(name: &str) -> Result<Self> {
        let socket = open(name, |socket| {
            socket.set_error_filter_accept_all()?;
            socket.set_recv_timestamp(true)?;
            socket.set_read_timeout(WAIT)
        })?;
        Ok(Self { name: name.to_owned(), socket })
    }

    /// Hands over every frame until the time is up or `stop` is set, and the time now and then while there is none.
    ///
    /// # Errors
    /// The interface goes down or away, and those of `each`.
    pub fn listen(
        &self,
        longest: Option<Duration>,
        stop: &AtomicBool,
        mut each: impl FnMut(Heard) -> Result<()>,
    ) -> Result<()> {
        let started = Instant::now();
        while !stop.load(Ordering::SeqCst) && longest.is_none_or(|longest| started.elapsed() < longest) {
            let (frame, stamps) = match self.socket.read_frame_with_timestamps() {
                Ok(read) => read,
                // by a signal, too
                Err(e) if e.should_retry() || e.kind() == ErrorKind::Interrupted => {
                    each(Heard::Nothing(nanoseconds(SystemTime::now())))?;
                    continue;
                }
                Err(e) => bail!("{}", refused(&self.name, &e)),
            };
            let content = match &frame {
                CanAnyFrame::Error(error) => Some(Content::Error(error.error_bits())),
                CanAnyFrame::Remote(remote) => id(remote.id()).map(Content::Remote),
                data => from_socketcan(data).map(Content::Data),
            };
            let time_ns = nanoseconds(stamps.socket.unwrap_or_else(SystemTime::now));
            let content = content.context("a frame whose identifier is none")?;
            each(Heard::Frame(Line { time_ns, interface: self.name.clone(), content }))?;
        }
        Ok(())
    }
}

/// What came within a short time.
pub enum Heard {
    Frame(Line),
    /// The time at which nothing had come, nanoseconds since 1970.
    Nothing(i64),
}

fn id(id: Id) -> Option<CanId> {
    match id {
        Id::Standard(id) => CanId::standard(id.as_raw()),
        Id::Extended(id) => CanId::extended(id.as_raw()),
    }
}

fn nanoseconds(time: SystemTime) -> i64 {
    let passed = time.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(passed.as_nanos()).unwrap_or(i64::MAX)
}

/// Opens an interface, and sets it as it is wanted.
///
/// # Errors
/// No such interface, one that is down, a kernel without CAN, no permission; each with what to do.
pub fn open(name: &str, set: impl FnOnce(&CanFdSocket) -> std::io::Result<()>) -> Result<CanFdSocket> {
    let opened = || {
        let socket = CanFdSocket::open(name)?;
        // one that is down can be opened, and says so afterwards
        socket.as_raw_socket().take_error()?.map_or(Ok(()), Err)?;
        set(&socket)?;
        Ok(socket)
    };
    opened().map_err(|error| anyhow!("{}", refused(name, &error)))
}

/// Why an interface cannot be listened to, and what to do.
pub fn refused(name: &str, error: &std::io::Error) -> String {
    let kind = |name: &str| std::fs::read_to_string(format!("/sys/class/net/{name}/type")).ok();
    let is_can = |name: &str| kind(name).is_some_and(|kind| kind.trim() == KIND_CAN);
    match error.raw_os_error() {
        Some(NO_SUCH_DEVICE) if kind(name).is_some() && !is_can(name) => format!("{name} is no CAN interface"),
        Some(NO_SUCH_DEVICE) => {
            let all = std::fs::read_dir("/sys/class/net").into_iter().flatten().flatten();
            let names = all.map(|entry| entry.file_name().to_string_lossy().into_owned()).filter(|name| is_can(name));
            let mut names: Vec<String> = names.collect();
            names.sort();
            let found = if names.is_empty() { "none; is the adapter plugged in?".to_owned() } else { names.join(", ") };
            format!("there is no interface {name}; CAN interfaces here: {found}")
        }
        Some(IS_DOWN) => {
            format!("{name} is down; set it up: `ip link set {name} up type can bitrate 500000` (as root)")
        }
        Some(code) if NO_CAN_IN_KERNEL.contains(&code) => format!(
            "{name}: this kernel has no CAN; load it with `modprobe can-raw` (as root), or record where there is one and name the log"
        ),
        _ if error.kind() == ErrorKind::PermissionDenied => {
            format!("{name}: this user may not open it; run as root, or outside of the container")
        }
        _ => format!("{name} cannot be listened to: {error}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_refuses_says_what_to_do() {
        let said = |name: &str, code: i32| refused(name, &std::io::Error::from_raw_os_error(code));
        assert!(said("can7", NO_SUCH_DEVICE).starts_with("there is no interface can7; CAN interfaces here: "));
        assert_eq!(said("lo", NO_SUCH_DEVICE), "lo is no CAN interface");
        assert!(said("can0", IS_DOWN).contains("ip link set can0 up type can bitrate 500000"));
        assert!(said("can0", NO_CAN_IN_KERNEL[1]).contains("modprobe can-raw"));
        assert!(said("can0", 1).contains("run as root") && said("can0", 13).contains("run as root"));
        assert!(said("can0", 5).contains("cannot be listened to"));
    }
}

//! Serial lines of an emulated board: unix sockets towards its UARTs.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use serialport::TTYPort;

/// The board's three lines: radar in, maps out, traces out.
pub const LINES: [&str; 3] = ["radar.sock", "maps.sock", "traces.sock"];

/// Sockets the emulator will connect to.
pub struct Waiting(Vec<UnixListener>);

impl Waiting {
    /// Opens the sockets in the emulator's folder.
    ///
    /// # Errors
    /// A path too long for a socket.
    pub fn new(folder: &Path) -> Result<Self> {
        let open = |name: &&str| {
            let listener = UnixListener::bind(folder.join(name))?;
            listener.set_nonblocking(true)?;
            Ok(listener)
        };
        let listeners: std::io::Result<Vec<_>> = LINES.iter().map(open).collect();
        listeners.map(Self).context("cannot open the sockets of the serial lines")
    }

    /// Waits for the emulator.
    ///
    /// # Errors
    /// It does not come.
    pub fn accept(self) -> Result<SerialBoard> {
        let started = Instant::now();
        let mut lines = Vec::new();
        for listener in &self.0 {
            loop {
                match listener.accept() {
                    Ok((stream, _)) => break lines.push(stream),
                    Err(e) if e.kind() == ErrorKind::WouldBlock && started.elapsed() < Duration::from_secs(20) => {
                        std::thread::sleep(Duration::from_millis(5));
                    }
                    Err(e) => return Err(e).context("the emulator does not open its serial lines"),
                }
            }
        }
        for line in &lines {
            line.set_nonblocking(true)?;
        }
        let Ok([radar, maps, traces]) = <[UnixStream; 3]>::try_from(lines) else { bail!("a line is missing") };
        Ok(SerialBoard { radar, maps, traces, answer: Vec::new(), trace: Vec::new(), deaf: false })
    }
}

/// The far end of a board's serial lines.
pub struct SerialBoard {
    radar: UnixStream,
    maps: UnixStream,
    traces: UnixStream,
    /// Everything that came on the line of the maps, and of the traces.
    pub answer: Vec<u8>,
    pub trace: Vec<u8>,
    /// Nobody reads the line of the maps.
    pub deaf: bool,
}

/// A serial line with a board at its far end, emulated or real.
pub trait Far {
    /// Puts in some of the bytes, and returns how many.
    ///
    /// # Errors
    /// The line is gone.
    fn put(&mut self, bytes: &[u8]) -> Result<usize>;

    /// Collects what came; whether anything did.
    ///
    /// # Errors
    /// The line is gone.
    fn collect(&mut self) -> Result<bool>;

    /// Everything that came.
    fn answer(&self) -> &[u8];

    /// Sends bytes and collects what comes back meanwhile.
    ///
    /// # Errors
    /// The board takes no more.
    fn send(&mut self, mut bytes: &[u8]) -> Result<()> {
        let mut last = Instant::now();
        while !bytes.is_empty() {
            let taken = self.put(bytes)?;
            bytes = &bytes[taken..];
            if self.collect()? || taken > 0 {
                last = Instant::now();
            } else if last.elapsed() > Duration::from_secs(20) {
                bail!("the board takes no more bytes");
            } else {
                std::thread::sleep(Duration::from_micros(200));
            }
        }
        Ok(())
    }

    /// Collects until that many bytes came on the line of the maps, or nothing for a while.
    ///
    /// # Errors
    /// The line is gone.
    fn wait_for(&mut self, bytes: usize, silence: Duration) -> Result<()> {
        let mut last = Instant::now();
        while self.answer().len() < bytes && last.elapsed() < silence {
            if self.collect()? {
                last = Instant::now();
            } else {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        Ok(())
    }
}

impl Far for SerialBoard {
    fn put(&mut self, bytes: &[u8]) -> Result<usize> {
        match self.radar.write(bytes) {
            Ok(n) => Ok(n),
            Err(e) if e.kind() == ErrorKind::WouldBlock => Ok(0),
            Err(e) => Err(e).context("the board's line is gone"),
        }
    }

    fn collect(&mut self) -> Result<bool> {
        let maps = !self.deaf && drain(&mut self.maps, &mut self.answer)?;
        let traces = drain(&mut self.traces, &mut self.trace)?;
        Ok(maps || traces)
    }

    fn answer(&self) -> &[u8] {
        &self.answer
    }
}

/// A board behind a serial port: radar in and maps out on the same one.
pub struct Port {
    port: TTYPort,
    answer: Vec<u8>,
}

impl Port {
    /// Opens a port.
    ///
    /// # Errors
    /// No such port, or one that cannot be set.
    pub fn open(path: &str, baud: u32) -> Result<Self> {
        let port = serialport::new(path, baud).timeout(Duration::from_millis(1));
        let port = TTYPort::open(&port).with_context(|| format!("cannot open {path}"))?;
        Ok(Self { port, answer: Vec::new() })
    }
}

impl Far for Port {
    fn put(&mut self, bytes: &[u8]) -> Result<usize> {
        match self.port.write(&bytes[..bytes.len().min(64)]) {
            Ok(n) => Ok(n),
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => Ok(0),
            Err(e) => Err(e).context("the port is gone"),
        }
    }

    fn collect(&mut self) -> Result<bool> {
        let mut buffer = [0; 4096];
        match self.port.read(&mut buffer) {
            Ok(n) => {
                self.answer.extend_from_slice(&buffer[..n]);
                Ok(n > 0)
            }
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => Ok(false),
            Err(e) => Err(e).context("the port is gone"),
        }
    }

    fn answer(&self) -> &[u8] {
        &self.answer
    }
}

fn drain(line: &mut UnixStream, into: &mut Vec<u8>) -> Result<bool> {
    let mut buffer = [0; 4096];
    match line.read(&mut buffer) {
        Ok(n) => {
            into.extend_from_slice(&buffer[..n]);
            Ok(n > 0)
        }
        Err(e) if e.kind() == ErrorKind::WouldBlock => Ok(false),
        Err(e) => Err(e).context("the board's line is gone"),
    }
}

//! Serial lines of an emulated board: unix sockets towards its UARTs.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

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
        Ok(SerialBoard { radar, maps, traces, answer: Vec::new(), trace: Vec::new() })
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
}

impl SerialBoard {
    /// Sends bytes and collects what comes back meanwhile.
    ///
    /// # Errors
    /// The board takes no more.
    pub fn send(&mut self, mut bytes: &[u8]) -> Result<()> {
        let started = Instant::now();
        while !bytes.is_empty() {
            match self.radar.write(bytes) {
                Ok(n) => bytes = &bytes[n..],
                Err(e) if e.kind() == ErrorKind::WouldBlock => {}
                Err(e) => return Err(e).context("the board's line is gone"),
            }
            if !self.collect()? && !bytes.is_empty() {
                if started.elapsed() > Duration::from_secs(120) {
                    bail!("the board takes no more bytes");
                }
                std::thread::sleep(Duration::from_micros(200));
            }
        }
        Ok(())
    }

    /// Collects until that many bytes came on the line of the maps, or nothing for a while.
    ///
    /// # Errors
    /// The line is gone.
    pub fn wait_for(&mut self, bytes: usize, silence: Duration) -> Result<()> {
        let mut last = Instant::now();
        while self.answer.len() < bytes && last.elapsed() < silence {
            if self.collect()? {
                last = Instant::now();
            } else {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        Ok(())
    }

    fn collect(&mut self) -> Result<bool> {
        let maps = drain(&mut self.maps, &mut self.answer)?;
        let traces = drain(&mut self.traces, &mut self.trace)?;
        Ok(maps || traces)
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

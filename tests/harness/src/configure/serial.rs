//! A unit behind a serial port.

use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use viewshed::unit::reply::Said;
use viewshed::unit::service::{EVERY_SENSOR, PART_LEN, Request};
use viewshed::unit::settings::UnitConfig;
use viewshed::wire::message::Received;
use viewshed::wire::serial::{MOST_STUFFED, Unstuffer, stuff};

use super::link::{Ask, Link, Noise};

/// Bit rates units are set to, the one after every start first.
pub const RATES: [u32; 6] = [UnitConfig::SERVICE_BAUD, 230_400, 921_600, 460_800, 57_600, 1_000_000];

/// How long a line may take no byte.
const PATIENCE: Duration = Duration::from_secs(2);

/// A port whose bit rate can be changed.
pub trait Baud {
    /// Goes on at another bit rate.
    ///
    /// # Errors
    /// One it cannot make.
    fn set_baud(&mut self, baud: u32) -> Result<()>;
}

/// The line.
pub struct SerialLink<P> {
    port: P,
    name: String,
    place: String,
    sensor: u8,
    counter: u8,
    unstuffer: Unstuffer,
    /// What came and is not yet looked at.
    rest: Vec<u8>,
    noise: Noise,
    rates: std::vec::IntoIter<u32>,
}

impl<P: Read + Write + Baud> SerialLink<P> {
    /// A port that is open at the first of these rates; the others are tried where nothing answers.
    pub fn new(port: P, name: &str, rates: Vec<u32>) -> Self {
        let mut rates = rates.into_iter();
        let place = rates.next().map_or_else(|| name.to_owned(), |rate| format!("{name} at {rate} baud"));
        let (rest, noise) = (Vec::new(), Noise::default());
        Self {
            port,
            name: name.to_owned(),
            place,
            sensor: EVERY_SENSOR,
            counter: 0,
            unstuffer: Unstuffer::new(),
            rest,
            noise,
            rates,
        }
    }

    fn set_rate(&mut self, rate: u32) -> Result<()> {
        self.port.set_baud(rate)?;
        self.place = format!("{} at {rate} baud", self.name);
        Ok(())
    }

    /// The next message among the bytes that came.
    fn message(&mut self) -> Option<Vec<u8>> {
        while !self.rest.is_empty() {
            let (taken, message) = self.unstuffer.push(&self.rest);
            let message = message.map(<[u8]>::to_vec);
            self.rest.drain(..taken);
            if message.is_some() {
                return message;
            }
        }
        None
    }
}

impl<P: Read + Write + Baud> Link for SerialLink<P> {
    fn place(&self) -> &str {
        &self.place
    }

    fn pieces(&self) -> &'static str {
        "bytes"
    }

    fn to(&mut self, sensor: Option<u8>) {
        self.sensor = sensor.unwrap_or(EVERY_SENSOR);
    }

    fn ask(&mut self, what: Ask<'_>) -> Result<()> {
        let request = match what {
            Ask::Identify => Request::Identify,
            // there is one at the other end
            Ask::Address(_) | Ask::Again(..) => return Ok(()),
            Ask::Read(which) => Request::Read(which),
            Ask::ReadPart(which, place) => Request::ReadPart(which, place),
            Ask::Write(block) if block.len() <= PART_LEN => Request::Write(block),
            Ask::Write(block) => part(block, 0),
            Ask::Part(block, place) => part(block, place),
            Ask::Restart => Request::Restart,
            Ask::Clear(kind) => Request::Clear(kind),
            Ask::Timing => Request::Timing,
        };
        let message = request.message(self.sensor, self.counter);
        self.counter = self.counter.wrapping_add(1);
        let mut line = [0; MOST_STUFFED];
        let length = stuff(message.bytes(), &mut line).unwrap_or(0);
        // a message begins after a zero: half of another one may be on the line
        let bytes = [&[0], &line[..length]].concat();
        let (mut rest, mut last) = (&bytes[..], Instant::now());
        while !rest.is_empty() {
            match self.port.write(rest) {
                Ok(n) if n > 0 => (rest, last) = (&rest[n..], Instant::now()),
                Err(e) if !is_wait(e.kind()) => {
                    return Err(e).with_context(|| format!("{}: cannot be written", self.place));
                }
                _ if last.elapsed() > PATIENCE => bail!("{}: takes no bytes; is its flow control on?", self.place),
                _ => std::thread::sleep(Duration::from_millis(1)),
            }
        }
        Ok(())
    }

    fn hear(&mut self, until: Instant) -> Result<Option<Said>> {
        loop {
            while let Some(message) = self.message() {
                if let Some(said) = Said::read(&message, self.sensor) {
                    return Ok(Some(said));
                }
                if let Ok(received) = Received::from_bytes(&message) {
                    *self.noise.sensors.entry(received.sensor).or_default() += 1;
                }
            }
            if Instant::now() >= until {
                return Ok(None);
            }
            let mut buffer = [0; 1024];
            match self.port.read(&mut buffer) {
                Ok(0) => std::thread::sleep(Duration::from_millis(1)),
                Ok(n) => {
                    self.noise.pieces += n as u64;
                    self.rest.extend_from_slice(&buffer[..n]);
                }
                Err(e) if is_wait(e.kind()) => std::thread::sleep(Duration::from_millis(1)),
                Err(e) => return Err(e).with_context(|| format!("{}: the port is gone", self.place)),
            }
        }
    }

    fn noise(&self) -> &Noise {
        &self.noise
    }

    fn is_bus(&self) -> bool {
        false
    }

    fn restarted(&mut self, is_bench: bool) -> Result<()> {
        if is_bench { Ok(()) } else { self.set_rate(UnitConfig::SERVICE_BAUD) }
    }

    fn next_rate(&mut self) -> Result<bool> {
        match self.rates.next() {
            Some(rate) => self.set_rate(rate).map(|()| true),
            None => Ok(false),
        }
    }
}

/// The part of a block that begins at this place.
fn part(block: &[u8], place: u16) -> Request<'_> {
    let rest = block.get(usize::from(place)..).unwrap_or(&[]);
    Request::Part(place, rest.get(..PART_LEN).unwrap_or(rest))
}

fn is_wait(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

/// Opens a port of this machine, and asks at one bit rate after the other.
///
/// # Errors
/// Those of [`open_port`].
#[cfg(unix)]
pub fn open(path: &str, baud: Option<u32>) -> Result<SerialLink<serialport::TTYPort>> {
    let rates = baud.map_or_else(|| RATES.to_vec(), |baud| vec![baud]);
    Ok(SerialLink::new(open_port(path, rates[0])?, path, rates))
}

/// Opens a port of this machine.
///
/// # Errors
/// No such port, somebody else's, or one that may not be opened: with what to do.
#[cfg(unix)]
pub fn open_port(path: &str, baud: u32) -> Result<serialport::TTYPort> {
    let builder = serialport::new(path, baud).timeout(Duration::from_millis(20));
    serialport::TTYPort::open(&builder).map_err(|error| {
        let what = match error.kind {
            serialport::ErrorKind::NoDevice => {
                "somebody else has it open: a terminal program, ModemManager, the daemon?".to_owned()
            }
            serialport::ErrorKind::Io(ErrorKind::NotFound) => {
                "no such port; `ls /dev/serial/by-id` lists those that are plugged in".to_owned()
            }
            serialport::ErrorKind::Io(ErrorKind::PermissionDenied) => {
                "not allowed; `sudo usermod -aG dialout $USER`, then log in again".to_owned()
            }
            _ => error.to_string(),
        };
        anyhow::anyhow!("{path}: {what}")
    })
}

#[cfg(unix)]
impl Baud for serialport::TTYPort {
    fn set_baud(&mut self, baud: u32) -> Result<()> {
        serialport::SerialPort::set_baud_rate(self, baud).with_context(|| format!("the port has no {baud} baud"))
    }
}

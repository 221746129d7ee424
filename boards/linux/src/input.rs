//! Where scans come from: an ARS408 on a CAN bus or in a log of one, a TI radar or the native format on a
//! serial port.

use std::fs::File;
use std::io::BufReader;
use std::os::fd::BorrowedFd;

use anyhow::{Context, Result, bail};
use log::{info, warn};
use socketcan::dump::{ParseError, Reader};
use viewshed::board::{Ars408Upkeep, BusKeeper, Flow, Identity, RadarClock, SerialSession, StoredSettings};
use viewshed::{BusConfig, CanFrame, Epoch, Feed, NativeConfig, NativeReceiver, Reason, Ti, Time, Unstuffer};

use super::Unit;
use super::size::{Ars408 as Decoder, State as Radar3d};
use crate::can::Interface;
use crate::config::{ClockSource, Config, Radar};
use crate::frames::from_socketcan;
use crate::hearing::{Heard, Hearing, Line};
use crate::output::{Lines, Output};
use crate::serial::Serial;
use crate::state::FileSlots;

/// Bytes read at once.
const CHUNK: usize = 4096;
/// Reads in a row before the rest of the daemon has its turn.
const ROW: usize = 16;
/// How long a log goes on after its last frame: the radar is silent, and that is to be seen.
const SILENCE_US: u64 = 1_000_000;

/// What an input works on.
pub struct Work<'w, 'u> {
    pub unit: &'w mut Option<Unit<'u>>,
    pub slots: &'w mut FileSlots,
    pub output: &'w mut Output,
}

/// What came of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// It is this time on the unit's clock.
    Now(Time),
    /// The integrator wants a start with the newest configuration.
    Restart,
    /// The log is over.
    End,
}

/// A radar.
pub trait Input {
    /// A start, with a block or without, where the radar's line takes messages.
    fn start(&mut self, _epoch: Epoch, _stored: StoredSettings, _output: &mut Output) {}
    /// For waiting until something comes.
    fn fd(&self) -> Option<BorrowedFd<'_>>;
    /// Takes what came up to now, and what follows from time alone.
    fn step(&mut self, now: Time, work: &mut Work<'_, '_>) -> Step;
    /// The radar's own line, where it takes messages.
    fn line(&mut self) -> Option<&mut Serial> {
        None
    }
    /// First moment of its clock.
    fn begins(&self) -> Time {
        Time::from_micros(0)
    }
    /// What the unit's clock shows.
    fn now(&self, system: Time) -> Time {
        system
    }
}

/// The input that is configured.
///
/// # Errors
/// A log that cannot be read.
pub fn open(config: &Config) -> Result<Box<dyn Input>> {
    let input = &config.input;
    let port = |patient| {
        let path = input.port.as_ref().context("input.port is missing")?;
        anyhow::Ok(Serial::new(path, input.baud(), patient))
    };
    let hearing = |what| {
        let port = input.port.as_ref().map(|path| path.display().to_string()).unwrap_or_default();
        Hearing::new(Line::Serial { port, baud: input.baud(), what })
    };
    Ok(match (input.radar, &input.candump, &input.interface) {
        (Radar::Ars408, Some(_), _) => Box::new(Log::open(config)?),
        (Radar::Ars408, None, Some(name)) => Box::new(Bus::new(config, name)),
        (Radar::Ars408, None, None) => bail!("input.interface is missing"),
        (Radar::Ti, ..) => {
            Box::new(TiPort { port: port(false)?, hearing: hearing("frames"), decoder: Ti::new(input.ti()) })
        }
        (Radar::Native, ..) => {
            let bench = input.clock == ClockSource::Input;
            Box::new(NativePort {
                port: port(bench)?,
                bench,
                sensor: input.sensor_id,
                identity: config.identity(),
                hearing: hearing("scans"),
                session: None,
                clock: RadarClock::NEW,
                first: (!bench).then(|| FirstStamp::of(input.sensor_id)),
                rest: Vec::new(),
            })
        }
    })
}

/// An ARS408 on a bus.
struct Bus {
    interface: Interface,
    keeper: BusKeeper,
    decoder: Decoder,
    upkeep: Option<Ars408Upkeep>,
    hearing: Hearing,
    holds: bool,
    last: Time,
    /// Maps go out on the same bus, whose bus-offs are counted there.
    is_shared: bool,
}

impl Bus {
    fn new(config: &Config, name: &str) -> Self {
        let input = &config.input;
        let upkeep = input.configure().map(|settings| Ars408Upkeep::new(input.sensor_id, settings));
        let mut interface = Interface::new(name, false);
        // the radar's frames prove the bit rate before anything is sent to it
        let keeper = BusKeeper::start(&BusConfig::default(), &mut interface);
        let decoder = Decoder::new(input.ars408());
        let hearing = Hearing::new(Line::Ars408 { interface: name.to_owned(), id: input.sensor_id });
        let is_shared = config.output.interface.as_deref() == Some(name);
        Self { interface, keeper, decoder, upkeep, hearing, holds: false, last: Time::from_micros(0), is_shared }
    }

    /// Sends the radar its configuration, and that it stands.
    fn look_after(&mut self, frame: Option<&CanFrame>, now: Time) {
        let Some(upkeep) = &mut self.upkeep else { return };
        if let Some(frame) = frame {
            upkeep.take(frame);
            if self.holds != upkeep.holds() {
                self.holds = upkeep.holds();
                info!("the radar {} as it is to be", if self.holds { "is configured" } else { "is not configured" });
            }
        }
        while let Some(frame) = upkeep.poll(now) {
            self.keeper.send(&frame, &mut self.interface);
        }
    }
}

impl Input for Bus {
    fn fd(&self) -> Option<BorrowedFd<'_>> {
        self.interface.fd()
    }

    fn step(&mut self, now: Time, work: &mut Work<'_, '_>) -> Step {
        self.keeper.poll(now, &mut self.interface);
        work.output.radar_bus_offs = if self.is_shared { 0 } else { self.interface.bus_offs };
        let Some(unit) = work.unit else {
            while self.keeper.receive(&mut self.interface).is_some() {}
            return Step::Now(now);
        };
        for _ in 0..ROW * ROW {
            let Some(frame) = self.keeper.receive(&mut self.interface) else { break };
            let age = u64::try_from(self.interface.age.as_micros()).unwrap_or(0);
            // when the kernel had it, but never before what is already known
            self.last = Time::from_micros(now.micros().saturating_sub(age)).max(self.last);
            unit.take(&mut self.decoder, &frame, self.last);
            work.output.send(self.last, unit, None);
            self.hearing.frame(&frame);
            self.look_after(Some(&frame), now);
        }
        self.look_after(None, now);
        say(self.hearing.look(now, unit.frames()));
        self.last = now;
        unit.wait(&mut self.decoder, now);
        if self.upkeep.as_ref().is_some_and(|upkeep| upkeep.disagrees(now)) {
            unit.degrade(now, Reason::RadarConfiguration);
        }
        Step::Now(now)
    }
}

/// Into the log, for whoever looks why there are no maps.
fn say(heard: Option<Heard>) {
    match heard {
        Some(Heard::Trouble(what)) => warn!("{what}"),
        Some(Heard::Scans) => info!("scans come"),
        None => {}
    }
}

/// An ARS408 in a log.
struct Log {
    reader: Reader<BufReader<File>>,
    interface: Option<String>,
    next: Option<(Time, CanFrame)>,
    begins: Time,
    last: Time,
    skipped: u64,
    decoder: Decoder,
}

impl Log {
    fn open(config: &Config) -> Result<Self> {
        let path = config.input.candump.as_ref().context("input.candump is missing")?;
        let reader = Reader::from_file(path).with_context(|| format!("input.candump: {}", path.display()))?;
        let (decoder, begins) = (Decoder::new(config.input.ars408()), Time::from_micros(0));
        let interface = config.input.interface.clone();
        let mut log = Self { reader, interface, next: None, begins, last: begins, skipped: 0, decoder };
        log.advance();
        let Some((first, _)) = log.next else {
            bail!("input.candump: {}: no frame in it, as `candump -L` writes them", path.display())
        };
        (log.begins, log.last) = (first, first);
        Ok(log)
    }

    /// Reads on to the next frame of the interface.
    fn advance(&mut self) {
        self.next = loop {
            match self.reader.next_record() {
                Ok(Some(record)) if self.interface.as_ref().is_none_or(|name| *name == record.device) => {
                    if let Some(frame) = from_socketcan(&record.frame) {
                        break Some((Time::from_micros(record.t_us), frame));
                    }
                }
                Ok(Some(_)) => {}
                Ok(None) => break None,
                Err(ParseError::Io(e)) => {
                    warn!("the log ends here: {e}");
                    break None;
                }
                Err(e) => {
                    if self.skipped == 0 {
                        warn!("a line of the log is skipped, as will be others: {e}");
                    }
                    self.skipped += 1;
                }
            }
        };
    }
}

impl Input for Log {
    fn fd(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    fn step(&mut self, now: Time, work: &mut Work<'_, '_>) -> Step {
        let Some(unit) = work.unit else { return Step::Now(now) };
        while let Some((time, frame)) = self.next
            && time <= now
        {
            // a log that steps back is as good as one that stands still
            self.last = time.max(self.last);
            unit.take(&mut self.decoder, &frame, self.last);
            work.output.send(self.last, unit, None);
            self.advance();
        }
        unit.wait(&mut self.decoder, now);
        let over = self.next.is_none() && now.since(self.last).is_some_and(|us| us >= SILENCE_US);
        if over { Step::End } else { Step::Now(now) }
    }

    fn begins(&self) -> Time {
        self.begins
    }
}

/// A TI radar's data port.
struct TiPort {
    port: Serial,
    hearing: Hearing,
    decoder: Ti<{ Radar3d::DETECTIONS }>,
}

impl Input for TiPort {
    fn fd(&self) -> Option<BorrowedFd<'_>> {
        self.port.fd()
    }

    fn step(&mut self, now: Time, work: &mut Work<'_, '_>) -> Step {
        self.port.keep_open();
        let mut buffer = [0; CHUNK];
        for _ in 0..ROW {
            let bytes = self.port.read(&mut buffer);
            if bytes.is_empty() {
                break;
            }
            self.hearing.bytes(bytes.len());
            if let Some(unit) = work.unit {
                unit.take(&mut self.decoder, bytes, now);
            }
        }
        if let Some(unit) = work.unit {
            say(self.hearing.look(now, unit.frames()));
            unit.wait(&mut self.decoder, now);
        }
        Step::Now(now)
    }
}

/// Looks for a radar's first stamp, so that it is known before the unit works on the scan it comes with.
struct FirstStamp {
    unstuffer: Unstuffer,
    scans: NativeReceiver<{ Radar3d::DETECTIONS }>,
}

impl FirstStamp {
    fn of(sensor: u8) -> Self {
        Self { unstuffer: Unstuffer::new(), scans: NativeReceiver::new(NativeConfig::sensor(sensor)) }
    }

    fn take(&mut self, byte: u8, now: Time) -> Option<Time> {
        let (_, message) = self.unstuffer.push(&[byte]);
        let mut stamp = None;
        self.scans.take(message?, now, &mut |frame| stamp = Some(frame.measured));
        stamp
    }

    fn wait(&mut self, now: Time) -> Option<Time> {
        let mut stamp = None;
        self.scans.wait(now, &mut |frame| stamp = Some(frame.measured));
        stamp
    }

    /// On a clock that was not known until now, sender and unit begin anew: quiet time and uptime were those of another.
    /// Whether they did.
    fn begin(stamp: Option<Time>, now: Time, clock: &mut RadarClock, unit: &mut Option<Unit<'_>>) -> bool {
        let Some((stamp, unit)) = stamp.zip(unit.as_mut()) else { return false };
        clock.stamp(stamp, now);
        unit.reset();
        unit.broadcast().start_over(stamp);
        true
    }
}

/// Native scans and service messages on a serial port.
struct NativePort {
    port: Serial,
    /// Time is what the input says.
    bench: bool,
    sensor: u8,
    identity: Identity,
    hearing: Hearing,
    session: Option<SerialSession<{ Radar3d::DETECTIONS }>>,
    clock: RadarClock,
    /// Until the radar's clock is known.
    first: Option<FirstStamp>,
    /// What came after a restart.
    rest: Vec<u8>,
}

impl Input for NativePort {
    fn start(&mut self, epoch: Epoch, stored: StoredSettings, output: &mut Output) {
        self.port.keep_open();
        let mut lines = Lines { output, own: Some(&mut self.port) };
        self.session = Some(SerialSession::start(self.sensor, self.identity, epoch, stored, &mut lines));
        // it hears what the session hears
        self.first = self.first.take().map(|_| FirstStamp::of(self.sensor));
    }

    fn fd(&self) -> Option<BorrowedFd<'_>> {
        self.port.fd()
    }

    fn step(&mut self, now: Time, work: &mut Work<'_, '_>) -> Step {
        self.port.keep_open();
        self.port.push_rest(std::time::Instant::now());
        let Some(session) = &mut self.session else { return Step::Now(now) };
        for _ in 0..ROW {
            let mut buffer = [0; CHUNK];
            if self.rest.is_empty() {
                self.rest.extend_from_slice(self.port.read(&mut buffer));
            }
            if self.rest.is_empty() {
                break;
            }
            let bytes = std::mem::take(&mut self.rest);
            self.hearing.bytes(bytes.len());
            // byte by byte: what stands after a restart belongs to the next session
            for (k, byte) in bytes.iter().enumerate() {
                let before = session.now();
                let stamp = self.first.as_mut().and_then(|first| first.take(*byte, before));
                if FirstStamp::begin(stamp, now, &mut self.clock, work.unit) {
                    self.first = None;
                }
                let mut lines = Lines { output: work.output, own: Some(&mut self.port) };
                if session.take(&[*byte], work.unit, work.slots, &mut lines, &mut |_, _| {}) == Flow::Restart {
                    self.rest.extend_from_slice(bytes.get(k + 1..).unwrap_or(&[]));
                    return Step::Restart;
                }
                if session.now() != before {
                    self.clock.stamp(session.now(), now);
                }
            }
        }
        if let Some(unit) = work.unit {
            say(self.hearing.look(now, unit.frames()));
        }
        if !self.bench {
            let stamp = self.first.as_mut().and_then(|first| first.wait(now));
            if FirstStamp::begin(stamp, now, &mut self.clock, work.unit) {
                self.first = None;
            }
            let mut lines = Lines { output: work.output, own: Some(&mut self.port) };
            session.idle(self.clock.now(now), work.unit, &mut lines);
        }
        Step::Now(session.now())
    }

    fn line(&mut self) -> Option<&mut Serial> {
        Some(&mut self.port)
    }

    fn now(&self, system: Time) -> Time {
        match &self.session {
            Some(session) if self.bench => session.now(),
            _ => self.clock.now(system),
        }
    }
}

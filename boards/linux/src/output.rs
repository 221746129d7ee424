//! Where maps go: a CAN bus, a log of one, or a serial line.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use anyhow::{Context, Result};
use log::{error, info};
use viewshed::board::{BusKeeper, CanService, CanServiceConfig, Flow, SerialLine, StoredSettings};
use viewshed::{BusConfig, CanFrame, Epoch, Estimator, MOST_STUFFED, MapSender, Reason, Status, Time, Unit};

use crate::can::Interface;
use crate::config::{ClockSource, Config};
use crate::frames;
use crate::serial::Serial;
use crate::state::FileSlots;

/// A frame is tried for so long, microseconds; then it is dropped and the next has its turn.
const HELD_US: u64 = 20_000;

/// Name of the bus in logs.
const LOG_DEVICE: &str = "can0";

/// The way out.
pub struct Output {
    sink: Sink,
    /// The frame there was no room for, and since when.
    held: Option<(CanFrame, Time)>,
    /// The integrator's messages, if they are listened to.
    service: Option<CanService>,
    /// Bus-offs of the radar's bus, if it is another one, and of both as they were reported.
    pub radar_bus_offs: u16,
    reported: u16,
    /// Messages that went out, and those that did not.
    pub sent: u64,
    pub refused: u64,
}

enum Sink {
    Can(Interface, BusKeeper),
    Log {
        file: BufWriter<File>,
        path: PathBuf,
        failed: bool,
    },
    /// `None`: back on the radar's own line.
    Serial(Option<Serial>),
}

impl Output {
    /// # Errors
    /// A log that cannot be written.
    pub fn new(config: &Config) -> Result<Self> {
        let output = &config.output;
        let sink = if let Some(path) = &output.candump {
            let file =
                File::create(path).with_context(|| format!("output.candump: cannot create {}", path.display()))?;
            Sink::Log { file: BufWriter::new(file), path: path.clone(), failed: false }
        } else if let Some(name) = &output.interface {
            let mut interface = Interface::new(name, !output.listen_first && !output.service);
            let bus = BusConfig { listen_first: output.listen_first, ..BusConfig::default() };
            let keeper = BusKeeper::start(&bus, &mut interface);
            Sink::Can(interface, keeper)
        } else {
            let patient = config.input.clock == ClockSource::Input;
            let own = output.port.as_ref().filter(|port| config.input.port.as_ref() != Some(*port));
            Sink::Serial(own.map(|port| Serial::new(port, output.baud(), patient)))
        };
        Ok(Self { sink, held: None, service: None, radar_bus_offs: 0, reported: 0, sent: 0, refused: 0 })
    }

    /// A start: from here on the integrator's messages are answered, where that is wanted.
    pub fn start(&mut self, config: &Config, epoch: Epoch, now: Time, stored: StoredSettings) {
        // nothing of the epoch before
        self.held = None;
        let medium = config.medium().filter(|_| config.output.service);
        let service = medium.map(|medium| {
            let identity = config.identity();
            CanServiceConfig { identity, ..CanServiceConfig::new(config.output.sensor, medium) }
        });
        self.service = service.map(|service| CanService::start(service, epoch, now, stored));
    }

    /// Opens what is to be open and takes what the bus says; whether the integrator wants a restart.
    pub fn keep_up(&mut self, now: Time, slots: &mut FileSlots) -> Flow {
        match &mut self.sink {
            Sink::Can(interface, keeper) => {
                keeper.poll(now, interface);
                let before = keeper.is_active();
                while let Some(frame) = keeper.receive(interface) {
                    let flow = self.service.as_mut().and_then(|service| service.take(&frame, slots));
                    if flow == Some(Flow::Restart) {
                        return Flow::Restart;
                    }
                }
                if !before && keeper.is_active() {
                    info!("frames of others prove the bit rate right: sending");
                }
            }
            Sink::Serial(Some(port)) => {
                port.keep_open();
                port.push_rest(std::time::Instant::now());
                // nobody's bytes are expected here
                port.read(&mut [0; 256]);
            }
            Sink::Serial(None) | Sink::Log { .. } => {}
        }
        Flow::Continue
    }

    /// Answers the integrator; in the safe state, says that it is one.
    pub fn answer(&mut self, now: Time, safe: bool, slots: &FileSlots) {
        let base = Status { firmware: version(), bus_off: self.bus_offs(), ..Status::starting(0) };
        let Some(service) = &mut self.service else { return };
        let status = if safe { service.next_status(now, base) } else { None };
        let answer = service.next_frame(now, slots);
        for frame in status.iter().chain(&answer) {
            let sent = self.put(now, frame);
            *if sent { &mut self.sent } else { &mut self.refused } += 1;
        }
    }

    /// Whether the sender is to be asked again in a millisecond.
    pub fn is_busy(&self) -> bool {
        self.held.is_some()
    }

    /// Sends what is due; `own` is the radar's line.
    pub fn send<E: Estimator, S: MapSender<E::Map>>(
        &mut self,
        now: Time,
        unit: &mut Unit<'_, E, S>,
        own: Option<&mut Serial>,
    ) {
        self.report_bus_offs(now, unit);
        if matches!(self.sink, Sink::Serial(_)) {
            let mut line = [0; MOST_STUFFED];
            let mut lines = Lines { output: self, own };
            while let Some(message) = unit.next_line(now, &mut line).and_then(|n| line.get(..n)) {
                if !lines.send(message) {
                    unit.broadcast().count_dropped(1);
                }
            }
            return;
        }
        if let Some((frame, since)) = self.held.take() {
            if self.put(now, &frame) {
                self.sent += 1;
            } else if now.since(since).is_some_and(|us| us < HELD_US) {
                self.held = Some((frame, since));
                return;
            } else {
                self.refused += 1;
                unit.broadcast().count_dropped(1);
            }
        }
        while let Some(frame) = unit.next_frame(now) {
            if !self.put(now, &frame) {
                self.held = Some((frame, now));
                break;
            }
            self.sent += 1;
        }
    }

    /// Of both buses.
    fn bus_offs(&self) -> u16 {
        let own = if let Sink::Can(interface, _) = &self.sink { interface.bus_offs } else { 0 };
        own.saturating_add(self.radar_bus_offs)
    }

    /// Into the status.
    fn report_bus_offs<E: Estimator, S: MapSender<E::Map>>(&mut self, now: Time, unit: &mut Unit<'_, E, S>) {
        let bus_offs = self.bus_offs();
        unit.broadcast().status_mut().bus_off = bus_offs;
        if std::mem::replace(&mut self.reported, bus_offs) != bus_offs {
            unit.degrade(now, Reason::BusOff);
        }
    }

    fn put(&mut self, now: Time, frame: &CanFrame) -> bool {
        match &mut self.sink {
            Sink::Can(interface, keeper) => keeper.send(frame, interface),
            Sink::Log { file, path, failed } => {
                let Some(line) = frames::line(now, LOG_DEVICE, frame) else { return false };
                let written = writeln!(file, "{line}");
                if let (Err(e), false) = (&written, *failed) {
                    error!("{}: {e}", path.display());
                    *failed = true;
                }
                written.is_ok()
            }
            Sink::Serial(_) => false,
        }
    }

    /// Writes what a log holds back.
    ///
    /// # Errors
    /// A log that cannot be written.
    pub fn finish(&mut self) -> Result<()> {
        match &mut self.sink {
            Sink::Log { file, path, .. } => file.flush().with_context(|| path.display().to_string()),
            _ => Ok(()),
        }
    }
}

/// A serial session's way out: the maps' line, or back on the radar's where maps go over CAN.
pub struct Lines<'a> {
    pub output: &'a mut Output,
    pub own: Option<&'a mut Serial>,
}

impl SerialLine for Lines<'_> {
    fn send(&mut self, bytes: &[u8]) -> bool {
        let sent = match (&mut self.output.sink, &mut self.own) {
            (Sink::Serial(Some(port)), _) => port.send(bytes),
            (_, Some(own)) => own.send(bytes),
            _ => false,
        };
        *if sent { &mut self.output.sent } else { &mut self.output.refused } += 1;
        sent
    }
}

/// Version of the daemon, for the status.
pub fn version() -> [u8; 3] {
    let mut parts = env!("CARGO_PKG_VERSION").split('.').map(|part| part.parse().unwrap_or(0));
    std::array::from_fn(|_| parts.next().unwrap_or(0))
}

//! A unit on two serial lines: bytes of radar and integrator in, messages out, from start to restart.
//!
//! # Model
//! ```text
//! bytes -> messages -+-> service: block written into a slot, read, restart, time
//!                    +-> native scans -> unit -> maps, header, status -> bytes
//! ```
//! Without a block that holds there is no unit, only a status that says so: the safe state.
//!
//! # Limits
//! Noise and half messages cost the messages they hit, and are counted as damaged.

use crate::fixed::time::Time;
use crate::inputs::native::{Config, Outcome, Receiver};
use crate::pil::record::FrameRecord;
use crate::stage::Stage;
use crate::unit::Unit;
use crate::unit::safe_state::SafeState;
use crate::unit::service::{Reply, Request, ServiceMessage};
use crate::unit::settings::Settings;
use crate::unit::stored::{Slots, Stored};
use crate::wire::broadcast::Medium;
use crate::wire::message::{Epoch, Packing};
use crate::wire::serial::{MOST_STUFFED, Unstuffer, stuff};
use crate::wire::status::{Reason, Status};

/// The outgoing line and the measurements of a test bench.
pub trait Line {
    /// Sends all bytes or none; `false` if the line takes no more now.
    fn send(&mut self, bytes: &[u8]) -> bool;
    /// A counter for what stages cost.
    fn ticks(&mut self) -> u32;
    /// What a frame gave and cost.
    fn trace(&mut self, record: &FrameRecord);
}

/// What comes next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// More bytes.
    Continue,
    /// A start with the newest block.
    Restart,
}

/// Most messages sent in one go.
const MOST_MESSAGES: usize = 400;

/// What lies between the lines and the unit. `D` detections a scan.
#[derive(Debug)]
pub struct Session<const D: usize> {
    sensor: u8,
    unstuffer: Unstuffer,
    radar: Receiver<D>,
    stored: Stored,
    safe: SafeState,
    now: Time,
    /// Messages the line did not take.
    refused: u16,
    service_counter: u8,
    frames: u32,
}

impl<const D: usize> Session<D> {
    /// Starts with a block, or without.
    #[inline(never)] // what it takes of the stack is free again afterwards
    pub fn start(sensor: u8, epoch: Epoch, stored: Stored, line: &mut impl Line) -> Self {
        let now = Time::from_micros(0);
        let mut session = Self {
            sensor,
            unstuffer: Unstuffer::new(),
            radar: Receiver::new(Config::sensor(sensor)),
            stored,
            safe: SafeState::new(sensor, Medium::Serial, epoch, now),
            now,
            refused: 0,
            service_counter: 0,
            frames: 0,
        };
        let place = stored.place();
        session.reply(&Reply::Started(place.ok().map(|(slot, _)| slot)), line);
        if let Err(reason) = &place {
            session.reply(&Reply::Refused(reason), line);
        }
        session
    }

    /// What to work with; none in the safe state.
    pub fn settings(&self) -> Option<&Settings> {
        self.stored.settings()
    }

    /// The time by what came in.
    pub fn now(&self) -> Time {
        self.now
    }

    /// Takes bytes as they come, cut anywhere, and sends what follows from them.
    pub fn take<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
        &mut self,
        bytes: &[u8],
        unit: &mut Option<Unit<'_, R, A, E, W, N, G>>,
        slots: &mut impl Slots,
        line: &mut impl Line,
    ) -> Flow {
        let mut rest = bytes;
        while !rest.is_empty() {
            let (taken, message) = self.unstuffer.push(rest);
            rest = rest.get(taken..).unwrap_or(&[]);
            let Some(message) = message else { continue };
            if let Some(request) = Request::read(message, self.sensor) {
                match request {
                    Request::Restart => return Flow::Restart,
                    Request::Write(block) => {
                        let outcome = self.stored.write(block, slots);
                        let reply = match &outcome {
                            Ok(sequence) => Reply::Written(*sequence),
                            Err(reason) => Reply::Refused(reason),
                        };
                        send(&reply, self.sensor, &mut self.service_counter, &mut self.refused, line);
                    }
                    Request::Read => {
                        let used = self.stored.block(slots);
                        send(&Reply::Block(used), self.sensor, &mut self.service_counter, &mut self.refused, line);
                    }
                    Request::Time(now) => self.wait(now, unit, line),
                }
            } else {
                let outcome = self.radar.push(message, self.now);
                scan(&outcome, &mut self.now, &mut self.frames, unit, line);
                while let Some(outcome) = self.radar.poll(self.now) {
                    scan(&outcome, &mut self.now, &mut self.frames, unit, line);
                }
            }
            self.flush(unit, line);
        }
        Flow::Continue
    }

    /// What is to be done when no bytes came, where the unit has a clock; it has to be the one its scans
    /// are stamped by, see [`RadarClock`](crate::unit::radar_clock::RadarClock).
    pub fn idle<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
        &mut self,
        now: Time,
        unit: &mut Option<Unit<'_, R, A, E, W, N, G>>,
        line: &mut impl Line,
    ) {
        self.wait(now, unit, line);
        self.flush(unit, line);
    }

    /// Time went on.
    fn wait<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
        &mut self,
        now: Time,
        unit: &mut Option<Unit<'_, R, A, E, W, N, G>>,
        line: &mut impl Line,
    ) {
        self.now = now;
        while let Some(outcome) = self.radar.poll(now) {
            scan(&outcome, &mut self.now, &mut self.frames, unit, line);
        }
        if let Some(unit) = unit {
            unit.idle(self.now);
        }
    }

    #[inline(never)] // its buffer is not on the stack while a scan is worked up
    fn flush<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
        &mut self,
        unit: &mut Option<Unit<'_, R, A, E, W, N, G>>,
        line: &mut impl Line,
    ) {
        let mut stuffed = [0; MOST_STUFFED];
        let Some(unit) = unit else { return self.say_safe(line) };
        let damaged = self.radar.counters().damaged.saturating_add(self.unstuffer.errors());
        let lost = self.radar.counters().lost;
        let refused = core::mem::take(&mut self.refused);
        let status = unit.broadcast().status_mut();
        status.e2e_errors = u16::try_from(damaged).unwrap_or(u16::MAX);
        status.radar_lost = u16::try_from(lost).unwrap_or(u16::MAX);
        unit.broadcast().count_dropped(refused);
        for _ in 0..MOST_MESSAGES {
            let Some(message) = unit.next_line(self.now, &mut stuffed).and_then(|n| stuffed.get(..n)) else { break };
            if !line.send(message) {
                self.refused = self.refused.saturating_add(1);
            }
        }
    }

    /// In the safe state only the status is sent.
    #[inline(never)] // as above
    fn say_safe(&mut self, line: &mut impl Line) {
        let mut stuffed = [0; MOST_STUFFED];
        let length = self.safe.next_line(self.now, Status::starting(0), &mut stuffed);
        if let Some(message) = length.and_then(|n| stuffed.get(..n)) {
            let _ = line.send(message);
        }
    }

    fn reply(&mut self, reply: &Reply<'_>, line: &mut impl Line) {
        send(reply, self.sensor, &mut self.service_counter, &mut self.refused, line);
    }
}

fn send(reply: &Reply<'_>, sensor: u8, counter: &mut u8, refused: &mut u16, line: &mut impl Line) {
    let message: ServiceMessage = reply.message(sensor, *counter);
    *counter = Packing::Long.profile().next(*counter);
    let mut stuffed = [0; MOST_STUFFED];
    let bytes = stuff(message.bytes(), &mut stuffed).and_then(|n| stuffed.get(..n));
    if !bytes.is_some_and(|bytes| line.send(bytes)) {
        *refused = refused.saturating_add(1);
    }
}

fn scan<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
    outcome: &Outcome<'_>,
    now: &mut Time,
    frames: &mut u32,
    unit: &mut Option<Unit<'_, R, A, E, W, N, G>>,
    line: &mut impl Line,
) {
    let (Outcome::Scan(scan), Some(unit)) = (outcome, unit) else { return };
    *now = scan.time;
    let mut ticks = [0; Stage::COUNT];
    let mut last = line.ticks();
    let report = unit.scan(scan.time, scan.detections, scan.status(), |stage| {
        let now = line.ticks();
        if let Some(t) = ticks.get_mut(stage as usize) {
            *t = now.wrapping_sub(last);
        }
        last = now;
    });
    if scan.missing > 0 {
        unit.degrade(scan.time, Reason::IncompleteScans);
    }
    let record = FrameRecord { frame: *frames, condition: report.condition, used: report.used, fingerprint: 0, ticks };
    line.trace(&record);
    *frames = frames.wrapping_add(1);
}

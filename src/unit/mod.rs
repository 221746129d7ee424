//! A sensor's unit: scans in, the map kept up to date, its broadcast and its status out.
//!
//! This is the loop every controller runs, without its drivers. Time is always the caller's: on the
//! road a timer's, in a test bench the recording's. A board calls [`Unit::scan`] with each scan,
//! [`Unit::idle`] between them, at least ten times a second, and sends what [`Unit::next_line`] or
//! [`Unit::next_frame`] gives until there is nothing more.
//!
//! | around it | modules |
//! |---|---|
//! | sessions: what comes over a line becomes scans and requests | [`session`], [`can_session`], [`ti_session`], [`radar_clock`] |
//! | settings: the checked block, asked for and written over serial lines and CAN, kept in flash | [`settings`], [`service`], [`can_service`], [`flash_slots`] |
//! | lines: a bus that is listened to first and left after bus-off, queues, a line that stalls | [`can_bus`], [`frame_queue`], [`transmitter`] |
//! | a unit on hardware of its own: the loop, and what its lamp shows | [`roadside`], [`status_output`] |

pub mod can_bus;
pub mod can_service;
pub mod can_session;
pub mod flash_slots;
pub mod frame_queue;
pub mod radar_clock;
pub mod roadside;
pub mod service;
pub mod session;
pub mod settings;
pub mod status_output;
pub mod ti_session;
pub mod transmitter;

use crate::axes::Axes;
use crate::detection::Detection;
use crate::health::{Condition, Continuity, FrameStatus};
use crate::polar::PolarMap;
use crate::radar_3d::{FrameReport, Radar3d, Radar3dParameters};
use crate::stage::Stage;
use crate::time::Time;
use crate::unit::settings::Settings;
use crate::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use crate::wire::code::ray::Known;
use crate::wire::frame::CanFrame;
use crate::wire::header::{Header, NotAHeader, fingerprint};
use crate::wire::message::Epoch;
use crate::wire::status::{Reason, State};

/// What went wrong is told in the status for this long, microseconds: in several messages, should some be lost.
const DEGRADED_US: u64 = 1_000_000;

/// Time between two maps that say unknown, microseconds.
const UNKNOWN_EVERY_US: u64 = 100_000;

/// One sensor's estimator, map and sender; each in the memory the board gave it.
#[derive(Debug)]
pub struct Unit<'a, const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize> {
    parameters: &'a Radar3dParameters<R, A, E>,
    state: &'a mut Radar3d<R, A, E, W, N, D>,
    map: &'a mut PolarMap<R, A>,
    broadcast: &'a mut Broadcaster<A, W>,
    /// The last map that was offered to the sender.
    offered: Option<Time>,
    /// Whether the radar says that it has a fault.
    fault: bool,
    /// What went wrong last, and when.
    trouble: Option<(Time, Reason)>,
}

/// The header of a unit's maps.
///
/// # Errors
/// A map that cannot be sent.
pub fn header<const R: usize, const A: usize, const E: usize>(
    settings: &Settings,
    parameters: &Radar3dParameters<R, A, E>,
) -> Result<Header, NotAHeader> {
    let axes: &Axes<R, A, E> = parameters.axes();
    let view = axes.view(A / 2);
    let geometry = axes.polar(parameters.levelling());
    let usual = Known::new(view.start, view.end);
    Header::new::<R, A>(&settings.sensor.mount, &geometry, usual, 1, fingerprint(&settings.to_block(0)))
}

impl<'a, const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>
    Unit<'a, R, A, E, W, N, D>
{
    /// Puts the parts together; the map becomes one of these parameters, everything on it unknown.
    pub fn new(
        parameters: &'a Radar3dParameters<R, A, E>,
        state: &'a mut Radar3d<R, A, E, W, N, D>,
        map: &'a mut PolarMap<R, A>,
        broadcast: &'a mut Broadcaster<A, W>,
    ) -> Self {
        parameters.prepare(map);
        state.reset();
        Self { parameters, state, map, broadcast, offered: None, fault: false, trouble: None }
    }

    /// Takes a scan measured at this time and offers its map to the sender.
    pub fn scan<'d>(
        &mut self,
        measured: Time,
        detections: impl IntoIterator<Item = &'d Detection, IntoIter: Clone>,
        status: impl Into<FrameStatus>,
        mut ended: impl FnMut(Stage),
    ) -> FrameReport {
        let status = status.into();
        let report = self.state.process_traced(self.parameters, measured, detections, status, self.map, &mut ended);
        self.fault = status.fault;
        if report.continuity == Continuity::ClockStepped {
            self.degrade(measured, Reason::ClockStepped);
        }
        self.tell(report.condition, measured);
        self.offer(measured);
        ended(Stage::Broadcast);
        report
    }

    /// What is to be done when no scan came: the map runs out, and that is sent.
    pub fn idle(&mut self, now: Time) -> Condition {
        let condition = self.state.expire(self.parameters, now, self.map);
        self.tell(condition, now);
        let due = self.offered.is_none_or(|last| now.since(last).is_none_or(|us| us >= UNKNOWN_EVERY_US));
        if condition != Condition::Healthy && due {
            self.offer(now);
        }
        condition
    }

    fn offer(&mut self, measured: Time) {
        self.offered = Some(measured);
        // not sent while the epoch is new: the next one will be
        let _ = self.broadcast.scan(measured, &*self.map);
    }

    /// Maps go on, but something went wrong just now: told in the status for a second.
    pub fn degrade(&mut self, now: Time, reason: Reason) {
        self.trouble = Some((now, reason));
        let status = self.broadcast.status_mut();
        if status.state == State::Ok {
            (status.state, status.reason) = (State::Degraded, reason);
        }
    }

    fn tell(&mut self, condition: Condition, now: Time) {
        let recent = |(since, reason)| now.since(since).is_some_and(|us| us < DEGRADED_US).then_some(reason);
        let status = self.broadcast.status_mut();
        (status.state, status.reason) = match (condition, self.trouble.and_then(recent)) {
            (Condition::Stale, _) => (State::Blind, Reason::RadarSilent),
            _ if self.fault => (State::Fault, Reason::RadarFault),
            (Condition::Starting, _) => (State::Starting, Reason::None),
            (Condition::Blind, _) => (State::Blind, Reason::None),
            (Condition::Unusable, _) => (State::Blind, Reason::UnusablePoints),
            (Condition::Healthy, Some(reason)) => (State::Degraded, reason),
            (Condition::Healthy, None) => (State::Ok, Reason::None),
        };
    }

    /// Forgets everything but the counters: what comes next does not follow.
    pub fn reset(&mut self) {
        self.state.reset();
        self.map.forget();
    }

    /// The next message for a serial line, if one is due; see [`Broadcaster::next_line`].
    pub fn next_line(&mut self, now: Time, line: &mut [u8]) -> Option<usize> {
        self.broadcast.next_line(now, line)
    }

    /// The next CAN frame, if one is due.
    pub fn next_frame(&mut self, now: Time) -> Option<CanFrame> {
        self.broadcast.next_frame(now)
    }

    /// Time of the last map that was offered to the sender: it moves with every scan, and while there are
    /// none with every map that says unknown.
    pub fn offered(&self) -> Option<Time> {
        self.offered
    }

    /// The map.
    pub fn map(&self) -> &PolarMap<R, A> {
        self.map
    }

    /// The sender, for its counters and its clock.
    pub fn broadcast(&mut self) -> &mut Broadcaster<A, W> {
        self.broadcast
    }
}

/// The sender of a unit in a test bench: every message at the moment it is due.
///
/// # Errors
/// A map that cannot be sent.
pub fn bench_sender<const R: usize, const A: usize, const E: usize, const W: usize>(
    settings: &Settings,
    parameters: &Radar3dParameters<R, A, E>,
    medium: Medium,
    epoch: Epoch,
    now: Time,
) -> Option<Broadcaster<A, W>> {
    let config = BroadcastConfig { gap_us: 0, ..BroadcastConfig::new(0, medium) };
    Broadcaster::new(config, header(settings, parameters).ok()?, epoch, now).ok()
}

/// Puts parameters and sender of a unit in a test bench where they stay, or `None` without settings that can
/// be worked with. Apart, so that what this takes of the stack is free again before the first scan.
#[inline(never)]
pub fn start_bench<const R: usize, const A: usize, const E: usize, const W: usize>(
    parameters: &mut Option<Radar3dParameters<R, A, E>>,
    sender: &mut Option<Broadcaster<A, W>>,
    settings: Option<&Settings>,
    medium: Medium,
    epoch: Epoch,
    now: Time,
) {
    *parameters = settings.and_then(|s| Radar3dParameters::new(&s.sensor, &s.radar_3d()).ok());
    start_bench_sender(parameters.as_ref(), sender, settings, medium, epoch, now);
}

#[inline(never)]
fn start_bench_sender<const R: usize, const A: usize, const E: usize, const W: usize>(
    parameters: Option<&Radar3dParameters<R, A, E>>,
    sender: &mut Option<Broadcaster<A, W>>,
    settings: Option<&Settings>,
    medium: Medium,
    epoch: Epoch,
    now: Time,
) {
    let found = settings.zip(parameters);
    *sender = found.and_then(|(settings, parameters)| bench_sender(settings, parameters, medium, epoch, now));
}

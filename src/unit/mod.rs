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
//! | settings: the checked block, asked for and written over serial lines and CAN, kept in flash | [`settings`], [`stored`], [`service`], [`can_service`], [`flash_slots`], [`safe_state`] |
//! | lines: a bus that is listened to first and left after bus-off, queues, a line that stalls | [`can_bus`], [`frame_queue`], [`transmitter`] |
//! | a unit on hardware of its own: the loop, and what its lamp shows | [`roadside`], [`status_output`] |

pub mod can_bus;
pub mod can_service;
pub mod can_session;
pub mod flash_slots;
pub mod frame_queue;
pub mod radar_clock;
pub mod roadside;
pub mod safe_state;
pub mod service;
pub mod session;
pub mod settings;
pub mod status_output;
pub mod stored;
pub mod ti_session;
pub mod transmitter;

use crate::fixed::time::Time;
use crate::frame::detection::Detection;
use crate::frame::health::{Condition, Continuity, FrameStatus};
use crate::grid::axes::Axes;
use crate::map::polar::PolarMap;
use crate::radar_3d::{FrameReport, Radar3d, Radar3dParameters};
use crate::sensor::config::{ConfigError, Problem};
use crate::stage::Stage;
use crate::unit::settings::Settings;
use crate::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use crate::wire::code::ray::Known;
use crate::wire::frame::CanFrame;
use crate::wire::header::{Header, MOST_AZIMUTHS, fingerprint};
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
    /// The last scan, and the time from the one before to it.
    scanned: Option<Time>,
    period_us: Option<u64>,
    /// Whether the radar says that it has a fault.
    fault: bool,
    /// What went wrong last, and when.
    trouble: Option<(Time, Reason)>,
}

/// What a unit is made of by its settings: its parameters, and the header of its maps. A start and the check of a
/// block that came are this same function, so that none is accepted that cannot start.
#[inline(never)] // what it takes of the stack is free again afterwards
fn make<const R: usize, const A: usize, const E: usize>(
    settings: &Settings,
) -> Result<(Radar3dParameters<R, A, E>, Header), ConfigError> {
    settings.radar_bus.check("radar_bus")?;
    settings.broadcast_bus.check("broadcast_bus")?;
    let parameters = Radar3dParameters::new(&settings.sensor, &settings.radar_3d())?;
    let header = header(settings, &parameters)?;
    Ok((parameters, header))
}

/// Makes a unit's parameters, where they stay, and the header of its maps.
///
/// # Errors
/// Names the first parameter that cannot be worked with; there are no parameters then.
#[inline(never)] // as above
pub fn build<const R: usize, const A: usize, const E: usize>(
    settings: &Settings,
    parameters: &mut Option<Radar3dParameters<R, A, E>>,
) -> Result<Header, ConfigError> {
    *parameters = None;
    let (made, header) = make(settings)?;
    *parameters = Some(made);
    Ok(header)
}

/// Whether a unit of this grid, and a sender of this size, can be made by these settings.
///
/// # Errors
/// Names the first parameter that cannot be worked with.
#[inline(never)]
pub fn check<const R: usize, const A: usize, const E: usize, const W: usize>(
    settings: &Settings,
) -> Result<(), ConfigError> {
    make::<R, A, E>(settings).and_then(|(_, header)| Broadcaster::<A, W>::fits(&header))
}

fn header<const R: usize, const A: usize, const E: usize>(
    settings: &Settings,
    parameters: &Radar3dParameters<R, A, E>,
) -> Result<Header, ConfigError> {
    let axes: &Axes<R, A, E> = parameters.axes();
    let view = axes.view(A / 2);
    let geometry = axes.polar(parameters.levelling());
    let usual = Known::new(view.start, view.end);
    let header = Header::new::<R, A>(&settings.sensor.mount, &geometry, usual, 1, fingerprint(&settings.to_block(0)));
    // the mount was checked with the parameters, so it is the grid
    #[allow(clippy::cast_precision_loss)]
    let most = Problem::OutOfLimits { min: 1.0, max: MOST_AZIMUTHS as f32 };
    #[allow(clippy::cast_precision_loss)]
    header.map_err(|_| ConfigError { parameter: "header.azimuths", value: A as f32, problem: most })
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
        Self {
            parameters,
            state,
            map,
            broadcast,
            offered: None,
            scanned: None,
            period_us: None,
            fault: false,
            trouble: None,
        }
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
        self.period_us = self.scanned.replace(measured).and_then(|last| measured.since(last));
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

    /// Maps go on, but something went wrong just now: told in the status for a second. A bus too narrow is told
    /// only where nothing else went wrong, which may be why.
    pub fn degrade(&mut self, now: Time, reason: Reason) {
        let known = self.trouble.is_some_and(|(since, other)| other != reason && recent(since, now));
        if known && reason == Reason::BusOverload {
            return;
        }
        self.trouble = Some((now, reason));
        let status = self.broadcast.status_mut();
        if status.state == State::Ok {
            (status.state, status.reason) = (State::Degraded, reason);
        }
    }

    /// A scan took so long to be worked up, microseconds, by the clock of `now`: told if it is longer than the
    /// time from scan to scan.
    pub fn took(&mut self, now: Time, took_us: u64) {
        if self.period_us.is_some_and(|period| took_us > period) {
            self.degrade(now, Reason::Overrun);
        }
    }

    fn tell(&mut self, condition: Condition, now: Time) {
        if self.broadcast.take_overload() {
            self.degrade(now, Reason::BusOverload);
        }
        let trouble = self.trouble.filter(|(since, _)| recent(*since, now)).map(|(_, reason)| reason);
        let status = self.broadcast.status_mut();
        (status.state, status.reason) = match (condition, trouble) {
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

/// Whether something happened within the time it is told for, before or after `now`: scans are of another clock
/// than the loop around them.
fn recent(since: Time, now: Time) -> bool {
    now.since(since).or_else(|| since.since(now)).is_some_and(|us| us < DEGRADED_US)
}

/// Puts parameters and sender of a unit in a test bench where they stay: every message is sent at the moment it
/// is due. `None` without settings, and without ones that can be worked with. Apart, so that what this takes of
/// the stack is free again before the first scan.
#[inline(never)]
pub fn start_bench<const R: usize, const A: usize, const E: usize, const W: usize>(
    parameters: &mut Option<Radar3dParameters<R, A, E>>,
    sender: &mut Option<Broadcaster<A, W>>,
    settings: Option<&Settings>,
    medium: Medium,
    epoch: Epoch,
    now: Time,
) {
    (*parameters, *sender) = (None, None);
    let Some(Ok(header)) = settings.map(|settings| build(settings, parameters)) else { return };
    start_bench_sender(sender, header, medium, epoch, now);
}

#[inline(never)]
fn start_bench_sender<const A: usize, const W: usize>(
    sender: &mut Option<Broadcaster<A, W>>,
    header: Header,
    medium: Medium,
    epoch: Epoch,
    now: Time,
) {
    *sender = bench_sender(header, medium, epoch, now);
}

/// The sender of a unit in a test bench: every message at the moment it is due. `None` for a map that cannot be
/// sent.
pub fn bench_sender<const A: usize, const W: usize>(
    header: Header,
    medium: Medium,
    epoch: Epoch,
    now: Time,
) -> Option<Broadcaster<A, W>> {
    let config = BroadcastConfig { gap_us: 0, ..BroadcastConfig::new(0, medium) };
    Broadcaster::new(config, header, epoch, now).ok()
}

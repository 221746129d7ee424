//! A sensor's unit: frames in, the map kept up to date, its broadcast and its status out.
//!
//! This is the loop every controller runs, without its drivers. Time is always the caller's: on the
//! road a timer's, in a test bench the recording's. A board gives [`Unit::take`] what comes over the
//! sensor's line, calls [`Unit::wait`] when nothing came, at least ten times a second, and sends what
//! [`Unit::next_line`] or [`Unit::next_frame`] gives until there is nothing more. Which sensor it is says
//! the [`Estimator`], which line the [`Feed`], who sends the [`MapSender`].
//!
//! | around it | modules |
//! |---|---|
//! | what an estimator needs to be in a unit, the two sizes of radar-3d, and one with its map | [`build`](mod@build), [`profile`], [`radar`] |
//! | who sends maps, and with a table of probabilities | [`sender`], `quantised` |
//! | settings: the checked block, two slots of it, in flash | [`settings`] |
//! | the integrator: asked for and written over serial lines and CAN, what a unit answers, and what is said without settings | [`service`], [`serial_service`], [`can_service`], [`reply`], [`identity`], `safe_state` |
//! | native scans and the integrator on serial lines, and whose clock it is | [`session`], [`radar_clock`] |
//! | lines: a bus that is listened to first and left after bus-off, queues, a line that stalls | [`can_bus`], [`frame_queue`], [`transmitter`] |
//! | a unit on hardware of its own: the loop, what its lamp shows, and how long frames take | [`roadside`], [`status_output`], [`timing`] |

pub mod build;
pub mod can_bus;
pub mod can_service;
pub mod frame_queue;
pub mod identity;
pub mod profile;
#[cfg(feature = "probability")]
pub mod quantised;
pub mod radar;
pub mod radar_clock;
pub mod reply;
pub mod roadside;
mod safe_state;
pub mod sender;
pub mod serial_service;
pub mod service;
pub mod session;
pub mod settings;
pub mod status_output;
pub mod timing;
pub mod transmitter;

pub use build::InUnit;
pub use sender::MapSender;

use crate::estimator::{Estimator, Progress};
use crate::fixed::time::Time;
use crate::frame::health::{Condition, Continuity};
use crate::inputs::{Feed, Frame};
use crate::wire::frame::CanFrame;
use crate::wire::status::{Reason, UnitState};

/// What comes next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// More of what comes.
    Continue,
    /// A start with the newest block.
    Restart,
}

/// What a unit does with a frame, for whoever measures it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// It begins.
    Began,
    /// A stage of the estimator ended; after the last one, the offer to the sender.
    Ended,
    /// It is done.
    Done(Progress),
}

/// What went wrong stays in the status for this long, microseconds: in several messages, should some be lost.
const DEGRADED_US: u64 = 1_000_000;

/// Time between two maps that say unknown, microseconds.
const UNKNOWN_EVERY_US: u64 = 100_000;

/// One sensor's estimator, map and sender; each in the memory the board gave it.
#[derive(Debug)]
pub struct Unit<'a, E: Estimator, S> {
    parameters: &'a E::Parameters,
    state: &'a mut E,
    map: &'a mut E::Map,
    broadcast: &'a mut S,
    /// The last map that was offered to the sender.
    offered: Option<Time>,
    /// The last frame, and the time from the one before to it.
    measured: Option<Time>,
    period_us: Option<u64>,
    frames: u32,
    /// Whether the sensor says that it has a fault.
    fault: bool,
    /// Maps go on all the time, without something that was asked for.
    lacking: Option<Reason>,
    /// What went wrong last, and when.
    trouble: Option<(Time, Reason)>,
}

impl<'a, E: Estimator, S: MapSender<E::Map>> Unit<'a, E, S> {
    /// Puts the parts together; the map becomes one of these parameters, everything on it unknown.
    pub fn new(parameters: &'a E::Parameters, state: &'a mut E, map: &'a mut E::Map, broadcast: &'a mut S) -> Self {
        E::prepare(parameters, map);
        state.forget(map);
        Self {
            parameters,
            state,
            map,
            broadcast,
            offered: None,
            measured: None,
            period_us: None,
            frames: 0,
            fault: false,
            lacking: None,
            trouble: None,
        }
    }

    /// Takes what came over the sensor's line.
    pub fn take<F: Feed<Input = E::Input>>(&mut self, feed: &mut F, piece: &F::Piece, now: Time) {
        self.take_timed(feed, piece, now, &mut |_| {});
    }

    /// The same; `event` is called with what is done with a frame.
    pub fn take_timed<F: Feed<Input = E::Input>>(
        &mut self,
        feed: &mut F,
        piece: &F::Piece,
        now: Time,
        event: &mut impl FnMut(Event),
    ) {
        feed.take(piece, now, &mut |frame| {
            self.frame(frame, event);
        });
    }

    /// What is to be done when nothing came: frames that are over are taken, and the map runs out.
    pub fn wait<F: Feed<Input = E::Input>>(&mut self, feed: &mut F, now: Time) {
        feed.wait(now, &mut |frame| {
            self.frame(frame, &mut |_| {});
        });
        self.idle(now);
        self.broadcast.status_mut().radar_lost = u16::try_from(feed.lost()).unwrap_or(u16::MAX);
    }

    /// Takes a frame and offers its map to the sender.
    #[inline(never)] // a feed calls it from several places: what a scan takes of the stack is there once
    pub fn frame(&mut self, frame: &Frame<'_, E::Input>, event: &mut impl FnMut(Event)) -> Progress {
        let Frame { measured, input, incomplete, status } = *frame;
        event(Event::Began);
        let ended = &mut || event(Event::Ended);
        let progress = self.state.process(self.parameters, measured, input, status, self.map, ended);
        self.fault = status.fault;
        self.frames = self.frames.wrapping_add(1);
        self.period_us = self.measured.replace(measured).and_then(|last| measured.since(last));
        if progress.continuity == Continuity::ClockStepped {
            self.degrade(measured, Reason::ClockStepped);
        }
        if incomplete {
            self.degrade(measured, Reason::IncompleteScans);
        }
        if progress.continuity == Continuity::Unjudged {
            // the map is still that of the frame before, and is not sent as of now
            self.idle(measured);
        } else {
            self.set_status(progress.condition, measured);
            self.offer(measured);
        }
        event(Event::Ended);
        event(Event::Done(progress));
        progress
    }

    /// The map runs out, and that is sent.
    pub fn idle(&mut self, now: Time) -> Condition {
        let condition = self.state.expire(self.parameters, now, self.map);
        self.set_status(condition, now);
        let due = self.offered.is_none_or(|last| now.since(last).is_none_or(|us| us >= UNKNOWN_EVERY_US));
        if !condition.has_map() && due {
            self.offer(now);
        }
        condition
    }

    fn offer(&mut self, measured: Time) {
        self.offered = Some(measured);
        self.broadcast.offer(measured, self.map);
    }

    /// Maps go on, but something went wrong just now: it is in the status for a second. A bus too narrow is reported
    /// only where nothing else went wrong, which may be why.
    pub fn degrade(&mut self, now: Time, reason: Reason) {
        let known = self.trouble.is_some_and(|(since, other)| other != reason && recent(since, now));
        if known && reason == Reason::BusOverload {
            return;
        }
        self.trouble = Some((now, reason));
        let status = self.broadcast.status_mut();
        if status.state == UnitState::Ok {
            (status.state, status.reason) = (UnitState::Degraded, reason);
        }
    }

    /// Maps go on without something that was asked for: in the status whenever nothing else is wrong.
    pub fn lacks(&mut self, reason: Reason) {
        self.lacking = Some(reason);
    }

    /// A frame took so long to be worked up, microseconds, by the clock of `now`: reported if it is longer than the
    /// time from frame to frame.
    pub fn took(&mut self, now: Time, took_us: u64) {
        if self.period_us.is_some_and(|period| took_us > period) {
            self.degrade(now, Reason::Overrun);
        }
    }

    fn set_status(&mut self, condition: Condition, now: Time) {
        if self.broadcast.take_overload() {
            self.degrade(now, Reason::BusOverload);
        }
        let trouble = self.trouble.filter(|(since, _)| recent(*since, now)).map(|(_, reason)| reason);
        let (state, reason) = state_of(condition, self.fault);
        let instead = match (state, reason) {
            // what is lacking lasts longer than settling
            (UnitState::Ok, _) | (_, Reason::Settling) => trouble.or(self.lacking),
            (_, Reason::Weaker) => trouble,
            // what is wrong with the sensor lasts; what happened just now comes again
            _ => None,
        };
        let status = self.broadcast.status_mut();
        (status.state, status.reason) = instead.map_or((state, reason), |reason| (UnitState::Degraded, reason));
    }

    /// Forgets everything but the counters: what comes next does not follow.
    pub fn reset(&mut self) {
        self.state.forget(self.map);
    }

    /// The next message for a serial line, if one is due.
    pub fn next_line(&mut self, now: Time, line: &mut [u8]) -> Option<usize> {
        self.broadcast.next_line(now, line)
    }

    /// The next CAN frame, if one is due.
    pub fn next_frame(&mut self, now: Time) -> Option<CanFrame> {
        self.broadcast.next_frame(now)
    }

    /// Frames taken since the start, modulo 2^32.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// When the last frame was measured.
    pub fn measured(&self) -> Option<Time> {
        self.measured
    }

    /// Time of the last map that was offered to the sender: it moves with every frame, and while there are
    /// none with every map that says unknown.
    pub fn offered(&self) -> Option<Time> {
        self.offered
    }

    /// The map.
    pub fn map(&self) -> &E::Map {
        self.map
    }

    /// The sender, for its counters and its clock.
    pub fn broadcast(&mut self) -> &mut S {
        self.broadcast
    }
}

/// What a status says of a sensor's condition, and of the fault that the sensor says it has.
pub const fn state_of(condition: Condition, fault: bool) -> (UnitState, Reason) {
    match condition {
        Condition::Stale => (UnitState::Blind, Reason::RadarSilent),
        _ if fault => (UnitState::Fault, Reason::RadarFault),
        Condition::Starting => (UnitState::Starting, Reason::None),
        Condition::Blind => (UnitState::Blind, Reason::None),
        Condition::Unusable => (UnitState::Blind, Reason::UnusablePoints),
        Condition::SectorBlind => (UnitState::Degraded, Reason::SectorBlind),
        Condition::Misaligned => (UnitState::Degraded, Reason::Misaligned),
        Condition::Weaker => (UnitState::Degraded, Reason::Weaker),
        Condition::Settling => (UnitState::Degraded, Reason::Settling),
        Condition::Healthy => (UnitState::Ok, Reason::None),
    }
}

/// Whether something happened within the time it is reported for, before or after `now`: frames are of another clock
/// than the loop around them.
fn recent(since: Time, now: Time) -> bool {
    now.since(since).or_else(|| since.since(now)).is_some_and(|us| us < DEGRADED_US)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::health::FrameStatus;
    use crate::sensor::config::ConfigError;
    use crate::wire::broadcast::BroadcastConfig;
    use crate::wire::header::Header;
    use crate::wire::message::Epoch;
    use crate::wire::status::Status;
    use std::vec::Vec;

    /// Sees squares of a road, as a camera would: neither its input nor its map is a radar's.
    #[derive(Debug, Default)]
    struct Camera {
        last: Option<Time>,
    }

    /// An outline in a picture: rows from, to.
    type Outline = [usize; 2];
    type Squares = [[bool; 4]; 4];

    impl Estimator for Camera {
        type Config = usize;
        type Parameters = usize;
        type Input = [Outline];
        type Map = Squares;

        fn parameters(config: &usize) -> Result<usize, ConfigError> {
            Ok(*config)
        }

        fn prepare(_: &usize, map: &mut Squares) {
            *map = [[false; 4]; 4];
        }

        fn forget(&mut self, map: &mut Squares) {
            (self.last, *map) = (None, [[false; 4]; 4]);
        }

        fn process(
            &mut self,
            rows: &usize,
            measured: Time,
            input: &[Outline],
            status: FrameStatus,
            map: &mut Squares,
            ended: &mut impl FnMut(),
        ) -> Progress {
            // what this sensor refuses is no frame of it
            if status.refused > 0 {
                ended();
                let condition = self.expire(rows, measured, map);
                return Progress { continuity: Continuity::Unjudged, condition, used: 0 };
            }
            for (row, squares) in map.iter_mut().enumerate().take(*rows) {
                squares.fill(!input.iter().any(|[from, to]| (*from..*to).contains(&row)));
            }
            ended();
            let continuity =
                if self.last.replace(measured).is_none() { Continuity::First } else { Continuity::Follows(1) };
            Progress { continuity, condition: Condition::Healthy, used: 1 }
        }

        fn expire(&mut self, _: &usize, now: Time, map: &mut Squares) -> Condition {
            let fresh = self.last.is_some_and(|last| now.since(last).is_some_and(|us| us < 500_000));
            if !fresh {
                *map = [[false; 4]; 4];
            }
            if fresh { Condition::Healthy } else { Condition::Stale }
        }
    }

    /// Keeps what it is to send.
    #[derive(Default)]
    struct Kept(Vec<Squares>, Status);

    impl MapSender<Squares> for Kept {
        fn fits(_: &Header) -> Result<(), ConfigError> {
            Ok(())
        }
        fn start(
            place: &mut Option<Self>,
            _: BroadcastConfig,
            _: Header,
            _: Epoch,
            _: Time,
        ) -> Result<(), ConfigError> {
            *place = Some(Self::default());
            Ok(())
        }
        fn offer(&mut self, _: Time, map: &Squares) {
            self.0.push(*map);
        }
        fn next_frame(&mut self, _: Time) -> Option<CanFrame> {
            None
        }
        fn next_line(&mut self, _: Time, _: &mut [u8]) -> Option<usize> {
            None
        }
        fn deadline(&self) -> Option<Time> {
            None
        }
        fn status_mut(&mut self) -> &mut Status {
            &mut self.1
        }
        fn count_dropped(&mut self, _: u16) {}
        fn take_overload(&mut self) -> bool {
            false
        }
    }

    /// A line on which an outline is two bytes, and an empty piece a picture that was lost.
    #[derive(Default)]
    struct Pictures(u32);

    impl Feed for Pictures {
        type Piece = [u8];
        type Input = [Outline];

        fn take(&mut self, piece: &[u8], now: Time, each: &mut impl FnMut(&Frame<'_, [Outline]>)) {
            let [from, to] = *piece else { return self.0 += 1 };
            let input = &[[usize::from(from), usize::from(to)]][..];
            each(&Frame { measured: now, input, incomplete: from > to, status: false.into() });
        }
        fn wait(&mut self, _: Time, _: &mut impl FnMut(&Frame<'_, [Outline]>)) {}
        fn lost(&self) -> u32 {
            self.0
        }
    }

    #[test]
    fn a_map_is_not_sent_as_of_a_frame_that_was_left_out() {
        let (mut camera, mut map, mut kept) = (Camera::default(), [[true; 4]; 4], Kept::default());
        let mut unit = Unit::new(&3, &mut camera, &mut map, &mut kept);
        let mut sent = |ms: u64, refused: u16| {
            let status = FrameStatus { refused, ..FrameStatus::default() };
            let input = &[[1, 2]][..];
            let frame = Frame { measured: Time::from_micros(ms * 1000), input, incomplete: false, status };
            unit.frame(&frame, &mut |_| {});
            let Kept(maps, status) = unit.broadcast();
            (maps.len(), maps.last().unwrap()[0][0], status.state)
        };
        assert_eq!(sent(100, 0), (1, true, UnitState::Ok));
        assert_eq!(sent(200, 9), (1, true, UnitState::Ok));
        assert_eq!(sent(700, 9), (2, false, UnitState::Blind), "what is unknown by then is sent");
        assert_eq!(sent(800, 0), (3, true, UnitState::Ok));
    }

    #[test]
    fn an_estimator_with_another_input_and_map_is_a_unit_as_well() {
        let (mut camera, mut map, mut kept, mut feed) =
            (Camera::default(), [[true; 4]; 4], Kept::default(), Pictures(0));
        let at = |ms: u64| Time::from_micros(ms * 1000);
        let mut unit = Unit::new(&3, &mut camera, &mut map, &mut kept);
        assert_eq!(*unit.map(), [[false; 4]; 4], "nothing is known");
        unit.take(&mut feed, &[1, 2], at(100));
        assert_eq!(unit.map().map(|row| row[0]), [true, false, true, false]);
        assert_eq!((unit.broadcast().1.state, unit.frames()), (UnitState::Ok, 1));
        unit.take(&mut feed, &[2, 1], at(200));
        let status = unit.broadcast().1;
        assert_eq!(
            (status.state, status.reason),
            (UnitState::Degraded, Reason::IncompleteScans),
            "one way for every feed"
        );
        unit.take(&mut feed, &[], at(250));
        unit.wait(&mut feed, at(800));
        let status = unit.broadcast().1;
        assert_eq!((status.state, status.reason, status.radar_lost), (UnitState::Blind, Reason::RadarSilent, 1));
        assert_eq!((kept.0.len(), kept.0.last()), (3, Some(&[[false; 4]; 4])), "and what ran out is sent");
    }
}

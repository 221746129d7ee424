//! A unit on two serial lines: bytes of radar or camera and integrator in, messages out, from start to restart.
//!
//! # Model
//! ```text
//! bytes -> messages -+-> service: block written into a slot, read, restart, time
//!                    +-> native scans or boxes -> unit -> maps, header, status -> bytes
//! ```
//! Without a block that holds there is no unit, only a status that says so: the safe state.
//!
//! # Limits
//! Noise and half messages cost the messages they hit, and are counted as damaged.

use crate::estimator::Estimator;
use crate::fixed::time::Time;
use crate::frame::detection::Detection;
use crate::inputs::Feed;
use crate::inputs::native::{NativeConfig, NativeEntry, NativeReceiver};
use crate::unit::identity::Identity;
use crate::unit::serial_service::{Asked, SerialLine, SerialService};
use crate::unit::settings::{Settings, SettingsSlots, StoredSettings};
use crate::unit::{Event, Flow, MapSender, Unit};
use crate::wire::message::Epoch;
use crate::wire::serial::{MOST_STUFFED, Unstuffer};
use crate::wire::status::Status;

/// Most messages sent in one go.
const MOST_MESSAGES: usize = 400;

/// What lies between the lines and the unit. `D` detections a scan, or boxes of a camera, [`ImageBox`](crate::ImageBox).
#[derive(Debug)]
pub struct SerialSession<const D: usize, T: NativeEntry = Detection> {
    unstuffer: Unstuffer,
    service: SerialService,
    radar: NativeReceiver<D, T>,
    now: Time,
    /// Messages the line did not take.
    refused: u16,
}

impl<const D: usize, T: NativeEntry> SerialSession<D, T> {
    /// Starts with a block, or without.
    #[inline(never)] // what it takes of the stack is free again afterwards
    pub fn start(
        sensor: u8,
        identity: Identity,
        epoch: Epoch,
        stored: StoredSettings,
        line: &mut impl SerialLine,
    ) -> Self {
        let now = Time::from_micros(0);
        Self {
            unstuffer: Unstuffer::new(),
            service: SerialService::start((sensor, identity), epoch, now, stored, line),
            radar: NativeReceiver::empty(NativeConfig::sensor(sensor)),
            now,
            refused: 0,
        }
    }

    /// What to work with; none in the safe state.
    pub fn settings(&self) -> Option<&Settings> {
        self.service.stored().settings()
    }

    /// The time by what came in.
    pub fn now(&self) -> Time {
        self.now
    }

    /// Takes bytes as they come, cut anywhere, and sends what follows from them. `event` is called with what the unit
    /// does with each frame.
    pub fn take<E: Estimator<Input = [T]>, S: MapSender<E::Map>, L: SerialLine>(
        &mut self,
        bytes: &[u8],
        unit: &mut Option<Unit<'_, E, S>>,
        slots: &mut impl SettingsSlots,
        line: &mut L,
        event: &mut impl FnMut(Event, &mut L),
    ) -> Flow {
        let mut rest = bytes;
        while !rest.is_empty() {
            let (taken, message) = self.unstuffer.push(rest);
            rest = rest.get(taken..).unwrap_or(&[]);
            let Some(message) = message else { continue };
            match self.service.take(message, slots, line) {
                Some(Asked::Restart) => return Flow::Restart,
                Some(Asked::Time(now)) => self.wait(now, unit, line, event),
                // a bench counts by itself
                Some(Asked::Nothing | Asked::Timing) => {}
                None => {
                    let now = &mut self.now;
                    self.radar.take(message, *now, &mut |frame| {
                        let Some(unit) = unit else { return };
                        *now = frame.measured;
                        unit.frame(frame, &mut |what| event(what, line));
                    });
                }
            }
            self.flush(unit, line);
        }
        Flow::Continue
    }

    /// What is to be done when no bytes came, where the unit has a clock; it has to be the one its scans
    /// are stamped by, see [`RadarClock`](crate::unit::radar_clock::RadarClock).
    pub fn idle<E: Estimator<Input = [T]>, S: MapSender<E::Map>, L: SerialLine>(
        &mut self,
        now: Time,
        unit: &mut Option<Unit<'_, E, S>>,
        line: &mut L,
    ) {
        self.wait(now, unit, line, &mut |_, _| {});
        self.flush(unit, line);
    }

    /// Time went on.
    fn wait<E: Estimator<Input = [T]>, S: MapSender<E::Map>, L: SerialLine>(
        &mut self,
        now: Time,
        unit: &mut Option<Unit<'_, E, S>>,
        line: &mut L,
        event: &mut impl FnMut(Event, &mut L),
    ) {
        self.now = now;
        let Some(unit) = unit else { return self.radar.wait(now, &mut |_| {}) };
        let now = &mut self.now;
        self.radar.wait(*now, &mut |frame| {
            *now = frame.measured;
            unit.frame(frame, &mut |what| event(what, line));
        });
        unit.idle(*now);
    }

    #[inline(never)] // its buffer is not on the stack while a scan is worked up
    fn flush<E: Estimator, S: MapSender<E::Map>>(
        &mut self,
        unit: &mut Option<Unit<'_, E, S>>,
        line: &mut impl SerialLine,
    ) {
        let Some(unit) = unit else { return self.service.say_safe(self.now, Status::starting(0), line) };
        let damaged = self.radar.counters().damaged.saturating_add(self.unstuffer.errors());
        let refused = core::mem::take(&mut self.refused).saturating_add(self.service.take_refused());
        let status = unit.broadcast().status_mut();
        status.e2e_errors = u16::try_from(damaged).unwrap_or(u16::MAX);
        status.radar_lost = u16::try_from(self.radar.lost()).unwrap_or(u16::MAX);
        unit.broadcast().count_dropped(refused);
        let mut stuffed = [0; MOST_STUFFED];
        for _ in 0..MOST_MESSAGES {
            let Some(message) = unit.next_line(self.now, &mut stuffed).and_then(|n| stuffed.get(..n)) else { break };
            if !line.send(message) {
                self.refused = self.refused.saturating_add(1);
            }
        }
    }
}

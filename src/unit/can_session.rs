//! A unit between two CAN buses: an ARS408's frames in, the frames of the map out.
//!
//! # Model
//! On the road time is the controller's. In a test bench it comes over the radar's bus: a frame with the
//! identifier [`TIME_ID`] and eight bytes, microseconds, big-endian, before the frames it is for.

use crate::fixed::time::Time;
use crate::inputs::ars408::{Ars408, Config, Outcome};
use crate::unit::Unit;
use crate::unit::can_bus::{BusKeeper, BusState, CanPort};
use crate::unit::can_service::CanService;
use crate::unit::session::Flow;
use crate::unit::stored::Slots;
use crate::wire::frame::{CanFrame, CanId};
use crate::wire::status::{Reason, Status};

/// Identifier of the time in a test bench.
pub const TIME_ID: CanId = CanId::Standard(0x0F0);

/// Frames of one radar to scans of a unit; up to `D` detections each.
#[derive(Debug)]
pub struct CanSession<const D: usize> {
    radar: Ars408<D>,
    now: Time,
}

impl<const D: usize> CanSession<D> {
    /// Before the first frame.
    pub const fn new(radar: Config) -> Self {
        Self { radar: Ars408::new(radar), now: Time::from_micros(0) }
    }

    /// The time of the last frame.
    pub fn now(&self) -> Time {
        self.now
    }

    /// Scans the radar has completed.
    pub fn scans(&self) -> u32 {
        self.radar.counters().scans
    }

    /// Scans that never came, by the radar's counter.
    pub fn lost(&self) -> u32 {
        self.radar.counters().lost
    }

    /// Starts a test bench's clock: no unit starts before it is told the time. Whether a frame told it now.
    pub fn bench_clock(&mut self, keeper: &mut BusKeeper, port: &mut impl CanPort) -> bool {
        let told = keeper.receive(port).as_ref().and_then(bench_time);
        self.now = told.unwrap_or(self.now);
        told.is_some()
    }

    /// One turn of a test bench's loop on a bus that radar and integrator share: at most one frame in, all
    /// that is due out.
    pub fn bench_turn<
        const R: usize,
        const A: usize,
        const E: usize,
        const W: usize,
        const N: usize,
        const G: usize,
    >(
        &mut self,
        (keeper, port): (&mut BusKeeper, &mut impl CanPort),
        service: &mut CanService,
        unit: &mut Option<Unit<'_, R, A, E, W, N, G>>,
        slots: &mut impl Slots,
    ) -> Flow {
        keeper.poll(self.now, port);
        let frame = keeper.receive(port);
        if frame.is_some_and(|frame| self.bench_frame(&frame, service, unit, slots) == Flow::Restart) {
            return Flow::Restart;
        }
        // nothing is taken from a unit that cannot be sent
        while keeper.state() == BusState::Active {
            let Some(frame) = self.next_frame(service, unit, slots) else { break };
            if !keeper.send(&frame, port) {
                break;
            }
        }
        Flow::Continue
    }

    fn bench_frame<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
        &mut self,
        frame: &CanFrame,
        service: &mut CanService,
        unit: &mut Option<Unit<'_, R, A, E, W, N, G>>,
        slots: &mut impl Slots,
    ) -> Flow {
        if let Some(flow) = service.take(frame, slots) {
            return flow;
        }
        match (bench_time(frame), unit) {
            (Some(now), Some(unit)) => self.idle(now, unit),
            (Some(now), None) => self.now = now,
            (None, Some(unit)) => self.frame(frame, self.now, unit),
            (None, None) => {}
        }
        Flow::Continue
    }

    /// The next frame of a unit and its integrator's answers on one bus; without a unit only the status
    /// of the safe state and the answers.
    fn next_frame<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
        &self,
        service: &mut CanService,
        unit: &mut Option<Unit<'_, R, A, E, W, N, G>>,
        slots: &impl Slots,
    ) -> Option<CanFrame> {
        let now = self.now;
        let answer = service.next_frame(now, slots);
        answer.or_else(|| match unit {
            Some(unit) => unit.next_frame(now),
            None => service.next_status(now, Status::starting(0)),
        })
    }

    /// Takes a frame of the radar's bus.
    pub fn frame<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
        &mut self,
        frame: &CanFrame,
        now: Time,
        unit: &mut Unit<'_, R, A, E, W, N, G>,
    ) {
        self.now = now;
        scan(&self.radar.push(frame, now), unit);
        while let Some(outcome) = self.radar.poll(now) {
            scan(&outcome, unit);
        }
    }

    /// What is to be done when no frame came.
    pub fn idle<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
        &mut self,
        now: Time,
        unit: &mut Unit<'_, R, A, E, W, N, G>,
    ) {
        self.now = now;
        while let Some(outcome) = self.radar.poll(now) {
            scan(&outcome, unit);
        }
        unit.idle(now);
        let lost = self.radar.counters().lost;
        unit.broadcast().status_mut().radar_lost = u16::try_from(lost).unwrap_or(u16::MAX);
    }
}

/// The time a frame of a test bench tells.
pub fn bench_time(frame: &CanFrame) -> Option<Time> {
    let micros = <[u8; 8]>::try_from(frame.data()).ok().filter(|_| frame.id == TIME_ID)?;
    Some(Time::from_micros(u64::from_be_bytes(micros)))
}

fn scan<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
    outcome: &Outcome<'_>,
    unit: &mut Unit<'_, R, A, E, W, N, G>,
) {
    let Outcome::Scan(scan) = outcome else { return };
    unit.scan(scan.time, scan.detections, scan.status(), |_| {});
    if scan.missing > 0 {
        unit.degrade(scan.time, Reason::IncompleteScans);
    }
}

//! A unit between two CAN buses: an ARS408's frames in, the frames of the map out.
//!
//! # Model
//! On the road time is the controller's. In a test bench it comes over the radar's bus: a frame with the
//! identifier [`TIME_ID`] and eight bytes, microseconds, big-endian, before the frames it is for.

use crate::inputs::ars408::{Ars408, Config, Outcome};
use crate::time::Time;
use crate::unit::Unit;
use crate::wire::frame::{CanFrame, CanId};
use crate::wire::status::Reason;

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

    /// Takes a frame of the radar's bus, in a test bench also its time.
    pub fn bench_frame<
        const R: usize,
        const A: usize,
        const E: usize,
        const W: usize,
        const N: usize,
        const G: usize,
    >(
        &mut self,
        frame: &CanFrame,
        unit: &mut Unit<'_, R, A, E, W, N, G>,
    ) {
        match <[u8; 8]>::try_from(frame.data()) {
            Ok(micros) if frame.id == TIME_ID => {
                self.idle(Time::from_micros(u64::from_be_bytes(micros)), unit);
            }
            _ => self.frame(frame, self.now, unit),
        }
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

fn scan<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
    outcome: &Outcome<'_>,
    unit: &mut Unit<'_, R, A, E, W, N, G>,
) {
    let Outcome::Scan(scan) = outcome else { return };
    unit.scan(scan.time, scan.detections, scan.fault, |_| {});
    if scan.missing > 0 {
        unit.degrade(scan.time, Reason::IncompleteScans);
    }
}

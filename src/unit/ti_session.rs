//! A unit behind a TI mmWave radar's data port: its bytes in, maps kept up to date.
//!
//! The port carries nothing but the radar's frames and those carry no time a unit could use, so time is
//! always the unit's own.

use crate::fixed::time::Time;
use crate::inputs::ti::{Config, Counters, Outcome, Ti};
use crate::unit::Unit;
use crate::wire::status::Reason;

/// Bytes of one radar to scans of a unit; up to `D` detections each.
#[derive(Debug)]
pub struct TiSession<const D: usize> {
    radar: Ti<D>,
}

impl<const D: usize> TiSession<D> {
    /// Before the first byte.
    pub const fn new(radar: Config) -> Self {
        Self { radar: Ti::new(radar) }
    }

    /// Takes bytes as they come, cut anywhere.
    pub fn take<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
        &mut self,
        bytes: &[u8],
        now: Time,
        unit: &mut Unit<'_, R, A, E, W, N, G>,
    ) {
        let mut rest = bytes;
        while !rest.is_empty() {
            let (taken, outcome) = self.radar.push(rest, now);
            if let Outcome::Scan(scan) = outcome {
                unit.scan(scan.time, scan.detections, scan.status(), |_| {});
                if scan.missing > 0 {
                    unit.degrade(scan.time, Reason::IncompleteScans);
                }
            }
            // a receiver that took nothing would hold up everything
            rest = rest.get(taken.max(1)..).unwrap_or(&[]);
        }
    }

    /// What is to be done when no bytes came.
    pub fn idle<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const G: usize>(
        &mut self,
        now: Time,
        unit: &mut Unit<'_, R, A, E, W, N, G>,
    ) {
        unit.idle(now);
        let lost = self.radar.counters().lost;
        unit.broadcast().status_mut().radar_lost = u16::try_from(lost).unwrap_or(u16::MAX);
    }

    /// What was seen and what was wrong.
    pub fn counters(&self) -> &Counters {
        self.radar.counters()
    }
}

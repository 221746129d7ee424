//! Radars: bytes or CAN frames in, complete scans in the units of [`Detection`] out.
//!
//! Every decoder is an accumulator. It is fed with single CAN frames or with chunks of bytes cut
//! anywhere, is told the time with each, and answers with a named outcome: nothing yet, a
//! [`RadarScan`], or what was wrong. Bad input is counted and never stops a decoder.

pub mod ars408;
mod collected;
pub mod native;
mod polar;
pub mod signal;
pub mod ti;

use crate::fixed::time::Time;
use crate::frame::detection::Detection;
use crate::frame::health::FrameStatus;

/// The detections of one scan of a radar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RadarScan<'a> {
    /// When it was measured, on the radar's clock; when its first frame came, on the caller's,
    /// where the radar sends no time.
    pub time: Time,
    /// When its first frame came, on the caller's clock.
    pub received: Time,
    /// The radar's own number of the scan.
    pub number: u32,
    /// What was measured and passed the radar's own quality marks.
    pub detections: &'a [Detection],
    /// Announced and not arrived; the most it can be, where that is not known exactly.
    pub missing: u16,
    /// Points that arrived and are no detections: not finite, at no distance, or absurd.
    pub refused: u16,
    /// Whether the radar says that something is wrong with it.
    pub fault: bool,
}

impl RadarScan<'_> {
    /// What the estimators are told besides the detections.
    pub fn status(&self) -> FrameStatus {
        FrameStatus { fault: self.fault, refused: self.refused }
    }
}

/// Whether enough of a scan arrived to be used: a scan of which most is missing would be taken for
/// a free road.
pub(crate) const fn usable(announced: u16, arrived: u16) -> bool {
    arrived as u32 * 2 >= announced as u32
}

/// One more, never wrapping.
pub(crate) fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

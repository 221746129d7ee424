//! Frames one after the other, from memory or from a log that is read again whenever asked.
//!
//! A log of days has more of them than fit memory, and hardly anything has to know all of them at once. What looks at all
//! frames takes them as they come, in two passes: the [first](Survey) tells how many there are and what is wrong with all
//! of them, the second asks the corrected ones.

use std::ops::ControlFlow;

use super::clock::Clock;
use super::unfilled::{self, Unfilled};
use super::{Frame, RadarDetection};

/// Frames in the order they were recorded in, again from the first whenever asked.
pub trait Frames {
    /// Shows all frames, some at a time, until `see` has seen enough.
    fn parts(&self, see: &mut dyn FnMut(&[Frame]) -> ControlFlow<()>);

    /// Shows each frame.
    fn each(&self, see: &mut dyn FnMut(&Frame)) {
        self.parts(&mut |part| {
            part.iter().for_each(&mut *see);
            ControlFlow::Continue(())
        });
    }

    /// What the first pass says of them.
    fn survey(&self) -> Survey {
        let mut survey = Survey::default();
        self.each(&mut |frame| survey.frame(frame));
        survey
    }

    /// Corrects every detection, from now on.
    fn correct(&mut self, correction: Correction);

    /// Leaves out the frames that are not wanted, from now on; what is left has this extent.
    fn cut(&mut self, wanted: Wanted, left: Extent);
}

impl Frames for Vec<Frame> {
    fn parts(&self, see: &mut dyn FnMut(&[Frame]) -> ControlFlow<()>) {
        let _ = see(self);
    }

    fn correct(&mut self, correction: Correction) {
        self.iter_mut().for_each(|frame| correction.apply(frame));
    }

    fn cut(&mut self, wanted: Wanted, _: Extent) {
        self.retain(|frame| wanted.has(frame.time_ns));
    }
}

/// The stride through so many by which at most `most` are met.
pub fn step(of: usize, most: usize) -> usize {
    of.div_ceil(most).max(1)
}

/// At most so many of the frames, spread over all of them.
pub fn spread(frames: &dyn Frames, of: usize, most: usize) -> Vec<Frame> {
    let (step, mut k, mut spread) = (step(of, most), 0, Vec::new());
    frames.each(&mut |frame| {
        if k % step == 0 {
            spread.push(frame.clone());
        }
        k += 1;
    });
    spread
}

/// What frames say before anything is asked of them.
#[derive(Debug, Clone, Default)]
pub struct Survey {
    pub extent: Extent,
    pub clock: Clock,
    pub unfilled: Unfilled,
}

impl Survey {
    /// Takes the next frame.
    pub fn frame(&mut self, frame: &Frame) {
        self.extent.frame(frame);
        self.clock.frame(frame.time_ns);
        self.unfilled.frame(frame);
    }
}

/// How much there is of a recording.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Extent {
    pub frames: usize,
    /// Times of the first frame and of the last; 0 where there is none.
    pub first_ns: i64,
    pub last_ns: i64,
    pub detections: u64,
    /// Points dropped when it was read, and those left out by the radar's own marks.
    pub refused: u64,
    pub unwanted: u64,
}

impl Extent {
    /// Of all these.
    pub fn of(frames: &[Frame]) -> Self {
        let mut extent = Self::default();
        frames.iter().for_each(|frame| extent.frame(frame));
        extent
    }

    /// Takes the next frame.
    pub fn frame(&mut self, frame: &Frame) {
        if self.frames == 0 {
            self.first_ns = frame.time_ns;
        }
        self.frames += 1;
        self.last_ns = frame.time_ns;
        self.detections += frame.detections.len() as u64;
        self.refused += frame.refused;
        self.unwanted += frame.unwanted.len() as u64;
    }

    pub fn duration_s(&self) -> f64 {
        self.last_ns.saturating_sub(self.first_ns) as f64 * 1e-9
    }
}

/// Which frames are wanted.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Wanted {
    /// From when on the seconds count.
    pub start_ns: i64,
    pub from_s: Option<f64>,
    pub to_s: Option<f64>,
}

impl Wanted {
    pub fn has(&self, time_ns: i64) -> bool {
        let since = time_ns.saturating_sub(self.start_ns) as f64 * 1e-9;
        self.from_s.is_none_or(|from| since >= from) && self.to_s.is_none_or(|to| since <= to)
    }
}

/// What is wrong with every detection, and mended.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Correction {
    /// Velocities have the other sign.
    pub reversed: bool,
    /// What makes m/s of them.
    pub scale: Option<f64>,
    /// Which of the fields that may be missing are [never filled](super::unfilled).
    pub unfilled: [bool; unfilled::FIELDS.len()],
}

impl Correction {
    pub fn apply(&self, frame: &mut Frame) {
        if *self != Self::default() {
            frame.detections.iter_mut().for_each(|d| self.detection(d));
        }
    }

    fn detection(&self, d: &mut RadarDetection) {
        if self.reversed {
            d.radial_velocity_mps = -d.radial_velocity_mps;
        }
        if let Some(scale) = self.scale {
            d.radial_velocity_mps = (f64::from(d.radial_velocity_mps) * scale) as f32;
        }
        for (field, _) in unfilled::FIELDS.iter().zip(self.unfilled).filter(|(_, unfilled)| *unfilled) {
            (field.unset)(d);
        }
    }
}

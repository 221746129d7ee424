//! Runs one estimator over a recording and scores its map at every counted frame.

use viewshed::map::{RoadPoint, Visibility, VisibilityMap};

use super::cells::CellCounts;
use super::counts::Counts;
use super::samples::FrameSamples;
use crate::recording::{Frame, Recording};

/// A visibility estimator as the harness drives it: one radar frame in, one map out.
pub trait Estimator: Send {
    fn name(&self) -> &str;

    /// Forgets everything (before each frame of a recording of independent frames).
    fn reset(&mut self);

    /// Takes a radar frame and brings the map up to its time.
    fn step(&mut self, frame: &Frame);

    fn map(&self) -> &dyn VisibilityMap;
}

/// One object at one frame, as an estimator sees it. `grade` is `None` where all its cells are unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Verdict {
    pub visible: bool,
    pub grade: Option<u8>,
}

/// What an estimator said of every sample, frame by frame, in the samples' order.
#[derive(Debug, Clone)]
pub struct Score {
    pub name: String,
    pub verdicts: Vec<Vec<Verdict>>,
    /// Cell counts by frame.
    pub cells: Vec<CellCounts>,
    /// Cells by grade (index 256: unknown), in sight and blocked, over all counted frames.
    pub grades_clear: Vec<u64>,
    pub grades_blocked: Vec<u64>,
}

/// Grades 0..=255, and one place for unknown.
pub const GRADE_SLOTS: usize = 257;

impl Score {
    pub fn objects(&self, samples: &[FrameSamples]) -> Counts {
        let mut counts = Counts::default();
        for (frame, verdicts) in samples.iter().zip(&self.verdicts) {
            for (sample, verdict) in frame.objects.iter().zip(verdicts) {
                counts.add(verdict.visible, sample.detected);
            }
        }
        counts
    }

    pub fn cell_counts(&self) -> CellCounts {
        let mut total = CellCounts::ZERO;
        for c in &self.cells {
            total.blocked += c.blocked;
            total.blocked_visible += c.blocked_visible;
            total.clear += c.clear;
            total.clear_not_visible += c.clear_not_visible;
        }
        total
    }
}

/// Scores one estimator over a whole recording.
pub fn score(
    estimator: &mut dyn Estimator,
    recording: &Recording,
    samples: &[FrameSamples],
    progress: &dyn Fn(),
) -> Score {
    let mut score = Score {
        name: estimator.name().to_owned(),
        verdicts: Vec::with_capacity(samples.len()),
        cells: Vec::with_capacity(samples.len()),
        grades_clear: vec![0; GRADE_SLOTS],
        grades_blocked: vec![0; GRADE_SLOTS],
    };
    for (frame, sample) in recording.frames.iter().zip(samples) {
        if recording.sensor.frames_independent {
            estimator.reset();
        }
        estimator.step(frame);
        progress();
        let map = estimator.map();
        score.verdicts.push(sample.objects.iter().map(|o| verdict(map, &o.cells)).collect());
        let mut cells = CellCounts::ZERO;
        for &((i, j), in_sight) in &sample.cells {
            let state = map.at(RoadPoint::cell_centre(i, j));
            cells.add(in_sight, state.visible());
            let slot = if state.visibility == Visibility::Unknown { GRADE_SLOTS - 1 } else { usize::from(state.grade) };
            if in_sight {
                score.grades_clear[slot] += 1;
            } else {
                score.grades_blocked[slot] += 1;
            }
        }
        score.cells.push(cells);
    }
    score
}

/// An object is as visible as the best cell under it.
fn verdict(map: &dyn VisibilityMap, cells: &[(i32, i32)]) -> Verdict {
    let mut verdict = Verdict { visible: false, grade: None };
    for &(i, j) in cells {
        let state = map.at(RoadPoint::cell_centre(i, j));
        verdict.visible |= state.visible();
        if state.visibility != Visibility::Unknown {
            verdict.grade = verdict.grade.max(Some(state.grade));
        }
    }
    verdict
}

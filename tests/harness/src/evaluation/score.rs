//! Runs one estimator over a recording and scores its map at every counted frame.

use viewshed::frame::health::Condition;
use viewshed::map::{Visibility, VisibilityMap};
use viewshed::sensor::road::RoadPoint;

use super::Grid;
use super::cells::{CellCounts, CellTally};
use super::counts::Counts;
use super::samples::{Cell, FrameSamples, Sample};
use crate::estimators::Estimator;
use crate::geometry::solid::Solid;
use crate::recording::Recording;

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
    /// The cells objects were judged on: polar only where the map has polar cells.
    pub grid: Grid,
    /// Whether verdicts carry grades, so that a threshold can be moved.
    pub graded: bool,
    pub verdicts: Vec<Vec<Verdict>>,
    /// Road cells by frame; empty where cells are not judged at all.
    pub cells: Vec<CellTally>,
    pub counters: Vec<(String, u64)>,
    /// Azimuth's noise that the estimator worked with at the end, degrees, where it learns that.
    pub azimuth_noise_deg: Option<f64>,
    /// Places at which it has learnt a lane until the end; `None` of several recordings together.
    pub learnt_lanes: Option<usize>,
    /// What its map was worth.
    pub worth: Worth,
}

/// What a map was worth at the counted frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Worth {
    settled: Settled,
    /// Frames in which points came and could not be used, so that all was unknown.
    pub unusable: usize,
}

impl Worth {
    /// Takes a counted frame and what is counted in it.
    pub fn frame(&mut self, condition: Condition, counts: Counts, cells: CellCounts) {
        self.settled.of += 1;
        self.unusable += usize::from(condition == Condition::Unusable);
        if condition != Condition::Settling {
            self.settled.frames += 1;
            self.settled.counts += counts;
            self.settled.cells += cells;
        }
    }

    /// What is left without the frames whose map had not settled; `None` where all had.
    pub fn settled(&self) -> Option<Settled> {
        Some(self.settled).filter(|settled| settled.frames < settled.of)
    }
}

/// The frames whose map had settled, and what is counted in them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Settled {
    pub frames: usize,
    /// Counted frames in all.
    pub of: usize,
    pub counts: Counts,
    pub cells: CellCounts,
}

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
        let mut total = CellCounts::default();
        self.cells.iter().for_each(|c| total += c.counts);
        total
    }
}

/// Scores one estimator over a whole recording that is held. `progress` is called after each frame.
pub fn score(
    estimator: &mut dyn Estimator,
    recording: &Recording,
    samples: &[FrameSamples],
    grid: Grid,
    progress: &dyn Fn(),
) -> Score {
    let mut judged_on = grid;
    let (mut verdicts, mut cells, mut worth) = (Vec::new(), Vec::new(), Worth::default());
    // hours without labels have nothing to be judged frame by frame
    let judged = samples.iter().any(|sample| !sample.objects.is_empty() || !sample.cells.is_empty());
    cells.extend((!judged && !samples.is_empty()).then(CellTally::default));
    for (frame, sample) in recording.frames.iter().zip(samples) {
        if recording.sensor.frames_independent {
            estimator.reset();
        }
        estimator.step(frame);
        progress();
        let mut judge = |object: &Sample| {
            let map = estimator.map();
            if grid == Grid::Polar && estimator.polar().is_some() {
                return verdict(map, points(&object.solid));
            }
            judged_on = Grid::Cartesian;
            verdict(map, object.cells.iter().map(|&(i, j)| RoadPoint::cell_centre(i, j)))
        };
        let of_objects: Vec<Verdict> = sample.objects.iter().map(&mut judge).collect();
        let of_cells = tally(estimator.map(), &sample.cells);
        if sample.counted {
            let mut counts = Counts::default();
            sample.objects.iter().zip(&of_objects).for_each(|(s, v)| counts.add(v.visible, s.detected));
            worth.frame(estimator.condition(), counts, of_cells.counts);
        }
        if judged {
            verdicts.push(of_objects);
            cells.push(of_cells);
        }
    }
    Score { grid: judged_on, verdicts, cells, ..Score::unjudged(estimator, grid, worth) }
}

impl Score {
    /// Of an estimator that has run, without anything that was judged.
    pub fn unjudged(estimator: &dyn Estimator, grid: Grid, worth: Worth) -> Self {
        Self {
            name: estimator.name().to_owned(),
            grid,
            graded: true,
            verdicts: Vec::new(),
            cells: Vec::new(),
            counters: estimator.counters().into_iter().map(|(reason, n)| (reason.to_owned(), n)).collect(),
            azimuth_noise_deg: estimator.azimuth_noise_deg(),
            learnt_lanes: Some(estimator.learnt_lanes().len()),
            worth,
        }
    }
}

/// The map's bits and grades at road cells of which the exact sight is known.
fn tally(map: &dyn VisibilityMap, cells: &[(Cell, bool)]) -> CellTally {
    let mut tally = CellTally::default();
    for &((i, j), in_sight) in cells {
        let state = map.at(RoadPoint::cell_centre(i, j));
        let grade = (state.visibility != Visibility::Unknown).then_some(state.grade);
        tally.add(in_sight, state.visible(), grade);
    }
    tally
}

/// An object is as visible as the best cell under it.
fn verdict(map: &dyn VisibilityMap, places: impl IntoIterator<Item = RoadPoint>) -> Verdict {
    let mut verdict = Verdict { visible: false, grade: None };
    for place in places {
        let state = map.at(place);
        verdict.visible |= state.visible();
        if state.visibility != Visibility::Unknown {
            verdict.grade = verdict.grade.max(Some(state.grade));
        }
    }
    verdict
}

/// Points no farther apart than this reach every polar cell a footprint overlaps, but for slivers.
const POINT_SPACING_M: f64 = 0.25;

/// Points all over a footprint, its edges included.
fn points(solid: &Solid) -> impl Iterator<Item = RoadPoint> {
    let [length, width, _] = solid.size;
    let steps = |side: f64| (side / POINT_SPACING_M).ceil().max(1.0) as u32;
    let (along, across) = (steps(length), steps(width));
    let solid = *solid;
    (0..=along).flat_map(move |i| {
        (0..=across).map(move |j| {
            let part = |k: u32, of: u32| f64::from(k) / f64::from(of) - 0.5;
            let [x, y] = solid.global([part(i, along) * length, part(j, across) * width]);
            RoadPoint::new((x * 100.0).round() as i32, (y * 100.0).round() as i32)
        })
    })
}

#[cfg(test)]
mod tests {
    use viewshed::map::CellState;

    use super::*;

    /// x < 0 unknown, x < 10 m visible, beyond invisible with a grade falling with x.
    struct Ahead;

    impl VisibilityMap for Ahead {
        fn at(&self, p: RoadPoint) -> CellState {
            let grade = u8::try_from(255 - (p.x_cm / 100).clamp(0, 255)).unwrap();
            match p.x_cm {
                ..0 => CellState::UNKNOWN,
                0..1000 => CellState { visibility: Visibility::Visible, grade, occupancy: 0, occupied: false },
                _ => CellState { visibility: Visibility::Invisible, grade, occupancy: 0, occupied: false },
            }
        }

        fn cells_in(&self, area: &viewshed::query::Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }

    #[test]
    fn one_visible_cell_makes_an_object_visible_and_unknown_never_does() {
        let verdict =
            |map: &Ahead, cells: &[Cell]| verdict(map, cells.iter().map(|&(i, j)| RoadPoint::cell_centre(i, j)));
        assert_eq!(verdict(&Ahead, &[(9, 0), (10, 0)]), Verdict { visible: true, grade: Some(246) });
        assert_eq!(verdict(&Ahead, &[(10, 0), (20, 0)]), Verdict { visible: false, grade: Some(245) });
        assert_eq!(verdict(&Ahead, &[(-1, 0)]), Verdict { visible: false, grade: None });
        assert_eq!(verdict(&Ahead, &[(-1, 0), (30, 0)]).grade, Some(225));
    }

    #[test]
    fn points_cover_a_footprint_to_its_edges() {
        let solid = Solid { center: [10.0, 5.0, 0.75], yaw_rad: 0.0, size: [4.0, 2.0, 1.5] };
        let all: Vec<RoadPoint> = points(&solid).collect();
        assert_eq!(all.len(), 17 * 9);
        assert!(all.contains(&RoadPoint::new(800, 400)) && all.contains(&RoadPoint::new(1200, 600)));
    }

    #[test]
    fn unknown_road_cells_count_as_not_visible() {
        let t = tally(&Ahead, &[((-5, 0), true), ((5, 0), true), ((5, 1), false), ((15, 0), false)]);
        assert_eq!(t.counts, CellCounts { blocked: 2, blocked_visible: 1, clear: 2, clear_not_visible: 1 });
        assert_eq!((t.grades.positive[256], t.grades.negative[240]), (1, 1));
    }
}

/// Scores put together by hand, for the tests of what is made of them.
#[cfg(test)]
pub mod made_up {
    use super::*;

    /// A score that gives each sample the grade `grade` says, visible from 128 on.
    pub fn score(name: &str, samples: &[FrameSamples], grade: impl Fn(&Sample) -> Option<u8>) -> Score {
        let verdict = |s: &Sample| Verdict { visible: grade(s).is_some_and(|g| g >= 128), grade: grade(s) };
        Score {
            name: name.to_owned(),
            grid: Grid::Cartesian,
            graded: true,
            verdicts: samples.iter().map(|frame| frame.objects.iter().map(verdict).collect()).collect(),
            cells: vec![CellTally::default(); samples.len()],
            counters: Vec::new(),
            azimuth_noise_deg: None,
            learnt_lanes: None,
            worth: Worth::default(),
        }
    }
}

//! The two geometry rows: exact lines of sight, as if they were estimators.
//!
//! `geometry-slice` is what a perfect map at slice height would say, `geometry-box` asks for a line
//! of sight to any point of the box. They bound every method that follows lines of sight; what
//! remains after them is the radar's nature.

use super::Grid;
use super::cells::CellTally;
use super::samples::{FrameSamples, Sample};
use super::score::{Score, Verdict};

pub const SLICE: &str = "geometry-slice";
pub const BOX: &str = "geometry-box";

/// `geometry-slice`. Its cell rates are 0 by definition: the truth of a cell is this computation.
pub fn slice(samples: &[FrameSamples]) -> Score {
    let cells = |frame: &FrameSamples| {
        let mut tally = CellTally::default();
        frame.cells.iter().for_each(|&(_, in_sight)| tally.counts.add(in_sight, in_sight));
        tally
    };
    let mut score = row(SLICE, samples, |s| s.slice_in_sight);
    score.cells = samples.iter().map(cells).collect();
    score
}

/// `geometry-box`. A cell has no box, so cells are not judged.
pub fn boxes(samples: &[FrameSamples]) -> Score {
    row(BOX, samples, |s| s.box_in_sight)
}

fn row(name: &str, samples: &[FrameSamples], in_sight: impl Fn(&Sample) -> bool) -> Score {
    let verdict = |s| Verdict { visible: in_sight(s), grade: None };
    Score {
        name: name.to_owned(),
        grid: Grid::Cartesian,
        graded: false,
        verdicts: samples.iter().map(|frame| frame.objects.iter().map(verdict).collect()).collect(),
        cells: Vec::new(),
        counters: Vec::new(),
        azimuth_noise_deg: None,
        learnt_lanes: None,
        settled: Vec::new(),
    }
}

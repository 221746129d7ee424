//! The two geometry rows: exact lines of sight, as if they were estimators.
//!
//! `geometry-slice` is what a perfect map at slice height would say, `geometry-box` asks for a line
//! of sight to any point of the box. They bound every method that follows lines of sight; what
//! remains after them is the radar's nature.

use super::Grid;
use super::cells::CellTally;
use super::samples::{FrameSamples, Sample};
use super::score::{Score, Verdict, Worth};

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
    // where none was judged one tally is as good as many
    let judged = samples.iter().any(|frame| !frame.cells.is_empty());
    score.cells = samples.iter().take(if judged { samples.len() } else { 1 }).map(cells).collect();
    score
}

/// `geometry-box`. A cell has no box, so cells are not judged.
pub fn boxes(samples: &[FrameSamples]) -> Score {
    row(BOX, samples, |s| s.box_in_sight)
}

fn row(name: &str, samples: &[FrameSamples], in_sight: impl Fn(&Sample) -> bool) -> Score {
    let verdict = |s| Verdict { visible: in_sight(s), grade: None };
    let judged = samples.iter().any(|frame| !frame.objects.is_empty());
    let samples = if judged { samples } else { &[] };
    Score {
        name: name.to_owned(),
        grid: Grid::Cartesian,
        graded: false,
        verdicts: samples.iter().map(|frame| frame.objects.iter().map(verdict).collect()).collect(),
        cells: Vec::new(),
        counters: Vec::new(),
        azimuth_noise_deg: None,
        learnt_lanes: None,
        worth: Worth::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::made_up::sample;
    use super::*;

    #[test]
    fn frames_without_anything_to_judge_are_no_rows_of_their_own() {
        let mut samples = vec![FrameSamples { counted: true, ..FrameSamples::default() }; 1000];
        for score in [slice(&samples), boxes(&samples)] {
            assert!(score.cells.len() <= 1 && score.verdicts.is_empty());
        }
        assert_eq!(slice(&samples).cells.len(), 1, "cells were judged, and there were none");
        samples[7].objects.push(sample(0, 50.0, true, true));
        samples[8].cells.push(((9, 0), true));
        let score = slice(&samples);
        assert_eq!((score.cells.len(), score.verdicts.len(), score.verdicts[7].len()), (1000, 1000, 1));
        assert_eq!(score.cell_counts().clear, 1);
    }
}

//! An estimator's counts over the time of a recording, in windows of one length.

use super::cells::CellCounts;
use super::counts::Counts;
use super::samples::FrameSamples;
use super::score::Score;
use crate::recording::Recording;

/// Shortest window, seconds: a shorter one holds too few vehicles for a rate.
const LEAST_S: f64 = 2.0;
/// Windows that a chart has room for.
const MOST: f64 = 60.0;

/// What was counted in a part of the recording.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Window {
    /// Seconds since the first frame.
    pub from_s: f64,
    pub to_s: f64,
    pub objects: Counts,
    pub cells: CellCounts,
}

/// The windows of a recording, the first from its first frame on. Windows without a counted frame are left out.
pub fn windows(recording: &Recording, samples: &[FrameSamples], score: &Score) -> Vec<Window> {
    let length_s = (recording.duration_s() / MOST).max(LEAST_S);
    let start = recording.frames.first().map_or(0, |f| f.time_ns);
    let mut windows: Vec<Window> = Vec::new();
    for (k, frame) in recording.frames.iter().enumerate() {
        let Some(sample) = samples.get(k).filter(|sample| sample.counted) else { continue };
        let time_s = frame.time_ns.saturating_sub(start) as f64 * 1e-9;
        let from_s = (time_s / length_s).floor() * length_s;
        if windows.last().is_none_or(|last| last.from_s != from_s) {
            windows.push(Window { from_s, to_s: from_s + length_s, ..Window::default() });
        }
        let Some(window) = windows.last_mut() else { continue };
        for (object, verdict) in sample.objects.iter().zip(score.verdicts.get(k).into_iter().flatten()) {
            window.objects.add(verdict.visible, object.detected);
        }
        if let Some(tally) = score.cells.get(k) {
            window.cells += tally.counts;
        }
    }
    windows
}

#[cfg(test)]
mod tests {
    use super::super::samples::made_up::{frames, recording, sample};
    use super::super::score::made_up::score;
    use super::*;

    #[test]
    fn every_object_is_counted_in_the_window_of_its_frame() {
        // 0.1 s a frame; undetected and visible from 2 s on
        let samples = frames((0..45).map(|k| vec![sample(0, 60.0, k < 20, true)]));
        let recording = recording(45, 1);
        let found = windows(&recording, &samples, &score("m", &samples, |_| Some(255)));
        let counts: Vec<_> = found.iter().map(|w| (w.from_s, w.objects.tv, w.objects.fv)).collect();
        assert_eq!(counts, [(0.0, 20, 0), (2.0, 0, 20), (4.0, 0, 5)]);
    }

    #[test]
    fn what_does_not_count_makes_no_window() {
        let mut samples = frames((0..45).map(|_| vec![sample(0, 60.0, true, true)]));
        samples[..20].iter_mut().for_each(|frame| frame.counted = false);
        let found = windows(&recording(45, 1), &samples, &score("m", &samples, |_| Some(255)));
        assert_eq!(found.first().map(|w| w.from_s), Some(2.0));
    }
}

//! Estimators over a recording without labels: nothing is judged frame by frame, so days of frames pass and none is kept.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use rayon::prelude::*;

use super::Options;
use super::cells::{CellCounts, CellTally};
use super::counts::Counts;
use super::samples::FrameSamples;
use super::score::{Score, Worth};
use super::summary::Summary;
use super::units::BLOCK_NS;
use crate::estimators::Estimator;
use crate::recording::{Frame, Recording};

/// Runs estimators over all frames. `progress` is called after each frame of each.
pub fn judge(
    recording: &Recording,
    estimators: &mut [Box<dyn Estimator>],
    options: &Options,
    progress: &(dyn Fn() + Sync),
) -> (Vec<Score>, Summary) {
    let independent = recording.sensor.frames_independent;
    let warm_up_s = if independent { 0.0 } else { options.warm_up_s };
    let start_ns = recording.start_ns();
    let since_ns = |frame: &Frame| frame.time_ns.saturating_sub(start_ns);
    let counts = |frame: &Frame| since_ns(frame) as f64 * 1e-9 >= warm_up_s;
    let (mut sampled, mut counted, mut blocks) = (0, 0, BTreeSet::new());
    let mut running: Vec<(&mut Box<dyn Estimator>, Worth)> =
        estimators.iter_mut().map(|estimator| (estimator, Worth::default())).collect();
    recording.all().parts(&mut |part| {
        sampled += part.len();
        for frame in part.iter().filter(|frame| counts(frame)) {
            counted += 1;
            blocks.insert(since_ns(frame).div_euclid(BLOCK_NS));
        }
        running.par_iter_mut().for_each(|(estimator, worth)| {
            for frame in part {
                if independent {
                    estimator.reset();
                }
                estimator.step(frame);
                progress();
                if counts(frame) {
                    worth.frame(estimator.condition(), Counts::default(), CellCounts::default());
                }
            }
        });
        ControlFlow::Continue(())
    });
    // cells are judged here, and there were none: one tally is as good as many
    let cells = vec![CellTally::default(); sampled.min(1)];
    let score = |(estimator, worth): (&mut Box<dyn Estimator>, Worth)| Score {
        cells: cells.clone(),
        ..Score::unjudged(estimator.as_ref(), options.grid, worth)
    };
    let scores: Vec<Score> = running.into_iter().map(score).collect();
    // one frame of which nothing is counted stands for all
    let one = vec![FrameSamples::default(); sampled.min(1)];
    let mut summary = Summary::new(recording, &one, &scores, options);
    for row in &mut summary.rows {
        row.by_block = vec![CellCounts::default(); blocks.len()];
    }
    let summary = Summary { frames: counted, sampled, not_counted: sampled - counted, blocks: blocks.len(), ..summary };
    (scores, summary)
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::estimators;
    use crate::evaluation::replay::{Replay, visit};
    use crate::recording::{ReadOptions, open};
    use crate::results::report::{json, table};

    const LOG: &str = include_str!("../../../recordings/ars408-made-up.log");

    /// The shipped log again and again, a new sensor's start each time, with something wrong in some of them.
    fn long(name: &str) -> PathBuf {
        let again = |k: usize| {
            // a pause, and a clock that is set back
            let shift_s = 3.0 * k as f64 + if k >= 12 { 25.0 } else { 0.0 } - if k >= 18 { 60.0 } else { 0.0 };
            let shifted = |line: &str| {
                let (time, rest) = line.strip_prefix('(').and_then(|line| line.split_once(')')).unwrap();
                let rest = match k {
                    3 => rest.replace("201#401F40", "201#401F60"),
                    7 if rest.contains("702#") => format!("{}13", &rest[..rest.len() - 2]),
                    _ => rest.to_owned(),
                };
                format!("({:.6}){rest}\n", time.parse::<f64>().unwrap() - 1e9 + shift_s)
            };
            LOG.lines().map(shifted).collect::<String>() + if k == 15 { "what\n" } else { "" }
        };
        let path = std::env::temp_dir().join(format!("viewshed-{name}-{}.log", std::process::id()));
        std::fs::write(&path, (0..24).map(again).collect::<String>()).unwrap();
        path
    }

    fn options(of: ReadOptions) -> ReadOptions {
        ReadOptions { sensor_id: Some(0), mount: Some([0.0, 0.0, 5.0, 0.0, 0.03, 0.0]), ..of }
    }

    /// Table and JSON of a replay in parts of so many scans, or of all at once.
    fn told(path: &std::path::Path, reading: &ReadOptions, part: Option<usize>) -> (String, String) {
        let recording = open(path, reading, part).unwrap();
        assert_eq!(recording.frames.is_empty(), part.is_some(), "held or not");
        let (estimators, evaluation) = (estimators::Options::default(), Options::default());
        let mut running = estimators::all(&recording, &estimators).unwrap();
        let replay = Replay::new(recording, &mut running, &evaluation, &|| ());
        let text = table::text(&replay, &evaluation, table::Extent::Wide);
        let options = json::Options { reading, evaluation: &evaluation, estimators: &estimators };
        (text, json::object(&json::report(&replay, None, &[], options)).unwrap())
    }

    #[test]
    fn a_log_says_the_same_in_parts_of_any_size() {
        let path = long("in-parts");
        let reversed = ReadOptions { approaching_is_positive: true, ..ReadOptions::default() };
        let faster = ReadOptions { velocity_scale: Some(40.0), ..ReadOptions::default() };
        let middle = ReadOptions { from_s: Some(10.0), to_s: Some(50.0), ..ReadOptions::default() };
        let seen = [ReadOptions::default(), reversed, faster, middle].map(options).map(|reading| {
            let held = told(&path, &reading, None);
            for part in [1, 50, usize::MAX] {
                assert_eq!(told(&path, &reading, Some(part)), held, "in parts of {part}");
            }
            held.0
        });
        for what in ["reports a fault", "every entry was left out", "no frames for", "clock steps back", "line skipped"]
        {
            assert!(seen[0].contains(what), "{what}: {}", seen[0]);
        }
        assert!(seen[1].contains("velocities have the wrong sign"), "{}", seen[1]);
        assert!(seen[2].contains("points rejected (most: absurd)"), "{}", seen[2]);
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn of_a_log_in_parts_no_more_scans_are_held_than_are_asked_for() {
        let path = long("held");
        let reading = options(ReadOptions::default());
        let held = open(&path, &reading, None).unwrap();
        let mut parts = open(&path, &reading, Some(50)).unwrap();
        let (mut all, mut most) = (Vec::new(), 0);
        parts.all().parts(&mut |part| {
            most = most.max(part.len());
            all.extend_from_slice(part);
            ControlFlow::Continue(())
        });
        assert!(most == 50 && all == held.frames && parts.count() == all.len());
        assert_eq!((parts.extent(), parts.duration_s()), (held.extent(), held.duration_s()));
        // a frame for a picture, and a map of it
        parts.keep(&[400]);
        assert_eq!((parts.frame(400), parts.frame(7)), (held.frames.get(400), None));
        let shown = |recording: &Recording| {
            let mut one = [estimators::own(recording, &estimators::Options::default()).unwrap()];
            let mut seen = Vec::new();
            visit(recording, &mut one, &[400, 20], |frame, _, estimator| {
                let polar = estimator.polar().unwrap();
                let cells = (0..polar.azimuths).flat_map(|a| (0..polar.ranges).map(move |r| (a, r)));
                seen.push((frame, cells.map(|(a, r)| (polar.cell)(a, r).grade).collect::<Vec<_>>()));
            });
            seen
        };
        assert_eq!(shown(&parts), shown(&held));
        let refused = parts.clone().hold("--report", 100).unwrap_err().to_string();
        assert!(
            refused.contains("--report takes all scans at once") && refused.contains("--from and --to"),
            "{refused}"
        );
        assert_eq!(parts.hold("--report", 1000).unwrap().frames, held.frames);
        std::fs::remove_file(path).unwrap();
    }
}

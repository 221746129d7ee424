//! Several recordings judged as one: their seconds in a row, their tracks kept apart.
//!
//! A long recording is first summed up by seconds, the blocks that cells are drawn again by ([`super::units`]):
//! what rates and intervals are made of stays, the maps' cells frame by frame go.

use super::Options;
use super::bounds;
use super::cells::CellTally;
use super::replay::Replay;
use super::samples::FrameSamples;
use super::score::{Score, Verdict, Worth};
use super::summary::Summary;
use super::units::BLOCK_NS;
use crate::recording::problems::Problems;
use crate::recording::truth::Truth;
use crate::recording::{Frame, Recording};

/// One recording's samples and scores by seconds from its first frame on.
#[derive(Debug)]
pub struct Seconds {
    recording: Recording,
    seconds: Vec<Second>,
    /// Scores without verdicts and cells, which are in `seconds`; the last is `geometry-slice`, whose cells cannot be
    /// told from the samples of a second.
    scores: Vec<Score>,
}

#[derive(Debug, Default, Clone)]
struct Second {
    /// Counted frames in it.
    frames: usize,
    samples: FrameSamples,
    /// Of each score.
    verdicts: Vec<Vec<Verdict>>,
    cells: Vec<CellTally>,
}

/// A pause that is a leap of the clock, nanoseconds.
const LEAP_NS: i64 = 3600 * BLOCK_NS;

impl Seconds {
    /// Sums up what was scored; `samples` lie in the recording's order.
    pub fn new(mut recording: Recording, samples: &[FrameSamples], mut scores: Vec<Score>) -> Self {
        scores.push(bounds::slice(samples));
        let frames = std::mem::take(&mut recording.frames);
        let start = frames.first().map_or(0, |f| f.time_ns);
        let mut seconds: Vec<Second> = Vec::new();
        // a leap of the clock is no time: what follows it is counted from the next second on
        let (mut skipped_ns, mut before_ns) = (0_i64, start);
        for (k, (frame, sample)) in frames.iter().zip(samples).enumerate() {
            let pause_ns = frame.time_ns.saturating_sub(before_ns);
            if pause_ns > LEAP_NS {
                skipped_ns = skipped_ns.saturating_add(pause_ns - BLOCK_NS);
            }
            before_ns = frame.time_ns;
            if !sample.counted {
                continue;
            }
            let since_ns = frame.time_ns.saturating_sub(start).saturating_sub(skipped_ns);
            let at = usize::try_from(since_ns / BLOCK_NS).unwrap_or(0);
            if seconds.len() <= at {
                let empty = Second {
                    verdicts: vec![Vec::new(); scores.len()],
                    cells: vec![CellTally::default(); scores.len()],
                    ..Second::default()
                };
                seconds.resize(at + 1, empty);
            }
            let second = &mut seconds[at];
            second.frames += 1;
            second.samples.counted = true;
            // the cells under an object have been looked at
            second.samples.objects.extend(sample.objects.iter().cloned().map(|mut s| {
                s.cells = Vec::new();
                s
            }));
            for (i, score) in scores.iter().enumerate() {
                second.verdicts[i].extend(score.verdicts.get(k).into_iter().flatten());
                if let Some(tally) = score.cells.get(k) {
                    second.cells[i].counts += tally.counts;
                    second.cells[i].grades.add_times(&tally.grades, 1);
                }
            }
        }
        for score in &mut scores {
            score.verdicts = Vec::new();
            score.cells = Vec::new();
        }
        Self { recording, seconds, scores }
    }
}

/// Judges the seconds of all `parts` from `from_s` on together. All parts have the same scores.
///
/// The frames of the result are seconds, but for the number of frames in its summary.
pub fn pool(name: &str, parts: &[&Seconds], from_s: f64, options: &Options) -> Option<Replay> {
    let first = parts.first()?;
    let mut tracks = Vec::new();
    let mut frames = Vec::new();
    let mut counted = 0;
    let mut samples = Vec::new();
    let mut scores: Vec<Score> = first
        .scores
        .iter()
        .map(|s| Score {
            counters: Vec::new(),
            azimuth_noise_deg: None,
            learnt_lanes: None,
            worth: Worth::default(),
            ..s.clone()
        })
        .collect();
    for part in parts {
        let known = tracks.len();
        tracks.extend(part.recording.truth.iter().flat_map(|t| t.tracks.iter().cloned()));
        for (sum, score) in scores.iter_mut().zip(&part.scores) {
            for (reason, n) in &score.counters {
                match sum.counters.iter_mut().find(|(known, _)| known == reason) {
                    Some((_, total)) => *total += n,
                    None => sum.counters.push((reason.clone(), *n)),
                }
            }
        }
        for (_, second) in part.seconds.iter().enumerate().filter(|(k, _)| *k as f64 >= from_s) {
            frames.push(Frame {
                time_ns: frames.len() as i64 * BLOCK_NS,
                detections: Vec::new(),
                refused: 0,
                unwanted: Vec::new(),
                fault: false,
            });
            counted += second.frames;
            let mut sample = second.samples.clone();
            sample.objects.iter_mut().for_each(|s| s.track += known);
            samples.push(sample);
            for (i, score) in scores.iter_mut().enumerate() {
                // a second without a counted frame has nothing of any score
                score.verdicts.push(second.verdicts.get(i).cloned().unwrap_or_default());
                score.cells.push(second.cells.get(i).cloned().unwrap_or_default());
            }
        }
    }
    let recording = Recording {
        name: name.to_owned(),
        sensor: first.recording.sensor.clone(),
        pose: first.recording.pose,
        frames,
        scans: None,
        ground: first.recording.ground.clone(),
        truth: Some(Truth { tracks, ..Truth::default() }),
        occlusion: Default::default(),
        camera: None,
        problems: Problems::default(),
    };
    let slice = scores.pop()?;
    let mut summary = Summary::beside(&recording, &samples, &scores, &slice, options);
    summary.frames = counted;
    Some(Replay { recording, samples, scores, summary, camera: None })
}

#[cfg(test)]
mod tests {
    use super::super::bounds::SLICE;
    use super::super::cells::CellCounts;
    use super::super::samples::made_up::{frames, recording, sample};
    use super::super::score::made_up::score;
    use super::*;

    /// 3 s at 10 Hz of two tracks; the second is hidden and found in the last second only.
    fn part() -> (Recording, Vec<FrameSamples>, Score) {
        let objects = |k: usize| vec![sample(0, 40.0, true, true), sample(1, 60.0, k >= 20, false)];
        let mut samples = frames((0..30).map(objects));
        let mut score = score("radar-3d", &samples, |s| Some(if s.distance_m < 50.0 { 255 } else { 0 }));
        for (tally, frame) in score.cells.iter_mut().zip(&mut samples) {
            tally.add(true, true, Some(200));
            tally.add(false, true, Some(180));
            frame.cells = vec![((30, 0), true), ((70, 0), false)];
        }
        score.counters = vec![("snr".into(), 2)];
        (recording(30, 2), samples, score)
    }

    fn seconds() -> Seconds {
        let (recording, samples, score) = part();
        Seconds::new(recording, &samples, vec![score])
    }

    #[test]
    fn a_pool_of_one_recording_counts_what_the_recording_counts() {
        let (recording, samples, score) = part();
        let whole = Summary::new(&recording, &samples, std::slice::from_ref(&score), &Options::default());
        let pooled = pool("one", &[&seconds()], 0.0, &Options::default()).unwrap().summary;
        assert_eq!((pooled.frames, pooled.objects, pooled.blocks), (30, 2, 3));
        for name in ["radar-3d", SLICE] {
            let [a, b] = [&whole, &pooled].map(|s| s.row(name).unwrap());
            assert_eq!((a.counts, &a.to_slice), (b.counts, &b.to_slice), "{name}");
            assert_eq!((a.cells, &a.intervals, &a.by_block), (b.cells, &b.intervals, &b.by_block), "{name}");
        }
        assert_eq!(pooled.row(SLICE).map(|r| (r.cell_fvr(), r.cell_fir())), Some((Some(0.0), Some(0.0))));
        let [a, b] = [&whole.rows[0], &pooled.rows[0]];
        assert_eq!((a.cells, &a.intervals, &a.cell_curve), (b.cells, &b.intervals, &b.cell_curve));
    }

    #[test]
    fn tracks_of_two_recordings_are_not_mixed_up_and_the_warm_up_is_left_out() {
        let parts = [seconds(), seconds()];
        let pooled = pool("two", &[&parts[0], &parts[1]], 2.0, &Options::default()).unwrap().summary;
        assert_eq!((pooled.frames, pooled.objects, pooled.drawn_units, pooled.blocks), (20, 4, 4, 2));
        let row = &pooled.rows[0];
        assert_eq!((row.counts.tv, row.counts.fi, row.counts.total()), (20, 20, 40), "the last second of each");
        let cells = CellCounts { blocked: 20, blocked_visible: 20, clear: 20, clear_not_visible: 0 };
        assert_eq!(row.cells, Some(cells));
        assert_eq!(row.counters, [("snr".to_owned(), 4)]);
        assert!(pool("none", &[], 0.0, &Options::default()).is_none());
    }
}

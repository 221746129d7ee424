//! Every object at every counted frame as a row of CSV.
//!
//! Columns: `recording`, `time_s` (since the first frame replayed), `time_ns` (the recording's own
//! clock), `object_id`, `class`, `distance_m`, `detections`, `detected` (D_O), `occlusion` (0 to 2, empty
//! where not given), `geometry_slice`, `geometry_box` (1: in sight), and for each estimator
//! `NAME_visible` (V_O) and `NAME_grade` (0 to 255; empty where all its cells are unknown).

use std::io::Write;

use anyhow::{Result, ensure};

use crate::evaluation::breakdown::occlusion;
use crate::evaluation::replay::Replay;
use crate::evaluation::score::Verdict;

const FIXED: [&str; 11] = [
    "recording",
    "time_s",
    "time_ns",
    "object_id",
    "class",
    "distance_m",
    "detections",
    "detected",
    "occlusion",
    "geometry_slice",
    "geometry_box",
];

/// Writes replays one after the other under one heading.
pub struct SampleWriter<W: Write> {
    csv: csv::Writer<W>,
    /// Estimators of the heading, once there is one.
    estimators: Option<Vec<String>>,
    /// Estimators of a recording without labels, which has no rows: enough for a heading if no other comes.
    unlabelled: Vec<String>,
}

impl<W: Write> SampleWriter<W> {
    pub fn new(sink: W) -> Self {
        Self { csv: csv::Writer::from_writer(sink), estimators: None, unlabelled: Vec::new() }
    }

    /// # Errors
    /// A sink that does not take the rows, or estimators other than those of the heading.
    pub fn write(&mut self, replay: &Replay) -> Result<()> {
        let names: Vec<String> = replay.scores.iter().map(|s| s.name.clone()).collect();
        let Some(truth) = &replay.recording.truth else {
            self.unlabelled = names;
            return Ok(());
        };
        match &self.estimators {
            Some(heading) => ensure!(*heading == names, "{}: other estimators than before", replay.recording.name),
            None => self.heading(names)?,
        }
        let start_ns = replay.recording.frames.first().map_or(0, |f| f.time_ns);
        for (k, (frame, samples)) in replay.recording.frames.iter().zip(&replay.samples).enumerate() {
            for (n, sample) in samples.objects.iter().enumerate() {
                let track = &truth.tracks[sample.track];
                let fixed = [
                    replay.recording.name.clone(),
                    format!("{:.3}", frame.time_ns.saturating_sub(start_ns) as f64 * 1e-9),
                    frame.time_ns.to_string(),
                    track.id.clone(),
                    track.class.clone(),
                    format!("{:.2}", sample.distance_m),
                    sample.detections.to_string(),
                    bit(sample.detected),
                    occlusion(&replay.recording, sample).map_or_else(String::new, |g| g.to_string()),
                    bit(sample.slice_in_sight),
                    bit(sample.box_in_sight),
                ];
                let verdicts = replay.scores.iter().flat_map(|score| columns(score.verdicts[k][n]));
                self.csv.write_record(fixed.into_iter().chain(verdicts))?;
            }
        }
        Ok(())
    }

    /// Writes out what is buffered and gives the sink back; without a row there is a heading at least.
    pub fn finish(mut self) -> Result<W> {
        if self.estimators.is_none() {
            let names = std::mem::take(&mut self.unlabelled);
            self.heading(names)?;
        }
        Ok(self.csv.into_inner().map_err(|e| e.into_error())?)
    }

    fn heading(&mut self, names: Vec<String>) -> Result<()> {
        let verdicts = names.iter().flat_map(|name| [format!("{name}_visible"), format!("{name}_grade")]);
        self.csv.write_record(FIXED.iter().map(|&name| name.to_owned()).chain(verdicts))?;
        self.estimators = Some(names);
        Ok(())
    }
}

fn bit(value: bool) -> String {
    u8::from(value).to_string()
}

fn columns(verdict: Verdict) -> [String; 2] {
    [bit(verdict.visible), verdict.grade.map_or_else(String::new, |g| g.to_string())]
}

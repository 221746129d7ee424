//! The lines around the table: what was counted, how the intervals came about, what was rejected.

use super::percent;
use crate::evaluation::Options;
use crate::evaluation::bootstrap::Interval;
use crate::evaluation::comparison::Comparison;
use crate::evaluation::replay::Replay;
use crate::evaluation::summary::Row;
use crate::recording::truth::LabelsBeside;

/// What the table is of.
pub fn heading(replay: &Replay) -> String {
    let (recording, summary) = (&replay.recording, &replay.summary);
    let sensor = if recording.sensor.name == recording.name {
        String::new()
    } else {
        format!(" (sensor {})", recording.sensor.name)
    };
    if recording.truth.is_none() {
        return format!("{}{sensor}: {} frames", recording.name, summary.frames);
    }
    let spread = summary
        .coverage_interval
        .map(|Interval(low, high)| format!(" ({:.1}–{:.1})", 100.0 * low, 100.0 * high))
        .unwrap_or_default();
    format!(
        "{}{sensor}: {} frames, {} trajectories, coverage {} %{spread}",
        recording.name,
        summary.frames,
        summary.objects,
        percent(summary.coverage_rate)
    )
}

/// What has to be known to read the table, line by line.
pub fn below(replay: &Replay, options: &Options) -> Vec<String> {
    let (recording, summary) = (&replay.recording, &replay.summary);
    let mut lines = Vec::new();
    if recording.truth.is_some() && options.bootstrap > 0 {
        let cells = if recording.sensor.frames_independent {
            String::new()
        } else {
            format!(" (cells: of {} blocks of 1 s)", summary.blocks)
        };
        lines.push(format!(
            "95 % intervals by {} draws of {} {}{cells}, the same for every row; seed {}.",
            options.bootstrap, summary.drawn_units, summary.drawn, options.seed
        ));
    }
    if let Some(LabelsBeside { file, sized_by_class }) = recording.truth.as_ref().and_then(|t| t.beside.as_ref()) {
        let objects = recording.truth.as_ref().map_or(0, |t| t.tracks.len());
        lines.push(format!(
            "Labels of {file}: only what was labelled counts, usually what moves and was seen at least once; \
             {sized_by_class} of {objects} objects have the size of their class."
        ));
    }
    let cartesian = summary.rows.iter().filter(|r| !r.curve.is_empty() && r.grid != options.grid);
    lines.extend(cartesian.map(|r| format!("{} was judged on the {} grid: its map has no other.", r.name, r.grid)));
    lines.extend(summary.comparisons.iter().map(comparison));
    lines.extend(counters(&summary.rows));
    if recording.problems.is_empty() {
        lines.push("Problems of the input: none.".into());
    } else {
        lines.push("Problems of the input:".into());
        let start = recording.frames.first().map_or(0, |f| f.time_ns);
        lines.extend(recording.problems.iter().map(|p| format!("  {}", p.since(start))));
    }
    lines.extend(recording.sensor.licence.as_ref().map(|l| format!("Licence of the recording: {l}.")));
    lines
}

/// What stands in place of a table without a number.
pub const WITHOUT_LABELS: &str = "No labels, so maps and pictures and no rates. `viewshed label RECORDING` draws them in a minute; \
                                  NAME.labels.csv beside the recording is where they are read from.";

/// How a camera's objects and cells are judged.
pub const RULE_OF_CAMERA: &str = "Detected: a box of the camera's own, assigned one to one to the visible outline \
                                  (overlap from 0.3). Cells: the share of 0 to 4 m above them that is in sight.";

/// What has to be known to read the table of a camera, beside what stands below the radar's.
pub fn of_camera(replay: &Replay) -> Vec<String> {
    [RULE_OF_CAMERA.to_owned()].into_iter().chain(counters(&replay.summary.rows)).collect()
}

fn comparison(c: &Comparison) -> String {
    let spread =
        c.difference_interval.map(|Interval(low, high)| format!(" ({low:+.1}…{high:+.1})")).unwrap_or_default();
    format!(
        "At equal FIR of {} ({} %): {} has FVR {} %, the best of {} {} %: {:+.1} points{spread}.",
        c.of,
        percent(Some(c.at_fir)),
        c.estimator,
        percent(Some(c.fvr)),
        c.against.join(" and "),
        percent(Some(c.fvr_against)),
        c.difference_points
    )
}

/// What estimators did not use, by reason; estimators that say the same share a line.
fn counters(rows: &[Row]) -> Vec<String> {
    let mut said: Vec<(String, Vec<&str>)> = Vec::new();
    for row in rows {
        let counted: Vec<String> =
            row.counters.iter().filter(|(_, n)| *n > 0).map(|(reason, n)| format!("{reason} {n}")).collect();
        let counted = counted.join(", ");
        match said.iter_mut().find(|(before, _)| *before == counted) {
            Some((_, names)) => names.push(&row.name),
            None => said.push((counted, vec![&row.name])),
        }
    }
    said.retain(|(counted, _)| !counted.is_empty());
    said.iter().map(|(counted, names)| format!("Not used by {}: {counted}.", names.join(", "))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::by_hand::{frames, recording, sample};
    use crate::evaluation::score::by_hand::score;
    use crate::evaluation::summary::Summary;

    #[test]
    fn what_was_not_used_is_said_once_with_its_reasons() {
        let samples = frames([vec![sample(0, 50.0, true, true)]]);
        let mut scores = ["a", "b", "c"].map(|name| score(name, &samples, |_| Some(255)));
        scores[0].counters = vec![("range".into(), 3), ("snr".into(), 0)];
        scores[2].counters = scores[0].counters.clone();
        let summary = Summary::new(&recording(1, 1), &samples, &scores, &Options::default());
        assert_eq!(counters(&summary.rows), ["Not used by a, c: range 3."]);
    }
}

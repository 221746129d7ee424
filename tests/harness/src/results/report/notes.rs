//! The lines around the table: what was counted, how the intervals came about, what was rejected.

use viewshed::camera::boxes::BoxRejection;
use viewshed::frame::gate::Rejection;

use super::percent;
use crate::estimators::camera_3d::NO_VEHICLE;
use crate::estimators::{ABSURD, DROPPED, NO_RANGE, NOT_FINITE};
use crate::evaluation::Options;
use crate::evaluation::bootstrap::{Interval, LEAST_RUNS};
use crate::evaluation::comparison::Comparison;
use crate::evaluation::replay::Replay;
use crate::evaluation::summary::{Row, Summary};
use crate::evaluation::units::RUN_BLOCKS;
use crate::recording::frames::Extent;
use crate::recording::truth::LabelsBeside;
use crate::recording::usable;
use crate::recording::{Frame, Recording};

/// What the table is of.
pub fn heading(replay: &Replay) -> String {
    let (recording, summary) = (&replay.recording, &replay.summary);
    let sensor = if recording.sensor.name == recording.name {
        String::new()
    } else {
        format!(" (sensor {})", recording.sensor.name)
    };
    // a pool of recordings has seconds
    let all = summary.sampled;
    let frames = if all > summary.frames { format!("{} of {all}", summary.frames) } else { summary.frames.to_string() };
    if recording.truth.is_none() {
        return format!("{}{sensor}: {frames} frames", recording.name);
    }
    let spread = summary
        .coverage_interval
        .map(|Interval(low, high)| format!(" ({:.1}–{:.1})", 100.0 * low, 100.0 * high))
        .unwrap_or_default();
    format!(
        "{}{sensor}: {frames} frames, {} trajectories, coverage {} %{spread}",
        recording.name,
        summary.objects,
        percent(summary.coverage_rate)
    )
}

/// What has to be known to read the table, line by line.
pub fn below(replay: &Replay, options: &Options) -> Vec<String> {
    let (recording, summary) = (&replay.recording, &replay.summary);
    let mut lines = Vec::new();
    let not_counted = summary.not_counted;
    if not_counted > 0 && !recording.sensor.frames_independent {
        lines.push(format!(
            "Not counted: the first {} s, {not_counted} frames, in which maps begin; --warm-up sets that.",
            options.warm_up_s
        ));
    }
    lines.extend(slow(recording, options));
    if recording.truth.is_some() && options.bootstrap > 0 {
        let cells = if recording.sensor.frames_independent {
            String::new()
        } else {
            format!(" (cells: {})", blocks(summary.blocks))
        };
        lines.push(format!(
            "95 % intervals by {} draws of {} {}{cells}, the same for every row; seed {}.",
            options.bootstrap, summary.drawn_units, summary.drawn, options.seed
        ));
    }
    if let Some(LabelsBeside { file, sized_by_class, turned_by_path, left_out }) =
        recording.truth.as_ref().and_then(|t| t.beside.as_ref())
    {
        let objects = recording.truth.as_ref().map_or(0, |t| t.tracks.len());
        let instead = left_out
            .map(|own| format!(" They stand in place of the recording's own, of {own} objects."))
            .unwrap_or_default();
        lines.push(format!(
            "Labels of {file}: only what was labelled counts, usually what moves and was seen at least once; \
             {sized_by_class} of {objects} objects have the size of their class, {turned_by_path} the heading of their path.{instead}"
        ));
    }
    let cartesian = summary.rows.iter().filter(|r| !r.curve.is_empty() && r.grid != options.grid);
    lines.extend(cartesian.map(|r| format!("{} was judged on the {} grid: its map has no other.", r.name, r.grid)));
    lines.extend(summary.comparisons.iter().map(comparison));
    lines.extend(settled(&summary.rows));
    lines.extend(unusable(summary));
    lines.extend(noise_learnt(&summary.rows));
    lines.extend(lanes_learnt(&summary.rows));
    lines.extend(left_out(recording, &summary.rows));
    lines.extend(problems(recording));
    lines.extend(recording.sensor.licence.as_ref().map(|l| format!("Licence of the recording: {l}.")));
    lines
}

/// Which vehicles rates are not of.
fn slow(recording: &Recording, options: &Options) -> Option<String> {
    let truth = recording.truth.as_ref().filter(|truth| !truth.tracks.is_empty() && options.min_speed_mps > 0.0)?;
    let is_slow =
        |frame: &Frame| truth.at(frame.time_ns).iter().filter(|o| o.slower_than(options.min_speed_mps)).count();
    let all = |frame: &Frame| truth.at(frame.time_ns).len();
    let count = |of: &dyn Fn(&Frame) -> usize| recording.frames.iter().map(of).sum::<usize>();
    let (slow, all) = (count(&is_slow), count(&all));
    // a pool of recordings keeps no frames
    let share = if all > 0 { format!(", {slow} of {all} by frames") } else { String::new() };
    Some(format!(
        "Rates of vehicles leave out those slower than {} m/s{share}; they hide others, and cells count. --min-speed sets that.",
        options.min_speed_mps
    ))
}

/// What intervals of cells are drawn of.
pub fn blocks(blocks: usize) -> String {
    let least = LEAST_RUNS * RUN_BLOCKS;
    if blocks < least {
        format!("n/a, {blocks} blocks of 1 s are too short for an interval, which takes {least}")
    } else {
        format!("of {blocks} blocks of 1 s in runs of {RUN_BLOCKS}")
    }
}

/// What is wrong with the input, or that nothing is.
pub fn problems(recording: &Recording) -> Vec<String> {
    if recording.problems.is_empty() {
        return vec!["Problems of the input: none.".into()];
    }
    let start = recording.start_ns();
    let each = recording.problems.iter().map(|p| format!("  {}", p.since(start)));
    ["Problems of the input:".to_owned()].into_iter().chain(each).collect()
}

/// What stands in place of a table without a number.
pub const WITHOUT_LABELS: &str = "No labels, so maps and pictures and no rates. `viewshed label RECORDING` draws them in a minute; \
                                  NAME.labels.csv beside the recording is where they are read from.";

/// How a camera's objects and cells are judged.
pub const RULE_OF_CAMERA: &str = "Detected: a box of the camera's own, assigned one to one to the visible outline \
                                  (overlap from 0.3). Cells: the share of 0 to 4 m above them that is in sight.";

/// What has to be known to read the table of a camera, beside what stands below the radar's.
pub fn of_camera(replay: &Replay) -> Vec<String> {
    [RULE_OF_CAMERA.to_owned()].into_iter().chain(left_out(&replay.recording, &replay.summary.rows)).collect()
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

/// A reason for which estimators leave out a detection or a box, in words; `None` for what is neither.
fn in_words(reason: &str) -> Option<&str> {
    let of_gate = Rejection::ALL.into_iter().filter(|rejection| *rejection != Rejection::Refused);
    if let Some(rejection) = of_gate.into_iter().find(|rejection| rejection.name() == reason) {
        return Some(usable::in_words(rejection));
    }
    Some(match reason {
        DROPPED => "not finite or without a range when read",
        NOT_FINITE => "not finite",
        NO_RANGE => "at no measurable range",
        ABSURD => "with an absurd value",
        _ if reason == NO_VEHICLE => "of no vehicle",
        _ => reason.strip_prefix("box ").or((reason == BoxRejection::Refused.name()).then_some("not finite"))?,
    })
}

/// The row of a unit that has run over other recordings, which may have taught it nothing.
const LEARNING: &str = "radar-3d-learning";

/// How often each reason came.
type Counters<'a> = &'a [(String, u64)];

/// What estimators left out, by reason and with the total; estimators that say the same share a line.
fn left_out(recording: &Recording, rows: &[Row]) -> Vec<String> {
    let mut said: Vec<(Counters, Vec<&str>)> = Vec::new();
    for row in rows.iter().filter(|row| row.counters.iter().any(|(_, n)| *n > 0)) {
        match said.iter_mut().find(|(before, _)| *before == row.counters) {
            Some((_, names)) => names.push(&row.name),
            None => said.push((&row.counters, vec![&row.name])),
        }
    }
    let (all, what) = match recording.of_camera() {
        Some(camera) => (camera.frames.iter().map(|f| f.boxes.len() as u64 + f.refused).sum(), "boxes"),
        None => {
            let Extent { detections, refused, unwanted, .. } = recording.extent();
            (detections + refused + unwanted, "detections")
        }
    };
    let line = |(counters, names): &(Counters, Vec<&str>)| {
        let named = |(reason, n): &(String, u64)| Some((in_words(reason)?.to_owned(), *n));
        let mut reasons: Vec<(String, u64)> = counters.iter().filter(|(_, n)| *n > 0).filter_map(named).collect();
        reasons.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
        let sum: u64 = reasons.iter().map(|(_, n)| n).sum();
        // a pool of recordings keeps no frames
        let total = if all >= sum && all > 0 { format!(" of {all}") } else { String::new() };
        let reasons: Vec<String> = reasons.iter().map(|(reason, n)| format!("{n} {reason}")).collect();
        let others = counters.iter().filter(|(reason, n)| *n > 0 && in_words(reason).is_none());
        let others: String = others.map(|(reason, n)| format!(" {n} times there was {reason}.")).collect();
        match reasons.is_empty() {
            true => format!("{}:{others}", names.join(", ")),
            false => format!("{} left out {sum}{total} {what}: {}.{others}", names.join(", "), reasons.join(", ")),
        }
    };
    said.iter().map(line).collect()
}

/// In how many frames nothing was known though points came.
fn unusable(summary: &Summary) -> impl Iterator<Item = String> + '_ {
    let rows = summary.rows.iter().filter(|row| row.unusable > 0);
    rows.map(|row| {
        format!(
            "{}: in {} of {} frames all was unknown, since points kept coming of which nearly none could be used; what was left out for which reason stands below.",
            row.name, row.unusable, summary.frames
        )
    })
}

/// How much of the frames had a map that had settled, and the rates over these alone.
fn settled(rows: &[Row]) -> impl Iterator<Item = String> + '_ {
    rows.iter().filter_map(|row| {
        let settled = row.settled?;
        let pair = |fvr, fir| format!("{} / {}", percent(fvr), percent(fir));
        let share = 100.0 * settled.frames as f64 / settled.of.max(1) as f64;
        let rates = format!(
            "; over these alone FVR / FIR {} %, cells {} %",
            pair(settled.counts.fvr(), settled.counts.fir()),
            pair(settled.cells.fvr(), settled.cells.fir())
        );
        let is_judged = settled.counts.fvr().is_some() || settled.cells.fvr().is_some();
        Some(format!(
            "{}: {share:.0} % of the frames had settled since the start and since gaps (before that what is behind things that \
             stand is unknown){}.",
            row.name,
            if is_judged { rates } else { String::new() }
        ))
    })
}

/// What fixtures taught estimators of the azimuth's noise.
fn noise_learnt(rows: &[Row]) -> Option<String> {
    let learnt: Vec<String> = rows
        .iter()
        .filter_map(|row| Some((&row.name, row.azimuth_noise_deg?)))
        .map(|(name, deg)| format!("{deg:.2} in {name}"))
        .collect();
    (!learnt.is_empty()).then(|| {
        format!("Azimuth's noise of vehicles, degrees, by what fixtures showed until the end: {}.", learnt.join(", "))
    })
}

/// Where lanes were learnt, of the rows that may.
fn lanes_learnt(rows: &[Row]) -> Option<String> {
    let learnt: Vec<String> = rows
        .iter()
        .filter_map(|row| Some((&row.name, row.learnt_lanes?)))
        .filter(|(name, places)| *places > 0 || *name == LEARNING)
        .map(|(name, places)| format!("{places} in {name}"))
        .collect();
    (!learnt.is_empty()).then(|| {
        format!("Places with a learnt lane at the end, of 2.6 m where enough vehicles drove: {}.", learnt.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up::{PERIOD_NS, frames, recording, sample};
    use crate::evaluation::score::made_up::score;
    use crate::evaluation::summary::Summary;
    use crate::recording::truth::{Label, Truth};

    #[test]
    fn what_was_not_used_is_said_once_with_its_reasons() {
        let samples = frames([vec![sample(0, 50.0, true, true)]]);
        let mut scores = ["a", "b", "c"].map(|name| score(name, &samples, |_| Some(255)));
        scores[0].counters = vec![("range".into(), 3), ("snr".into(), 0)];
        scores[2].counters = scores[0].counters.clone();
        scores[1].counters = vec![("azimuth".into(), 1), (NOT_FINITE.into(), 4), ("no room in the list".into(), 2)];
        let mut recording = recording(1, 1);
        recording.frames[0].refused = 7;
        let summary = Summary::new(&recording, &samples, &scores, &Options::default());
        let all = 7 + recording.frames[0].detections.len();
        let expected = [
            format!("a, c left out 3 of {all} detections: 3 nearer or farther than the field of view."),
            format!(
                "b left out 5 of {all} detections: 4 not finite, 1 beside the field of view. \
                 2 times there was no room in the list."
            ),
        ];
        assert_eq!(left_out(&recording, &summary.rows), expected);
    }

    #[test]
    fn noise_that_was_learnt_is_said() {
        let samples = frames([vec![sample(0, 50.0, true, true)]]);
        let mut scores = ["a", "b", "c"].map(|name| score(name, &samples, |_| Some(255)));
        (scores[0].azimuth_noise_deg, scores[2].azimuth_noise_deg) = (Some(0.234), Some(0.2));
        let rows = Summary::new(&recording(1, 1), &samples, &scores, &Options::default()).rows;
        let line = "Azimuth's noise of vehicles, degrees, by what fixtures showed until the end: 0.23 in a, 0.20 in c.";
        assert_eq!(noise_learnt(&rows).as_deref(), Some(line));
        assert_eq!(noise_learnt(&rows[1..2]), None);
    }

    #[test]
    fn what_was_learnt_of_lanes_is_said_and_that_nothing_was() {
        let samples = frames([vec![sample(0, 50.0, true, true)]]);
        let mut scores = ["a", "b", LEARNING].map(|name| score(name, &samples, |_| Some(255)));
        (scores[0].learnt_lanes, scores[2].learnt_lanes) = (Some(412), Some(0));
        let rows = Summary::new(&recording(1, 1), &samples, &scores, &Options::default()).rows;
        let said = lanes_learnt(&rows).unwrap();
        assert!(said.ends_with(": 412 in a, 0 in radar-3d-learning."), "{said}");
        assert_eq!(lanes_learnt(&rows[1..2]), None);
        scores[2].learnt_lanes = None;
        let pooled = Summary::new(&recording(1, 1), &samples, &scores, &Options::default()).rows;
        assert_eq!(lanes_learnt(&pooled[1..]), None, "what is pooled has no number");
    }

    #[test]
    fn what_is_not_counted_is_said() {
        let mut samples = frames([vec![sample(0, 50.0, true, true)], vec![sample(0, 50.0, true, true)]]);
        samples[0].counted = false;
        let scores = [score("a", &samples, |_| Some(255))];
        let mut recording = recording(2, 1);
        // one label has no speed
        let mut solid = *recording.truth.as_ref().unwrap().solids().next().unwrap();
        let mut label = |k: i64, x: f64| {
            solid.center[0] = 50.0 + x;
            let id = if x > 0.0 || k == 0 { "fast" } else { "slow" };
            Label { time_ns: k * PERIOD_NS, id: id.into(), class: "car".into(), solid }
        };
        let both = [label(0, 0.0), label(1, 3.0), Label { id: "slow".into(), ..label(0, 0.0) }, label(1, 0.0)];
        recording.truth = Some(Truth::new(both.to_vec()));
        let options = Options { bootstrap: 0, ..Options::default() };
        let summary = Summary::new(&recording, &samples, &scores, &options);
        let mut replay = Replay { recording, samples, scores: Vec::new(), summary, camera: None };
        assert!(heading(&replay).starts_with("by-hand: 1 of 2 frames, 1 trajectories"), "{}", heading(&replay));
        let lines = below(&replay, &options);
        assert_eq!(lines[0], "Not counted: the first 1 s, 1 frames, in which maps begin; --warm-up sets that.");
        assert!(lines[1].contains("leave out those slower than 1 m/s, 2 of 4 by frames; they hide"), "{}", lines[1]);
        replay.recording.truth = None;
        assert_eq!(heading(&replay), "by-hand: 1 of 2 frames");
        assert_eq!(below(&replay, &options)[0], lines[0]);
    }

    #[test]
    fn every_reason_has_its_words() {
        for reason in Rejection::ALL.into_iter().filter(|r| *r != Rejection::Refused) {
            assert!(in_words(reason.name()).is_some(), "{}", reason.name());
        }
        for reason in BoxRejection::ALL {
            assert!(in_words(reason.name()).is_some_and(|words| !words.starts_with("box")), "{}", reason.name());
        }
    }
}

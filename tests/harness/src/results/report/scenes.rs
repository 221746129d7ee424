//! Crossings or queues as a table with what lies beside it, and as JSON.

use anyhow::Result;
use serde_json::{Value, json};

use super::json::{self, Options, Report};
use super::percent;
use super::table::{Extent, rates, signed, tables};
use super::{ORIGIN, notes};
use crate::evaluation::Options as EvaluationOptions;
use crate::evaluation::replay::Replay;
use crate::evaluation::summary::Row;
use crate::studies::experiment::scenes::{Counted, Goal, Plan};
use crate::twin::scene::Scene;

/// The estimator that is developed here.
const OURS: &str = "radar-3d";
/// The same where it was given the road's heights.
const WITH_GROUND: &str = "radar-3d-ground";

/// What was run.
pub struct Title<'a> {
    /// `crossing`.
    pub name: &'a str,
    /// `reporting` or `training`.
    pub set: &'a str,
    pub warm_up_s: f64,
    pub every: usize,
    /// Whether lanes were learnt from other days.
    pub lanes_learnt: bool,
    /// How much of the tables.
    pub extent: Extent,
}

/// Everything as text; the first of `counted` is what is reported.
pub fn text(title: &Title, plan: &Plan, counted: &[Counted], options: &EvaluationOptions) -> String {
    let Some((main, beside)) = counted.split_first() else { return String::new() };
    let every = if title.every > 1 { format!(", one frame in {} judged", title.every) } else { String::new() };
    let learnt = if title.lanes_learnt { "; lanes learnt from another day" } else { "" };
    let summary = &main.pooled.summary;
    let mut text = format!(
        "{}, {}: {} scenes, {}; the first {} s of each not counted{every}{learnt}\n\
         {} frames, {} trajectories, coverage {} %\n{}\n",
        title.name,
        title.set,
        main.scenes.len(),
        main.variant.name(),
        title.warm_up_s,
        summary.frames,
        summary.objects,
        percent(summary.coverage_rate),
        rates(summary, title.extent)
    );
    for line in notes::below(&main.pooled, options) {
        text += &(line + "\n");
    }
    for (name, goal) in [("floor", &plan.floor), ("aim", &plan.aim)] {
        text += &goal.as_ref().and_then(|g| reached(name, g, &main.pooled)).unwrap_or_default();
    }
    if !beside.is_empty() {
        text += &format!("\n{OURS} beside it:\n{}\n", variants(counted, title.extent));
    }
    format!("{text}\n{OURS} by scene:\n{}\n\n{ORIGIN}\n", by_scene(counted, title.extent))
}

/// Whether the estimator is as good as it should be.
fn reached(name: &str, goal: &Goal, pooled: &Replay) -> Option<String> {
    let row = pooled.summary.row(OURS)?;
    let cells = [100.0 * row.cell_fvr()?, 100.0 * row.cell_fir()?];
    let objects = [row.to_slice.fvr_points?, row.to_slice.fir_points?];
    let said = |found: [f64; 2], goal: [f64; 2]| {
        if found[0] <= goal[0] && found[1] <= goal[1] { "reached" } else { "NOT reached" }
    };
    Some(format!(
        "{OURS}, {name}: cells FVR / FIR ≤ {} / {} %, found {:.1} / {:.1}: {}; \
         objects from geometry-slice ≤ {:+} / {:+} points, found {:+.1} / {:+.1}: {}\n",
        goal.cells[0],
        goal.cells[1],
        cells[0],
        cells[1],
        said(cells, goal.cells),
        goal.objects_from_slice[0],
        goal.objects_from_slice[1],
        objects[0],
        objects[1],
        said(objects, goal.objects_from_slice)
    ))
}

fn objects(row: Option<&Row>) -> String {
    row.map_or_else(String::new, |r| format!("{} / {}", percent(r.counts.fvr()), percent(r.counts.fir())))
}

fn cells(row: Option<&Row>) -> String {
    row.map_or_else(String::new, |r| format!("{} / {}", percent(r.cell_fvr()), percent(r.cell_fir())))
}

fn from_slice(row: Option<&Row>) -> String {
    row.map_or_else(String::new, |r| {
        format!("{} / {}", signed(r.to_slice.fvr_points, None), signed(r.to_slice.fir_points, None))
    })
}

/// Difference to the better flat grid at equal FIR.
fn at_equal_fir(replay: &Replay, of: &str) -> String {
    let found = replay.summary.comparisons.iter().find(|c| c.of == of);
    found.map_or_else(|| "n/a".into(), |c| signed(Some(c.difference_points), c.difference_interval))
}

fn variants(counted: &[Counted], extent: Extent) -> String {
    let heading = [
        "counted",
        "objects\nFVR / FIR %",
        "from slice,\npoints",
        "cells\nFVR / FIR %",
        "objects at equal\nFIR, points",
        "cells at equal\nFIR, points",
    ];
    let row = |c: &Counted| {
        let ours = c.pooled.summary.row(OURS);
        vec![
            c.variant.name().to_owned(),
            objects(ours),
            from_slice(ours),
            cells(ours),
            at_equal_fir(&c.pooled, "objects"),
            at_equal_fir(&c.pooled, "cells"),
        ]
    };
    tables(&heading, &counted.iter().map(row).collect::<Vec<_>>(), 1, extent)
}

fn by_scene(counted: &[Counted], extent: Extent) -> String {
    let Some((main, beside)) = counted.split_first() else { return String::new() };
    let fixed = [
        "scene",
        "trajec-\ntories",
        "coverage\n%",
        "objects\nFVR / FIR %",
        "from slice,\npoints",
        "cells\nFVR / FIR %",
        "cells at equal\nFIR, points",
        "reference\ncells",
    ]
    .map(str::to_owned);
    let more = beside.iter().map(|c| format!("cells\n{}", c.variant.name()));
    let heading: Vec<String> = fixed.into_iter().chain(more).collect();
    let of = |(k, name): (usize, &str)| {
        let scene = main.scenes.get(k)?;
        let summary = &scene.summary;
        let ours = Some(summary.row(name)?);
        let fixed = [
            scene.recording.name.clone() + if name == OURS { "" } else { ", heights given" },
            summary.objects.to_string(),
            percent(summary.coverage_rate),
            objects(ours),
            from_slice(ours),
            cells(ours),
            if name == OURS { at_equal_fir(scene, "cells") } else { String::new() },
            cells(summary.row("reference")),
        ];
        let more = beside.iter().map(|c| cells(c.scenes.get(k).and_then(|s| s.summary.row(name))));
        Some(fixed.into_iter().chain(more).collect::<Vec<String>>())
    };
    let rows = (0..main.scenes.len()).flat_map(|k| [(k, OURS), (k, WITH_GROUND)]).filter_map(of);
    let heading: Vec<&str> = heading.iter().map(String::as_str).collect();
    tables(&heading, &rows.collect::<Vec<_>>(), 1, extent)
}

/// The file of `--json`: every way of counting, pooled and by scene; `beside` are recordings that were replayed too.
///
/// # Errors
/// None that a report can have.
pub fn json(
    title: &Title,
    plan: &Value,
    scenes: &[Scene],
    counted: &[Counted],
    beside: &[Report],
    options: Options,
) -> Result<String> {
    let of = |replay: &Replay| {
        let summary = &replay.summary;
        json!({
            "name": replay.recording.name,
            "frames": summary.frames,
            "objects": summary.objects,
            "coverage_rate": summary.coverage_rate,
            "estimators": summary.rows.iter().map(json::estimator).collect::<Vec<_>>(),
            "comparisons": summary.comparisons,
            "resampling": json::resampling(summary),
            "units": summary.unit_names,
        })
    };
    let variant = |c: &Counted| {
        json!({
            "counted": c.variant,
            "pooled": of(&c.pooled),
            "scenes": c.scenes.iter().map(of).collect::<Vec<_>>(),
        })
    };
    let all = json!({
        "scene": title.name,
        "set": title.set,
        "warm_up_s": title.warm_up_s,
        "every": title.every,
        "lanes_learnt": title.lanes_learnt,
        "variants": counted.iter().map(variant).collect::<Vec<_>>(),
        "scenes": scenes,
        "beside": beside,
        "plan": plan,
        "options": { "evaluation": options.evaluation, "estimators": options.estimators },
        "origin": ORIGIN,
    });
    Ok(serde_json::to_string_pretty(&all)? + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::pool::{Seconds, pool};
    use crate::evaluation::samples::by_hand::{frames, recording, sample};
    use crate::evaluation::score::by_hand::score;
    use crate::recording::Recording;

    #[test]
    fn a_goal_is_reached_where_both_rates_are() {
        let samples = frames((0..10).map(|k| vec![sample(0, 40.0, true, true), sample(1, 60.0, k > 4, false)]));
        let mut scored = score(OURS, &samples, |_| Some(255));
        scored.cells[0].add(false, true, Some(255));
        scored.cells[0].add(true, true, Some(255));
        let recording: Recording = recording(10, 2);
        let seconds = Seconds::new(recording, &samples, vec![scored]);
        let pooled = pool("p", &[&seconds], 0.0, &EvaluationOptions::default()).unwrap();
        // all visible: cells 100 / 0, objects 100 / 0 where geometry-slice has 0 / 33.3
        let goal = |cells, objects_from_slice| Goal { cells, objects_from_slice };
        let line = |g: Goal| reached("floor", &g, &pooled).unwrap();
        let all = line(goal([100.0, 0.0], [100.0, -33.0]));
        assert!(all.contains("found 100.0 / 0.0: reached") && all.contains("found +100.0 / -33.3: reached"), "{all}");
        let none = line(goal([99.0, 20.0], [200.0, -34.0]));
        assert_eq!(none.matches("NOT reached").count(), 2, "{none}");
    }
}

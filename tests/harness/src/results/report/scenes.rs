//! Crossings or queues as a table with what lies beside it, and as JSON.

use anyhow::Result;
use serde_json::{Value, json};

use super::experiment::{Spread, spread};
use super::json::{self, Options, Report};
use super::percent;
use super::table::{Extent, rates, signed, table, tables};
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
    text += &format!(
        "\nMeans over the scenes, each as much as the others (below: least and most of a scene):\n{}\n",
        means(main)
    );
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

/// A rate of a row.
type Rate = fn(&Row) -> Option<f64>;

/// What pooling hides: a scene with many cells hidden counts for more there than one with few.
fn means(main: &Counted) -> String {
    const RATES: [Rate; 4] = [|r| r.counts.fvr(), |r| r.counts.fir(), Row::cell_fvr, Row::cell_fir];
    let heading = ["estimator", "FVR %", "FIR %", "cell\nFVR %", "cell\nFIR %"];
    let row = |pooled: &Row| {
        let scenes = rows(main, &pooled.name);
        let rates = RATES.map(|rate| {
            let spread = Spread::of(scenes.iter().map(|r| rate(r)));
            percent(spread.map(|s| s.mean)) + &Spread::text(spread)
        });
        std::iter::once(pooled.name.clone()).chain(rates).collect()
    };
    table(&heading, main.pooled.summary.rows.iter().map(row)).to_string()
}

/// One estimator's rows, by scene.
fn rows<'a>(counted: &'a Counted, name: &str) -> Vec<&'a Row> {
    counted.scenes.iter().filter_map(|scene| scene.summary.row(name)).collect()
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
            cells(summary.row("true-boxes")),
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
    // what is pooled, and how far scenes lie apart
    let pooled = |c: &Counted| {
        let mut value = of(&c.pooled);
        let estimators = value["estimators"].as_array_mut().into_iter().flatten();
        for (estimator, row) in estimators.zip(&c.pooled.summary.rows) {
            estimator["spread"] = spread(&rows(c, &row.name));
        }
        value
    };
    let variant = |c: &Counted| {
        json!({
            "counted": c.variant,
            "pooled": pooled(c),
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
    use crate::evaluation::Settings;
    use crate::evaluation::pool::{Seconds, pool};
    use crate::evaluation::samples::made_up::{frames, recording, sample};
    use crate::evaluation::score::made_up::score;
    use crate::recording::Recording;
    use crate::studies::experiment::scenes::Variant;

    /// Two scenes of which all is called visible: of 4 and of 16 cells 1 is hidden.
    fn two_scenes() -> Counted {
        let options = EvaluationOptions::default();
        let of = |clear: u32| {
            let samples = frames((0..10).map(|k| vec![sample(0, 40.0, true, true), sample(1, 60.0, k > 4, false)]));
            let mut scored = score(OURS, &samples, |_| Some(255));
            scored.cells[0].add(false, true, Some(255));
            scored.cells[0].add(false, false, Some(0));
            // of those in sight one is called invisible
            scored.cells[0].add(true, false, Some(0));
            (1..clear).for_each(|_| scored.cells[0].add(true, true, Some(255)));
            Seconds::new(recording(10, 2), &samples, vec![scored])
        };
        let parts = [of(4), of(16)];
        let scenes = parts.iter().map(|part| pool("scene", &[part], 0.0, &options).unwrap()).collect();
        let pooled = pool("pooled", &[&parts[0], &parts[1]], 0.0, &options).unwrap();
        Counted { variant: Variant::Main, pooled, scenes }
    }

    #[test]
    fn beside_what_is_pooled_stand_the_mean_and_the_ends_of_its_scenes() {
        let counted = [two_scenes()];
        let title = Title {
            name: "queue",
            set: "reporting",
            warm_up_s: 0.0,
            every: 1,
            lanes_learnt: false,
            extent: Extent::Terminal,
        };
        let settings = Settings::default();
        let options =
            Options { reading: &settings.reading, evaluation: &settings.evaluation, estimators: &settings.estimators };
        let file: Value =
            serde_json::from_str(&json(&title, &Value::Null, &[], &counted, &[], options).unwrap()).unwrap();
        let pooled = &file["variants"][0]["pooled"]["estimators"][0];
        // 1 of 4 and 1 of 16: 2 of 20 together
        assert_eq!((&pooled["name"], &pooled["cell_fir"]), (&json!(OURS), &json!(0.1)));
        let of = |key: &str| ["min", "mean", "max"].map(|end| pooled["spread"][key][end].as_f64().unwrap());
        assert_eq!((of("cell_fir"), of("cell_fvr")), ([0.0625, 0.15625, 0.25], [0.5; 3]));
        assert_eq!((of("fvr"), of("fir")), ([1.0; 3], [0.0; 3]));
        assert!(file["variants"][0]["scenes"][0]["estimators"][0]["spread"].is_null());
        let table = means(&counted[0]);
        let row = table.lines().position(|line| line.contains(OURS)).unwrap();
        let cells = |line: usize| -> Vec<String> {
            table.lines().nth(line).unwrap().split(['│', '┆']).map(|cell| cell.trim().to_owned()).collect()
        };
        assert_eq!((&*cells(row)[5], &*cells(row + 1)[5]), ("15.6", "6.2–25.0"), "{table}");
    }

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

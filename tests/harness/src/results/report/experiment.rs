//! The experiment as a table beside the paper's, and as JSON.

use anyhow::Result;
use serde::Serialize;
use serde_json::{Value, json};

use super::json::{self, Options, Report};
use super::percent;
use super::table::{Extent, tables};
use super::{ORIGIN, notes};
use crate::evaluation::summary::Row;
use crate::studies::experiment::{DayResult, Experiment, PAPER, PAPER_COVERAGE, PAPER_TRAJECTORIES, Pooled, hidden};

/// Least, mean, greatest and standard deviation of a rate over the reporting days, or over scenes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    pub min: f64,
    pub mean: f64,
    pub max: f64,
    /// Of the sample (n - 1); `null` for one day.
    pub deviation: Option<f64>,
}

impl Spread {
    /// `None` without any value.
    pub fn of(values: impl IntoIterator<Item = Option<f64>>) -> Option<Self> {
        let values: Vec<f64> = values.into_iter().flatten().collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        (!values.is_empty()).then(|| Self {
            min: values.iter().copied().fold(f64::INFINITY, f64::min),
            mean,
            max: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            deviation: (values.len() > 1).then(|| (squares / (n - 1.0)).sqrt()),
        })
    }

    pub(super) fn text(spread: Option<Self>) -> String {
        spread.map_or_else(String::new, |s| format!("\n{:.1}–{:.1}", 100.0 * s.min, 100.0 * s.max))
    }
}

/// A rate of a row, and of what is pooled.
type Rate = (&'static str, fn(&Row) -> Option<f64>, fn(&Pooled) -> Option<f64>);

const RATES: [Rate; 6] = [
    ("tvr", |r| r.counts.tvr(), |p| p.counts.tvr()),
    ("fvr", |r| r.counts.fvr(), |p| p.counts.fvr()),
    ("tir", |r| r.counts.tir(), |p| p.counts.tir()),
    ("fir", |r| r.counts.fir(), |p| p.counts.fir()),
    ("cell_fvr", Row::cell_fvr, |p| p.cells.and_then(|c| c.fvr())),
    ("cell_fir", Row::cell_fir, |p| p.cells.and_then(|c| c.fir())),
];

/// The whole experiment as text.
pub fn text(experiment: &Experiment, extent: Extent) -> String {
    let days = experiment.reporting.len();
    format!(
        "{days} reporting days of one scene, pooled (below: least and most of a day); beside them the paper's figures\n{}\n{}{}\n{}\n{}\n",
        comparison(experiment, extent),
        expectations(experiment),
        at_equal_fir(experiment),
        by_day(experiment, extent),
        closing(experiment)
    )
}

fn comparison(experiment: &Experiment, extent: Extent) -> String {
    let heading = [
        "estimator",
        "TVR %",
        "FVR %",
        "TIR %",
        "FIR %",
        "cell\nFVR %",
        "cell\nFIR %",
        "the paper's",
        "TVR",
        "FVR",
        "FIR",
    ];
    let of_paper = |name: &str| -> [String; 4] {
        PAPER.iter().find(|p| p.ours == name).map_or_else(Default::default, |p| {
            [p.name.to_owned(), format!("{:.0}", p.tvr), format!("{:.0}", p.fvr), format!("{:.0}", p.fir)]
        })
    };
    let ours = experiment.pooled.iter().map(|p| {
        let rows = experiment.rows(&p.name);
        let rates = RATES.map(|(_, of_row, of_pooled)| {
            percent(of_pooled(p)) + &Spread::text(Spread::of(rows.iter().map(|r| of_row(r))))
        });
        std::iter::once(p.name.clone()).chain(rates).chain(of_paper(&p.name)).collect()
    });
    let missing = PAPER.iter().filter(|p| experiment.pooled(p.ours).is_none()).map(|p| {
        let not_here = vec!["–".to_owned(); RATES.len()];
        std::iter::once(p.ours.to_owned()).chain(not_here).chain(of_paper(p.ours)).collect()
    });
    tables(&heading, &ours.chain(missing).collect::<Vec<_>>(), 1, extent)
}

/// What the rebuilt experiment is expected to reach, and whether it does.
fn expectations(experiment: &Experiment) -> String {
    let expected = PAPER.iter().filter(|p| ["radar-3d", "true-boxes"].contains(&p.ours));
    let lines = expected.filter_map(|p| {
        let counts = experiment.pooled(p.ours)?.counts;
        let (fvr, fir) = (counts.fvr()?, counts.fir()?);
        let reached = 100.0 * fvr <= p.fvr && 100.0 * fir <= p.fir;
        Some(format!(
            "{}: expected FVR ≤ {:.0} and FIR ≤ {:.0}, found {} and {}: {}",
            p.ours,
            p.fvr,
            p.fir,
            percent(Some(fvr)),
            percent(Some(fir)),
            if reached { "reached" } else { "NOT reached" }
        ))
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// How the flat grids fare where they call as much invisible as `radar-3d`, day by day.
fn at_equal_fir(experiment: &Experiment) -> String {
    let comparisons = || experiment.reporting.iter().flat_map(|d| &d.replay.summary.comparisons);
    let line = |of: &str| {
        let points: Vec<f64> = comparisons().filter(|c| c.of == of).map(|c| c.difference_points).collect();
        let [least, most] = [
            points.iter().copied().fold(f64::INFINITY, f64::min),
            points.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        ];
        format!(
            "\nAt equal FIR of {of}, FVR of radar-3d less that of the better of radar-2d and radar-2d-first: \
             {least:+.1} to {most:+.1} points by day."
        )
    };
    ["objects", "cells"].into_iter().filter(|of| comparisons().any(|c| c.of == *of)).map(line).collect()
}

fn by_day(experiment: &Experiment, extent: Extent) -> String {
    let heading =
        ["day", "seed", "trajectories", "coverage %", "hidden %", "radar-3d\nFVR / FIR", "reference\nFVR / FIR"];
    let row = |result: &DayResult, remark: &str| {
        let summary = &result.replay.summary;
        let pair = |name: &str| {
            let counts = summary.row(name).map(|r| r.counts).unwrap_or_default();
            format!("{} / {}", percent(counts.fvr()), percent(counts.fir()))
        };
        vec![
            result.day.name() + remark,
            result.day.seed.to_string(),
            summary.objects.to_string(),
            percent(summary.coverage_rate),
            percent(result.hidden()),
            pair("radar-3d"),
            pair("true-boxes"),
        ]
    };
    let training = std::iter::once(row(&experiment.training, " (training, not pooled)"));
    let rows = training.chain(experiment.reporting.iter().map(|r| row(r, "")));
    tables(&heading, &rows.collect::<Vec<_>>(), 1, extent)
}

fn closing(experiment: &Experiment) -> String {
    let of_box = experiment.pooled(crate::evaluation::bounds::BOX).and_then(|p| hidden(&p.counts));
    format!(
        "All reporting days: {} trajectories in {} frames, coverage {} %, {} % of object-steps hidden (geometry-box).\n\
         The paper: {PAPER_TRAJECTORIES} trajectories in 60 s, coverage {PAPER_COVERAGE} %.\n\n{ORIGIN}",
        experiment.trajectories(),
        experiment.frames(),
        percent(experiment.coverage()),
        percent(of_box)
    )
}

/// One recording replayed beside the experiment: the same rows.
pub fn beside(replay: &crate::evaluation::replay::Replay) -> String {
    format!("{}\n{}\n", notes::heading(replay), super::table::rates(&replay.summary, Extent::Wide))
}

/// One reporting day with everything `replay --json` has.
#[derive(Serialize)]
struct OfDay {
    day: String,
    seed: u64,
    hidden_rate: Option<f64>,
    #[serde(flatten)]
    report: Report,
}

/// How far each rate goes from one to another of what is pooled: days, or scenes.
pub(super) fn spread(rows: &[&Row]) -> Value {
    let of = |(name, of_row, _): Rate| (name.to_owned(), json!(Spread::of(rows.iter().map(|r| of_row(r)))));
    Value::Object(RATES.into_iter().map(of).collect())
}

/// The file of `--json`; `beside` are recordings that were replayed too.
pub fn json(experiment: &Experiment, beside: &[Report], plan: &Value, options: Options) -> Result<String> {
    let day = |result: &DayResult| OfDay {
        day: result.day.name(),
        seed: result.day.seed,
        hidden_rate: result.hidden(),
        report: json::report(&result.replay, None, &[], options),
    };
    let estimator = |p: &Pooled| {
        let rows = experiment.rows(&p.name);
        let mut value = json!(json::rates(&p.counts));
        if let Value::Object(map) = &mut value {
            map.insert("name".into(), json!(p.name));
            map.insert("cell_fvr".into(), json!(p.cells.and_then(|c| c.fvr())));
            map.insert("cell_fir".into(), json!(p.cells.and_then(|c| c.fir())));
            map.insert("cells".into(), json!(p.cells));
            map.insert("spread".into(), spread(&rows));
        }
        value
    };
    let of_box = experiment.pooled(crate::evaluation::bounds::BOX);
    let all = json!({
        "frames": experiment.frames(),
        "objects": experiment.trajectories(),
        "coverage_rate": experiment.coverage(),
        "hidden_rate": of_box.and_then(|p| hidden(&p.counts)),
        "estimators": experiment.pooled.iter().map(estimator).collect::<Vec<_>>(),
        "paper": { "rows": PAPER, "objects": PAPER_TRAJECTORIES, "coverage_percent": PAPER_COVERAGE },
        "seeds": experiment.reporting.iter().map(day).collect::<Vec<_>>(),
        "training": day(&experiment.training),
        "beside": beside,
        "plan": plan,
        "origin": ORIGIN,
    });
    Ok(serde_json::to_string_pretty(&all)? + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_is_of_the_sample_and_leaves_out_what_is_not_applicable() {
        let spread = Spread::of([Some(0.2), None, Some(0.4)]).unwrap();
        assert!((spread.mean - 0.3).abs() < 1e-12 && (spread.deviation.unwrap() - 0.02_f64.sqrt()).abs() < 1e-12);
        assert_eq!((spread.min, spread.max), (0.2, 0.4));
        assert_eq!(Spread::text(Some(spread)), "\n20.0–40.0");
        assert_eq!(Spread::of([Some(0.5)]).unwrap().deviation, None);
        assert_eq!(Spread::of([None]), None);
    }
}

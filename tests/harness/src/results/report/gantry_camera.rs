//! The camera's experiment as a table beside the paper's row, and as JSON.

use anyhow::Result;
use serde_json::{Value, json};

use super::json::{self as replay_json, Options};
use super::table::{Extent, tables};
use super::{ORIGIN, percent};
use crate::evaluation::counts::rate;
use crate::evaluation::summary::Row;
use crate::studies::experiment::PAPER;
use crate::studies::experiment::gantry_camera::{Detected, SetResult};

const OWN: &str = "camera-3d";
const REFERENCE: &str = "camera-true-boxes";

/// The experiment as text.
pub fn text(sets: &[SetResult], extent: Extent) -> String {
    let mut text = String::new();
    for result in sets {
        let Some(first) = result.detected.first() else { continue };
        let summary = &first.pooled.summary;
        text += &format!(
            "{}: {} days, {} frames, {} trajectories, {} % heavy\n{}\n",
            result.set.name,
            result.set.day.len(),
            summary.frames,
            summary.objects,
            percent(Some(result.heavy)),
            rows(result, extent)
        );
        text += &format!("FVR by cause, camera-3d:\n{}\n", causes(result, extent));
        text += &format!(
            "camera-3d by the share of the column that has to be seen, {}:\n{}\n\n",
            first.detector.name,
            curve(first, extent)
        );
    }
    let paper = PAPER.iter().find(|p| p.ours == OWN);
    let paper =
        paper.map(|p| format!("The paper's {}: TVR {:.0}, FVR {:.0}, FIR {:.0}.\n", p.name, p.tvr, p.fvr, p.fir));
    text + &paper.unwrap_or_default() + &format!("\n{ORIGIN}\n")
}

fn rows(result: &SetResult, extent: Extent) -> String {
    let heading = [
        "detector",
        "estimator",
        "TVR %",
        "FVR %",
        "FIR %",
        "cell\nFVR %",
        "cell\nFIR %",
        "D = 0\nsteps",
        "coverage\n%",
    ];
    let row = |detected: &Detected, row: &Row| {
        let c = row.counts;
        vec![
            detected.detector.name.to_owned(),
            row.name.clone(),
            percent(c.tvr()),
            percent(c.fvr()),
            percent(c.fir()),
            percent(row.cell_fvr()),
            percent(row.cell_fir()),
            (c.fv + c.ti).to_string(),
            percent(c.coverage()),
        ]
    };
    let rows = result.detected.iter().flat_map(|d| d.pooled.summary.rows.iter().map(move |r| row(d, r)));
    tables(&heading, &rows.collect::<Vec<_>>(), 2, extent)
}

/// Shares of the steps at which nothing was found.
fn causes(result: &SetResult, extent: Extent) -> String {
    let heading = [
        "detector",
        "nothing shows,\nits column does",
        "less than\n30 % shows",
        "more shows,\nmissed",
        "what hides it was\nmissed or misplaced",
        "FVR %",
    ];
    let row = |d: &Detected| {
        let counts = d.pooled.summary.row(OWN).map(|r| r.counts).unwrap_or_default();
        let of = |n: u64| percent(rate(n, counts.fv + counts.ti));
        let c = d.causes;
        vec![
            d.detector.name.to_owned(),
            of(c.hidden),
            of(c.little),
            of(c.missed),
            of(c.occluder),
            percent(counts.fvr()),
        ]
    };
    tables(&heading, &result.detected.iter().map(row).collect::<Vec<_>>(), 1, extent)
}

/// Grade from which a share of the column is seen.
fn grade(share: f64) -> u16 {
    (share * 254.0).round() as u16 + 1
}

fn curve(detected: &Detected, extent: Extent) -> String {
    let shares = [0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];
    let at = |share: f64| {
        let curve = detected.pooled.summary.row(OWN).map(|r| r.curve.as_slice()).unwrap_or_default();
        // the curve has a point where it moves
        curve.iter().filter(|p| p.threshold <= grade(share)).max_by_key(|p| p.threshold)
    };
    let heading: Vec<String> = ["share".to_owned()].into_iter().chain(shares.map(|s| format!("{s:.1}"))).collect();
    let line = |name: &str, of: fn(f64, f64) -> f64| {
        let rates = shares.map(|s| percent(at(s).map(|p| of(p.fvr, p.fir))));
        [name.to_owned()].into_iter().chain(rates).collect::<Vec<_>>()
    };
    let heading: Vec<&str> = heading.iter().map(String::as_str).collect();
    tables(&heading, &[line("FVR %", |fvr, _| fvr), line("FIR %", |_, fir| fir)], 1, extent)
}

/// The file of `--json`.
///
/// # Errors
/// None that a caller could mend.
pub fn json(sets: &[SetResult], plan: &Value, options: Options) -> Result<String> {
    let detected = |d: &Detected| {
        json!({
            "detector": d.detector,
            "undetected_steps": d.pooled.summary.row(OWN).map(|r| r.counts.fv + r.counts.ti),
            "fvr_causes": d.causes,
            "pooled": replay_json::report(&d.pooled, None, &[], options),
        })
    };
    let set = |s: &SetResult| {
        json!({
            "name": s.set.name,
            "heavy_share": s.heavy,
            "detectors": s.detected.iter().map(detected).collect::<Vec<_>>(),
        })
    };
    let all = json!({
        "sets": sets.iter().map(set).collect::<Vec<_>>(),
        "paper": PAPER.iter().find(|p| p.ours == OWN),
        "reference": REFERENCE,
        "plan": plan,
        "origin": ORIGIN,
    });
    Ok(serde_json::to_string_pretty(&all)? + "\n")
}

//! Two sensors alone and fused, as tables and as JSON.

use anyhow::Result;
use serde_json::{Value, json};

use super::json::{self as replay_json, Options};
use super::table::{Extent, tables};
use super::{ORIGIN, percent};
use crate::evaluation::bounds::SLICE;
use crate::evaluation::summary::Row;
use crate::studies::experiment::monitoring::Alerts;
use crate::studies::experiment::several_sensors::{Counted, Shown};

/// The experiment as text.
pub fn text(all: &[Counted], extent: Extent) -> String {
    let mut text = String::new();
    let shown = if extent == Extent::Wide { all } else { &all[..all.len().min(1)] };
    for counted in shown {
        let Some((_, fused)) = counted.rows.last() else { continue };
        let summary = &fused.summary;
        text += &format!(
            "{}: {} frames, {} trajectories\n{}\nOn the road that either looks at:\n{}\n\nEach watched by the other, in order, and with a third of its \
             view dark:\n{}\n\n",
            counted.name,
            summary.frames,
            summary.objects,
            rates(counted, extent),
            road(counted, extent),
            watched(counted, extent)
        );
    }
    if all.len() > 1 {
        text += &format!("By site, fused:\n{}\n", by_site(&all[1..], extent));
    }
    text + &format!("\n{ORIGIN}\n")
}

fn rates(counted: &Counted, extent: Extent) -> String {
    let heading = ["", "TVR %", "FVR %", "FIR %", "cell\nFVR %", "cell\nFIR %", "coverage\n%"];
    let row = |name: &str, row: &Row| {
        let c = row.counts;
        let rates = [c.tvr(), c.fvr(), c.fir(), row.cell_fvr(), row.cell_fir(), c.coverage()];
        [name.to_owned()].into_iter().chain(rates.map(percent)).collect::<Vec<_>>()
    };
    let rows = counted.rows.iter().flat_map(|(name, replay)| {
        let own = replay.summary.rows.first().map(|own| row(name, own));
        own.into_iter().chain(replay.summary.row(SLICE).map(|bound| row("  exact geometry", bound)))
    });
    tables(&heading, &rows.collect::<Vec<_>>(), 1, extent)
}

fn road(counted: &Counted, extent: Extent) -> String {
    let heading = ["", "objects\ndetected %", "road not\nseen %", "road not\nin sight %"];
    let row = |((name, _), s): (&(String, _), &Shown)| {
        let shares = [s.coverage(), s.hidden(), s.truly_hidden()];
        [name.clone()].into_iter().chain(shares.map(percent)).collect::<Vec<_>>()
    };
    let rows: Vec<Vec<String>> = counted.rows.iter().zip(&counted.shown).map(row).collect();
    tables(&heading, &rows, 1, extent)
}

fn watched(counted: &Counted, extent: Extent) -> String {
    let heading = [
        "a miss counts",
        "sectors\ndark",
        "named",
        "within\n10 s",
        "after s,\nmean",
        "slowest\ns",
        "wrong alerts\nan hour",
    ];
    let number = |v: Option<f64>| v.map_or_else(|| "n/a".into(), |v| format!("{v:.1}"));
    let row = |(name, a): (&str, &Alerts)| {
        let mean = (a.named > 0).then(|| a.named_after_s / a.named as f64);
        let slowest = (a.named > 0).then_some(a.slowest_s);
        let counts = [a.dark, a.named, a.within_10_s].map(|n| n.to_string());
        let rest = [mean, slowest, a.wrong_per_hour()].map(number);
        [name.to_owned()].into_iter().chain(counts).chain(rest).collect::<Vec<_>>()
    };
    let names = ["where its map says visible", "wherever it looks"];
    let rows: Vec<Vec<String>> = names.into_iter().zip(&counted.watched).map(row).collect();
    tables(&heading, &rows, 1, extent)
}

fn by_site(sites: &[Counted], extent: Extent) -> String {
    let heading = [
        "",
        "TVR %",
        "FVR %",
        "FIR %",
        "cell\nFVR %",
        "cell\nFIR %",
        "road not seen %,\neach alone",
        "fused",
        "detected %,\neach alone",
        "fused",
    ];
    let row = |site: &Counted| {
        let fused = site.rows.last().and_then(|(_, replay)| replay.summary.rows.first());
        let rates = fused.map(|r| [r.counts.tvr(), r.counts.fvr(), r.counts.fir(), r.cell_fvr(), r.cell_fir()]);
        let pair = |of: fn(&Shown) -> Option<f64>| {
            let shares: Vec<String> = site.shown.iter().map(|s| percent(of(s))).collect();
            let (fused, alone) =
                shares.split_last().map_or((String::new(), String::new()), |(f, a)| (f.clone(), a.join(", ")));
            [alone, fused]
        };
        let rates = rates.unwrap_or_default().map(percent);
        let shown = pair(Shown::hidden).into_iter().chain(pair(Shown::coverage));
        [site.name.clone()].into_iter().chain(rates).chain(shown).collect::<Vec<_>>()
    };
    tables(&heading, &sites.iter().map(row).collect::<Vec<_>>(), 1, extent)
}

/// The file of `--json`.
///
/// # Errors
/// None that a caller could mend.
pub fn json(all: &[Counted], plan: &Value, options: Options) -> Result<String> {
    let site = |counted: &Counted| {
        let rows = counted.rows.iter().zip(&counted.shown).map(|((name, replay), shown)| {
            json!({"name": name, "report": replay_json::report(replay, None, &[], options), "on_the_road_of_either": shown})
        });
        let [with, without] = counted.watched;
        let watched = json!({"with_visibility": with, "without": without});
        json!({"name": counted.name, "rows": rows.collect::<Vec<_>>(), "watched": watched})
    };
    let all = json!({ "sites": all.iter().map(site).collect::<Vec<_>>(), "plan": plan, "origin": ORIGIN });
    Ok(serde_json::to_string_pretty(&all)? + "\n")
}

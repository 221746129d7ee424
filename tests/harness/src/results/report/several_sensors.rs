//! Two sensors alone and fused, as tables and as JSON.

use anyhow::Result;
use serde_json::{Value, json};

use super::json::Options;
use super::sensor_set;
use super::table::{Extent, tables};
use super::{ORIGIN, percent};
use crate::evaluation::sensor_set::Shown;
use crate::studies::experiment::monitoring::Alerts;
use crate::studies::experiment::monitoring::standing::Stood;
use crate::studies::experiment::monitoring::turned::Turned;
use crate::studies::experiment::several_sensors::{Counted, Watched};

/// The experiment as text.
pub fn text(all: &[Counted], extent: Extent) -> String {
    let mut text = String::new();
    let shown = if extent == Extent::Wide { all } else { &all[..all.len().min(1)] };
    for counted in shown {
        if let Some(set) = &counted.set {
            text += &format!("{}\n\n", sensor_set::text(set, extent));
        } else {
            text += &format!("{}\n\n", counted.name);
        }
        text += &format!(
            "Each watched by the others, in order, and with a third of its view dark:\n{}\n\nMounts turned by a degree:\n{}\n\n\
             What stands in a radar's view, by itself:\n{}\n\n",
            blind(counted, extent),
            turned(&counted.watched.turned, extent),
            standing(&counted.watched.standing, extent)
        );
    }
    if all.len() > 1 && all.iter().all(|counted| counted.set.is_some()) {
        text += &format!("By site, fused:\n{}\n", by_site(&all[1..], extent));
    }
    text + &format!("\n{ORIGIN}\n")
}

fn number(v: Option<f64>) -> String {
    v.map_or_else(|| "n/a".into(), |v| format!("{v:.1}"))
}

/// Mean of so many.
fn mean(sum: f64, n: u64) -> Option<f64> {
    (n > 0).then(|| sum / n as f64)
}

/// So many in an hour.
fn per_hour(n: u64, seconds: f64) -> Option<f64> {
    (seconds > 0.0).then(|| n as f64 * 3600.0 / seconds)
}

fn turned(t: &Turned, extent: Extent) -> String {
    let heading = [
        "turned",
        "pair\nnamed",
        "within\n30 s",
        "after s,\nmean",
        "slowest\ns",
        "a third\ncould tell",
        "told\nrightly",
        "others\nblamed",
        "in order: pairs\nan hour",
        "sensors\nan hour",
    ];
    let counts = [t.turned, t.pairs, t.within_30_s].map(|n| n.to_string());
    let times = [mean(t.named_after_s, t.pairs), mean(t.slowest_s, t.pairs.min(1))].map(number);
    let judged = [t.judged, t.rightly, t.wrongly].map(|n| n.to_string());
    let wrong = [per_hour(t.wrong_pairs, t.compared_s), per_hour(t.wrong_sensors, t.compared_s)].map(number);
    let row: Vec<String> = counts.into_iter().chain(times).chain(judged).chain(wrong).collect();
    tables(&heading, &[row], 0, extent)
}

fn standing(s: &Stood, extent: Extent) -> String {
    let heading = ["", "cases", "named", "within\n10 s", "after s,\nmean", "at dB,\nmean", "in order: alerts\nan hour"];
    let counts = |n: [u64; 2]| n.map(|n| n.to_string());
    let row = |name: String, n: [u64; 2], rest: [String; 4]| -> Vec<String> {
        [name].into_iter().chain(counts(n)).chain(rest).collect()
    };
    let none = String::new;
    let dark = [s.within_10_s.to_string(), number(mean(s.dark_after_s, s.dark_named)), none(), none()];
    let turned = [none(), number(mean(s.turned_after_s, s.turned_named)), none(), none()];
    let dirt = [none(), none(), number(mean(s.dirty_at_db, s.dirty_named)), none()];
    let order = [none(), none(), none(), number(per_hour(s.wrong, s.watched_s))];
    let rows = [
        row("sectors dark".into(), [s.dark, s.dark_named], dark),
        row("radars turned by a degree".into(), [s.turned, s.turned_named], turned),
        row("radars with dirt".into(), [s.dirty, s.dirty_named], dirt),
        row(format!("radars in order, {} fixtures", s.fixtures), [s.radars, s.wrong], order),
    ];
    tables(&heading, &rows, 1, extent)
}

fn blind(counted: &Counted, extent: Extent) -> String {
    let heading = [
        "a miss counts",
        "sectors\ndark",
        "named",
        "within\n10 s",
        "after s,\nmean",
        "slowest\ns",
        "wrong alerts\nan hour",
    ];
    let row = |(name, a): (&str, &Alerts)| {
        let mean = mean(a.named_after_s, a.named);
        let slowest = (a.named > 0).then_some(a.slowest_s);
        let counts = [a.dark, a.named, a.within_10_s].map(|n| n.to_string());
        let rest = [mean, slowest, per_hour(a.wrong, a.watched_s)].map(number);
        [name.to_owned()].into_iter().chain(counts).chain(rest).collect::<Vec<_>>()
    };
    let names = ["where its map says visible", "wherever it looks"];
    let rows: Vec<Vec<String>> = names.into_iter().zip(&counted.watched.blind).map(row).collect();
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
        let set = site.set.as_ref();
        let fused = set.and_then(|set| set.rows.last()).and_then(|(_, replay)| replay.summary.rows.first());
        let rates = fused.map(|r| [r.counts.tvr(), r.counts.fvr(), r.counts.fir(), r.cell_fvr(), r.cell_fir()]);
        let pair = |of: fn(&Shown) -> Option<f64>| {
            let shares: Vec<String> = set.into_iter().flat_map(|set| &set.shown).map(|s| percent(of(s))).collect();
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
        let Watched { blind: [with, without], turned, standing } = counted.watched;
        let watched = json!({"with_visibility": with, "without": without, "turned": turned, "standing": standing});
        let mut site =
            counted.set.as_ref().map_or_else(|| json!({ "name": counted.name }), |set| sensor_set::json(set, options));
        site["watched"] = watched;
        site
    };
    let all = json!({ "sites": all.iter().map(site).collect::<Vec<_>>(), "plan": plan, "origin": ORIGIN });
    Ok(serde_json::to_string_pretty(&all)? + "\n")
}

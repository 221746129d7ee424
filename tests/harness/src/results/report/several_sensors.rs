//! Two sensors alone and fused, as tables and as JSON.

use anyhow::Result;
use serde_json::{Value, json};

use super::json::Options;
use super::sensor_set;
use super::table::{Extent, tables};
use super::{ORIGIN, percent};
use crate::evaluation::sensor_set::Shown;
use crate::studies::experiment::monitoring::turned::Turned;
use crate::studies::experiment::monitoring::{Finding, Judge, Judged, Sight};
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
            "Each sensor in order, and with faults that come while it runs:\n{}\n{}\n\nMounts turned by a degree from the first \
             day on:\n{}\n\n",
            judged(&counted.watched.judged, extent),
            told(&counted.watched.judged),
            turned(&counted.watched.turned, extent)
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

fn judged(j: &Judged, extent: Extent) -> String {
    let heading = [
        "what is wrong",
        "judged by",
        "cases",
        "named",
        "in time",
        "after s,\nmean",
        "slowest\ns",
        "wrong alerts\nin order",
        "an hour",
        "without visibility:\nnamed",
        "in time",
        "wrong",
    ];
    let faults = ["a third of the view dark", "turned by a degree", "tilted by a degree", "10 dB of dirt"];
    let judges = ["other sensors", "what stands", "either"];
    let mut rows = Vec::new();
    for (finding, fault) in Finding::ALL.into_iter().zip(faults) {
        for (judge, by) in Judge::ALL.into_iter().zip(judges) {
            // of tilts and dirt only one can tell
            if matches!(finding, Finding::Tilted | Finding::Weaker) && judge != Judge::Standing {
                continue;
            }
            let [with, without] = Sight::ALL.map(|sight| j.of(finding, judge, sight));
            let in_order_s = if judge == Judge::Standing { j.radars_s } else { j.sensors_s };
            let counts = |n: &[u64]| n.iter().map(ToString::to_string).collect::<Vec<_>>();
            let times = [mean(with.after_s, with.named), (with.named > 0).then_some(with.slowest_s)].map(number);
            let row = [fault.to_owned(), by.to_owned()]
                .into_iter()
                .chain(counts(&[with.cases, with.named, with.in_time]))
                .chain(times)
                .chain([with.wrong.to_string(), number(per_hour(with.wrong, in_order_s))])
                .chain(counts(&[without.named, without.in_time, without.wrong]));
            rows.push(row.collect::<Vec<_>>());
        }
    }
    tables(&heading, &rows, 2, extent)
}

/// What the table is of.
fn told(j: &Judged) -> String {
    let [others, standing, either] = j.could_tell;
    let dirt = j.of(Finding::Weaker, Judge::Standing, Sight::With).named;
    format!(
        "In time: within 10 s, and 30 s of mounts and dirt. Thirds with anything to tell by: other sensors {others}, what \
         stands {standing}, either {either}. {} fixtures of {} radars. Dirt when named: {} dB. In order: {:.0} minutes of sensors.",
        j.fixtures,
        j.radars,
        number(mean(j.dirt_db, dirt)),
        j.sensors_s / 60.0
    )
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
        let Watched { judged, turned } = counted.watched;
        let watched = json!({ "while_it_runs": judged, "from_the_first_day": turned });
        let mut site =
            counted.set.as_ref().map_or_else(|| json!({ "name": counted.name }), |set| sensor_set::json(set, options));
        site["watched"] = watched;
        site
    };
    let all = json!({ "sites": all.iter().map(site).collect::<Vec<_>>(), "plan": plan, "origin": ORIGIN });
    Ok(serde_json::to_string_pretty(&all)? + "\n")
}

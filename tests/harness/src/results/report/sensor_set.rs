//! A set of sensors, each alone and fused, as tables and as JSON.

use serde_json::{Value, json};

use super::json::{self as replay_json, Options};
use super::percent;
use super::table::{Extent, tables};
use crate::estimators::fused::FUSED;
use crate::evaluation::bounds::SLICE;
use crate::evaluation::sensor_set::{SensorSet, Shown};
use crate::evaluation::summary::Row;

/// The tables.
pub fn text(set: &SensorSet, extent: Extent) -> String {
    let Some((_, fused)) = set.rows.last() else { return String::new() };
    let summary = &fused.summary;
    format!(
        "{}: {} frames, {} trajectories\n{}\nOn the road that any of them looks at:\n{}",
        set.name,
        summary.frames,
        summary.objects,
        rates(set, extent),
        road(set, extent)
    )
}

/// The same for machines.
pub fn json(set: &SensorSet, options: Options) -> Value {
    let rows = set.rows.iter().zip(&set.shown).map(|((name, replay), shown)| {
        json!({"name": name, "report": replay_json::report(replay, None, &[], options), "on_the_road_of_any": shown})
    });
    json!({"name": set.name, "rows": rows.collect::<Vec<_>>()})
}

fn rates(set: &SensorSet, extent: Extent) -> String {
    let heading = ["", "TVR %", "FVR %", "FIR %", "cell\nFVR %", "cell\nFIR %", "coverage\n%"];
    let row = |name: &str, row: &Row| {
        let c = row.counts;
        let rates = [c.tvr(), c.fvr(), c.fir(), row.cell_fvr(), row.cell_fir(), c.coverage()];
        [name.to_owned()].into_iter().chain(rates.map(percent)).collect::<Vec<_>>()
    };
    let rows = set.rows.iter().flat_map(|(name, replay)| {
        let own = replay.summary.rows.first().map(|own| row(name, own));
        own.into_iter().chain(replay.summary.row(SLICE).map(|bound| row("  exact geometry", bound)))
    });
    tables(&heading, &rows.collect::<Vec<_>>(), 1, extent)
}

fn road(set: &SensorSet, extent: Extent) -> String {
    let heading = ["", "objects\ndetected %", "by it\nonly %", "road not\nseen %", "road not\nin sight %"];
    let row = |((name, _), s): (&(String, _), &Shown)| {
        let adds = s.adds().filter(|_| name != FUSED);
        let shares = [s.coverage(), adds, s.hidden(), s.truly_hidden()];
        [name.clone()].into_iter().chain(shares.map(percent)).collect::<Vec<_>>()
    };
    let rows: Vec<Vec<String>> = set.rows.iter().zip(&set.shown).map(row).collect();
    tables(&heading, &rows, 1, extent)
}

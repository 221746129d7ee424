//! Mounts and sets of mounts, best first, as tables and as JSON.

use anyhow::Result;
use serde_json::{Value, json};

use super::ORIGIN;
use super::percent;
use super::table::{Extent, tables};
use crate::studies::site::sets::{Rank, Ranked};
use crate::studies::site::{Search, Site};
use crate::twin::scene::Mount;

/// `y -14 m, h 6 m, yaw 10°, pitch 4°`, with the place along the road where it is not 0.
pub fn name(mount: &Mount) -> String {
    let along = if mount.x_m == 0.0 { String::new() } else { format!("x {} m, ", mount.x_m) };
    format!("{along}y {} m, h {} m, yaw {}°, pitch {}°", mount.y_m, mount.height_m, mount.yaw_deg, mount.pitch_deg)
}

/// The tables: single mounts, then sets of each size, the first `top` of each.
pub fn text(site: &Site, ranked: &[Vec<Ranked>], top: usize) -> String {
    let mut text = format!(
        "{} candidate mounts, {} instants; shares are of {} vehicle-steps and of {:.0} m² of road free of vehicles\n",
        site.candidates.len(),
        site.instants,
        site.object_steps,
        site.cell_steps as f64 / site.instants as f64
    );
    for (k, sets) in ranked.iter().enumerate().filter(|(_, sets)| !sets.is_empty()) {
        let more = if sets.len() > top { format!(", the first {top} of {}", sets.len()) } else { String::new() };
        text += &match k {
            0 => format!("\nOne sensor, best first{more}:\n{}\n", singles(site, sets, top)),
            _ => format!("\nSets of {}, best first{more}:\n{}\n", k + 1, several(site, sets, top)),
        };
    }
    for out in &site.left_out {
        text += &format!("left out: {}: {}\n", name(&out.mount), out.reason);
    }
    text
}

fn singles(site: &Site, sets: &[Ranked], top: usize) -> String {
    let heading = [
        "",
        "height\nm",
        "along\nm",
        "across\nm",
        "yaw\n°",
        "pitch\n°",
        "vehicles\ndetected %",
        "road in\nsight %",
        "coverage in\nown view %",
    ];
    let rows = sets.iter().take(top).enumerate().map(|(k, set)| {
        let candidate = &site.candidates[set.members[0]];
        let m = &candidate.mount;
        let figures = [m.height_m, m.x_m, m.y_m, m.yaw_deg, m.pitch_deg].map(|v| v.to_string());
        let shares = [Some(set.detected[0]), Some(set.road[0]), candidate.coverage_rate()].map(percent);
        std::iter::once((k + 1).to_string()).chain(figures).chain(shares).collect()
    });
    tables(&heading, &rows.collect::<Vec<_>>(), 6, Extent::Terminal)
}

fn several(site: &Site, sets: &[Ranked], top: usize) -> String {
    let heading = ["", "mounts", "vehicles\nby one %", "vehicles\nby two %", "road\nby one %", "road\nby two %"];
    let rows = sets.iter().take(top).enumerate().map(|(k, set)| {
        let names: Vec<String> = set.members.iter().map(|&m| name(&site.candidates[m].mount)).collect();
        let shares = [set.detected[0], set.detected[1], set.road[0], set.road[1]].map(|v| percent(Some(v)));
        [(k + 1).to_string(), names.join("\n")].into_iter().chain(shares).collect()
    });
    tables(&heading, &rows.collect::<Vec<_>>(), 2, Extent::Terminal)
}

/// The file of `--json`: `candidates` and `sets`, best first.
pub fn json(site: &Site, ranked: &[Vec<Ranked>], search: &Search, by: Rank, options: &Value) -> Result<String> {
    let mounts = |set: &Ranked| set.members.iter().map(|&m| site.candidates[m].mount).collect::<Vec<_>>();
    let candidate = |set: &Ranked| {
        json!({
            "mount": mounts(set).first(),
            "vehicles_share": set.detected[0],
            "coverage_rate": site.candidates[set.members[0]].coverage_rate(),
            "road_share": set.road[0],
            "road_m2": set.road[0] * site.cell_steps as f64 / site.instants as f64,
        })
    };
    let of_set = |set: &Ranked| {
        json!({
            "mounts": mounts(set),
            "vehicles_by_one": set.detected[0],
            "vehicles_by_two": set.detected[1],
            "road_by_one": set.road[0],
            "road_by_two": set.road[1],
        })
    };
    let (singles, sets) = ranked.split_first().map_or((&[][..], &[][..]), |(first, rest)| (&first[..], rest));
    let all = json!({
        "candidates": singles.iter().map(candidate).collect::<Vec<_>>(),
        "sets": sets.iter().flatten().map(of_set).collect::<Vec<_>>(),
        "left_out": site.left_out,
        "ranked_by": by,
        "instants": site.instants,
        "vehicle_steps": site.object_steps,
        "road_cells": site.cells.len(),
        "road_cell_steps": site.cell_steps,
        "search": { "every_s": search.every_s, "stretch_m": search.stretch_m },
        "evaluation": options,
        "origin": ORIGIN,
    });
    Ok(serde_json::to_string_pretty(&all)? + "\n")
}

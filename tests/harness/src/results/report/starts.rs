//! What starts and gaps do to a map, as text.

use super::percent;
use super::table::table;
use crate::studies::starts::{Outcome, Second};

/// Seconds after a start or gap that stand in a line together.
const BANDS: [(usize, usize); 8] = [(0, 1), (1, 2), (2, 3), (3, 5), (5, 8), (8, 15), (15, 30), (30, 60)];

const HEADING: [&str; 7] =
    ["seconds after", "FVR known %", "running", "FVR %", "clear visible %", "running", "blocked known %"];

const LEGEND: &str = "FVR known: of the blocked road cells that are known, the share called visible; FVR: of all blocked ones (unknown is not \
visible).\nClear visible: of the clear road cells, the share called visible. Blocked known: of the blocked ones, the share that is known.\n\
Running: the unit that has run since the recording began, in the same seconds.\n";

/// A table for each kind.
pub fn text(outcomes: &[Outcome]) -> String {
    let mut text = String::new();
    for outcome in outcomes {
        let kind = outcome.gap_s.map_or_else(|| "starts".to_owned(), |s| format!("gaps of {s} s"));
        let bands = BANDS.iter().filter(|(from, _)| *from < outcome.seconds.len());
        let rows = bands.map(|&(from, to)| {
            let to = to.min(outcome.seconds.len());
            row(&format!("{from} to {to}"), &outcome.between(from, to))
        });
        let all = row("all", &outcome.between(0, outcome.seconds.len()));
        text += &format!("\n{} {kind}\n{}\n", outcome.times, table(&HEADING, rows.chain([all])));
    }
    text + LEGEND
}

fn row(name: &str, second: &Second) -> Vec<String> {
    let Second { after, running } = second;
    let rates = [
        after.fvr_of_known(),
        running.fvr_of_known(),
        after.fvr(),
        after.clear_visible(),
        running.clear_visible(),
        after.blocked_known(),
    ];
    std::iter::once(name.to_owned()).chain(rates.into_iter().map(percent)).collect()
}

//! Two runs side by side: their rates, differences and intervals, as a table and as JSON.

use anyhow::Result;
use serde::Serialize;

use super::notes::blocks;
use super::percent;
use super::table::{Extent, signed, tables};
use crate::evaluation::paired::Difference;

/// One estimator on one recording (or pool of them).
#[derive(Debug, Clone, Serialize)]
pub struct Compared {
    pub of: String,
    pub estimator: String,
    pub units: usize,
    pub blocks: usize,
    pub differences: Vec<Difference>,
}

/// As text, a table for each of what was run.
pub fn text(all: &[Compared], extent: Extent) -> String {
    let mut text = String::new();
    let mut begun = 0;
    while let Some(first) = all.get(begun) {
        let same = all[begun..].iter().take_while(|c| c.of == first.of).count();
        let heading = ["estimator", "rate", "before %", "after %", "difference,\npoints", ""];
        let rows = all[begun..begun + same].iter().flat_map(|c| {
            c.differences.iter().filter(|d| d.before.is_some() || d.after.is_some()).enumerate().map(|(k, d)| {
                let name = if k == 0 { c.estimator.clone() } else { String::new() };
                let difference = signed(d.points, d.interval);
                vec![name, d.rate.into(), percent(d.before), percent(d.after), difference, d.verdict().into()]
            })
        });
        let cells = if first.blocks == 0 { String::new() } else { format!("; cells: {}", blocks(first.blocks)) };
        text += &format!("{} ({} tracks or frames{cells})\n", first.of, first.units);
        text += &(tables(&heading, &rows.collect::<Vec<_>>(), 2, extent) + "\n");
        begun += same;
    }
    text + "Below 0 the second file is better. Intervals of 95 % from the same tracks, and for cells the same runs of seconds, of both.\n\
            At crossings any change, even one that alters nothing, can move a single scene by 10 points of FVR and 3 of cell FVR:\n\
            judge it by several scenes or seeds together.\n"
}

/// The file of `--json`.
///
/// # Errors
/// None that a comparison can have.
pub fn json(all: &[Compared]) -> Result<String> {
    Ok(serde_json::to_string_pretty(all)? + "\n")
}

//! The table of probabilities that the configuration names, for a unit with these settings; or why it is not used.

#[path = "../../../tests/harness/src/evaluation/probability/table_file.rs"]
mod table_file;

use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use viewshed::Settings;
use viewshed::probability::{ProbabilityTable, Quantiser, Threshold};

/// Which table, and what of it is called visible.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Given {
    /// As `viewshed experiment --calibration --tables` writes it.
    pub file: PathBuf,
    /// Share of the vehicles in what is called visible that may be missed. Without it, visible is by grades.
    pub risk: Option<f64>,
}

/// A table that fits the unit.
pub struct Table {
    table: ProbabilityTable,
    threshold: Option<Threshold>,
}

impl Given {
    /// What is wrong with it by itself: the key within its table, and why.
    pub fn problem(&self) -> Option<(&'static str, &'static str)> {
        let share = |risk: &f64| *risk > 0.0 && *risk < 1.0;
        self.risk.filter(|risk| !share(risk)).map(|_| ("risk", "not between 0 and 1: 0.1 is 10 %"))
    }

    /// Reads the table, for a unit on the reference grid or another.
    ///
    /// # Errors
    /// The file, and what is wrong with it: cut off, damaged, not monotone, of another configuration.
    pub fn read(&self, on_reference: bool, settings: &Settings) -> Result<Table> {
        let read = || -> Result<Table> {
            ensure!(on_reference, "tables are fitted on grid = \"reference\"");
            let text = std::fs::read_to_string(&self.file)?;
            let (table, counted) = table_file::parse(&text)?;
            let threshold = self.risk.map(|risk| Threshold::keeping(risk, &counted));
            // what watches the radar changes no grade
            let unit = Settings { fixtures: None, ..*settings }.fingerprint();
            Ok(Table { table: table.of_unit(unit)?, threshold })
        };
        read().with_context(|| format!("probability.file: {}", self.file.display()))
    }
}

impl Table {
    /// What becomes of a map whose cells are visible from this grade on where nothing else is asked for.
    pub fn quantiser(self, visible_from: u8) -> Quantiser {
        Quantiser::new(self.table, self.threshold, visible_from)
    }

    /// In words.
    pub fn said(&self) -> String {
        let sum = self.table.check_sum();
        match self.threshold {
            Some(threshold) => format!("table of probabilities {sum:08x}, visible is {threshold}"),
            None => format!("table of probabilities {sum:08x}, visible is by grades"),
        }
    }
}

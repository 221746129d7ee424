//! `--probability` and `--risk`: a row of the table whose bits keep a risk.

use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use viewshed::map::polar::PolarGeometry;
use viewshed::probability::Quantiser;

use crate::estimators::at_risk::{AtRisk, NAME};
use crate::estimators::{self, Estimator};
use crate::evaluation::Settings;
use crate::evaluation::counts::rate;
use crate::evaluation::probability::file::Fitted;
use crate::evaluation::probability::risk::keeping;
use crate::evaluation::probability::samples::fingerprint;
use crate::evaluation::replay::Replay;
use crate::recording::Recording;
use crate::results::report::percent;

/// What a unit of a recording makes of a table, and where the cells of its maps lie.
///
/// # Errors
/// A table of another mount or configuration.
pub fn quantiser(
    fitted: Fitted,
    risk: Option<f64>,
    recording: &Recording,
    settings: &Settings,
) -> Result<(Quantiser, PolarGeometry)> {
    let table = fitted.table.of_unit(fingerprint(recording, &settings.estimators)?);
    let table = table.with_context(|| format!("--probability: {}", recording.name))?;
    let (grid, visible_from) = estimators::own_grid(recording, &settings.estimators)?;
    let threshold = risk.map(|risk| keeping(risk, &fitted.counted));
    Ok((Quantiser::new(table, threshold, visible_from), grid))
}

/// A risk and the table it is judged by.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Probability")]
pub struct RiskArgs {
    /// Table of this unit's probabilities, NAME.probability.toml of `viewshed experiment --calibration --tables`
    ///
    /// It is of one mount and one configuration, and refused with others.
    #[arg(long, value_name = "FILE", requires = "risk")]
    probability: Option<PathBuf>,
    /// Add a row radar-3d-risk: visible is where at most this share of vehicles is missed, above 0 to below 1
    ///
    /// Of the vehicles that stand where the map says visible, the share that the radar does not detect. This is not the
    /// FVR, which is of those that were not detected.
    #[arg(long, value_name = "SHARE", requires = "probability", value_parser = share)]
    risk: Option<f64>,
}

pub fn share(text: &str) -> Result<f64, String> {
    let value = super::finite(text)?;
    if value > 0.0 && value < 1.0 { Ok(value) } else { Err(format!("{value} is not between 0 and 1: 0.1 is 10 %")) }
}

impl RiskArgs {
    /// The table's file, if there is one.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        self.probability.clone().into_iter()
    }

    fn asked(&self) -> Result<Option<(f64, Fitted)>> {
        let read = |(path, risk): (&PathBuf, f64)| Ok((risk, Fitted::read(path)?));
        self.probability.as_ref().zip(self.risk).map(read).transpose()
    }

    /// The estimators of the table: this row is behind that of `radar-3d`.
    ///
    /// # Errors
    /// A table that cannot be read, or of another mount or configuration; a recording of no radar.
    pub fn estimators(&self, recording: &Recording, settings: &Settings) -> Result<Vec<Box<dyn Estimator>>> {
        let mut running = estimators::all(recording, &settings.estimators)?;
        let Some((risk, fitted)) = self.asked()? else { return Ok(running) };
        ensure!(recording.of_camera().is_none(), "--risk: {} is of a camera; tables are of radars", recording.name);
        let (quantiser, grid) = quantiser(fitted, Some(risk), recording, settings)?;
        let inner = estimators::own(recording, &settings.estimators)?;
        let place = running.iter().position(|e| e.name() == inner.name()).map_or(running.len(), |k| k + 1);
        running.insert(place, Box::new(AtRisk::new(inner, quantiser, grid)));
        Ok(running)
    }

    /// What was asked, and what it came to on this recording.
    ///
    /// # Errors
    /// Those of reading the table.
    pub fn told(&self, replay: &Replay) -> Result<String> {
        let Some((risk, fitted)) = self.asked()? else { return Ok(String::new()) };
        let threshold = keeping(risk, &fitted.counted);
        let counts = replay.summary.row(NAME).map(|row| row.counts).unwrap_or_default();
        let found = rate(counts.fv, counts.tv + counts.fv);
        let share = rate(counts.tv + counts.fv, counts.total());
        Ok(format!(
            "{NAME}, asked for a risk of {}: visible is {threshold}. Here {} % of what it calls visible was missed, and it calls {} % visible.\n",
            percent(Some(risk)) + " %",
            percent(found),
            percent(share)
        ))
    }
}

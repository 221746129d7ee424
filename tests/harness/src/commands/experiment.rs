//! `viewshed experiment`: the paper's experiment on the digital twin, the paper's table out.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use serde_json::json;

use super::progress::bar;
use super::replay::shipped;
use super::{print, write_file};
use crate::evaluation::replay::{Replay, steps};
use crate::experiment::plan::{Day, Plan};
use crate::experiment::{Experiment, total_steps};
use crate::options::JudgingArgs;
use crate::report::{experiment as report, json as replay_json};
use crate::{estimators, recording};

/// Estimators that run, for the progress bar.
const ESTIMATORS: u64 = 4;

/// Repeat the paper's experiment on the digital twin and print its table beside ours
///
/// 60 s of a motorway of 3 + 3 lanes with dense traffic and many trucks, a radar on a gantry at 6 m looking along
/// the direction of travel. Scene, days and seeds stand in a file that was fixed before any estimator ran on it;
/// what is tuned is tuned on its training day or elsewhere, and only the reporting days count. Their counts are
/// pooled, and beside every rate stands its least and greatest day.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Experiment file [default: tests/recordings/experiment.toml]
    #[arg(value_name = "PLAN")]
    plan: Option<PathBuf>,
    /// Write everything as JSON: `estimators` pooled over the reporting days, `seeds` with the same by day
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    json: Option<PathBuf>,
    /// Keep the simulated recordings in this folder, DAY.mcap each
    #[arg(long, value_name = "DIR", help_heading = "Results")]
    keep: Option<PathBuf>,
    /// Print the same rows for these recordings too; may be repeated
    #[arg(long, value_name = "RECORDING", help_heading = "Results")]
    beside: Vec<PathBuf>,
    #[command(flatten)]
    judging: JudgingArgs,
}

/// Simulates, replays, prints.
///
/// # Errors
/// A plan, scene, traffic or recording that cannot be used, a file that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode> {
    let settings = args.judging.settings()?;
    let path = match &args.plan {
        Some(path) => path.clone(),
        None => shipped::file("experiment.toml")?,
    };
    let plan = Plan::read(&path)?;
    if let Some(folder) = &args.keep {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    }
    let keep = |day: &Day, bytes: &[u8]| {
        let Some(folder) = &args.keep else { return Ok(()) };
        let file = folder.join(format!("{}.mcap", day.name()));
        std::fs::write(&file, bytes).with_context(|| format!("cannot write {}", file.display()))
    };
    let running = bar("simulating and replaying", total_steps(&plan, ESTIMATORS)?);
    let experiment = Experiment::run(&plan, &settings, &keep, &|| running.step())?;
    drop(running);
    print(&report::text(&experiment))?;
    let options = replay_json::Options {
        reading: &settings.reading,
        evaluation: &settings.evaluation,
        estimators: &settings.estimators,
    };
    let mut beside = Vec::new();
    for path in &args.beside {
        let replay = replay(path, &settings)?;
        print(&format!("\n{}", report::beside(&replay)))?;
        beside.push(replay_json::report(&replay, None, &[], options));
    }
    if let Some(file) = &args.json {
        let plan = json!({ "file": path.display().to_string(), "content": plan });
        write_file(file, &report::json(&experiment, &beside, &plan, options)?)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn replay(path: &Path, settings: &crate::options::Settings) -> Result<Replay> {
    let recording = recording::read(path, &settings.reading).with_context(|| path.display().to_string())?;
    let mut running = estimators::all(&recording, &settings.estimators)?;
    let replaying = bar(&format!("replaying {}", recording.name), steps(&recording, running.len()));
    Ok(Replay::new(recording, &mut running, &settings.evaluation, &|| replaying.step()))
}

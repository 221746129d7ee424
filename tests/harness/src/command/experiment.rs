//! `viewshed experiment`: the paper's experiment on the digital twin, the paper's table out.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use serde_json::json;

use super::print;
use super::progress::bar;
use super::replay::shipped;
use crate::command::options::JudgingArgs;
use crate::evaluation::replay::{Replay, steps};
use crate::results::files::{OutputArgs, Outputs, Target};
use crate::results::report::{experiment as report, json as replay_json};
use crate::studies::experiment::plan::{Day, Plan};
use crate::studies::experiment::{Experiment, total_steps};
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
    outputs: OutputArgs,
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
    let mut outputs = args.outputs.beside(args.beside.iter().flat_map(|path| recording::files(path)));
    outputs.reads(args.judging.files().chain([path.clone()]).chain(plan.files()?));
    let json_file = outputs.file("--json", args.json.as_deref())?;
    let kept = args.keep.as_deref().map(|folder| kept(folder, &plan, &mut outputs)).transpose()?.unwrap_or_default();
    let keep = |day: &Day, bytes: &[u8]| kept.get(&day.name()).map_or(Ok(()), |file| file.write(bytes));
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
    if let Some(file) = json_file {
        let plan = json!({ "file": path.display().to_string(), "content": plan });
        file.write(report::json(&experiment, &beside, &plan, options)?)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The recording of each day. They are worth more than pictures: what exists needs `--force`.
fn kept(folder: &Path, plan: &Plan, outputs: &mut Outputs) -> Result<BTreeMap<String, Target>> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let days = plan.days().map(Day::name);
    let file = |day: String| {
        let path = folder.join(format!("{day}.mcap"));
        Ok(outputs.file("--keep", Some(&path))?.map(|target| (day, target)))
    };
    Ok(days.map(file).collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
}

fn replay(path: &Path, settings: &crate::evaluation::Settings) -> Result<Replay> {
    let recording = recording::read(path, &settings.reading).with_context(|| path.display().to_string())?;
    let mut running = estimators::all(&recording, &settings.estimators)?;
    let replaying = bar(&format!("replaying {}", recording.name), steps(&recording, running.len()));
    Ok(Replay::new(recording, &mut running, &settings.evaluation, &|| replaying.step()))
}

//! `viewshed starts`: how far the map can be trusted after a start and after a gap; tables out.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use serde_json::json;

use super::options::{JudgingArgs, ReadingArgs};
use super::progress::bar;
use super::{print, told_problems};
use crate::recording;
use crate::results::files::OutputArgs;
use crate::results::report::starts as report;
use crate::studies::starts::{self, Outcome, Plan};

/// How far the map can be trusted after a start in the middle of traffic, and after a gap between frames
///
/// Each recording with labels is replayed from several moments on, as if the unit had been switched on there, and with gaps
/// of several lengths before them. Of the seconds after, tables say which share of the blocked road cells is called visible,
/// of those that are known and of all, and which share of the clear ones; beside it stands the unit that has run since
/// the recording began, in the same seconds. Recordings are pooled.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings with labels
    #[arg(value_name = "RECORDING", required = true)]
    recordings: Vec<PathBuf>,
    /// Starts, and gaps of each length, in each recording
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    times: u16,
    /// Lengths of the gaps, in seconds
    #[arg(long, value_name = "SECONDS", default_value = "2,10", value_delimiter = ',', num_args = 0..)]
    gaps: Vec<f64>,
    /// How long the unit beside it has run, at least, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 30)]
    run_in: u16,
    /// How long is judged after each, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 15, value_parser = clap::value_parser!(u16).range(1..=600))]
    watch: u16,
    /// Write all counts, second by second, as JSON
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    json: Option<PathBuf>,
    #[command(flatten)]
    outputs: OutputArgs,
    #[command(flatten)]
    judging: JudgingArgs,
    #[command(flatten)]
    reading: ReadingArgs,
}

/// Replays, judges and prints.
///
/// # Errors
/// A recording that cannot be judged, and a file that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode> {
    let mut settings = args.judging.settings()?;
    settings.reading = args.reading.options();
    // what comes first is just what is looked at
    settings.evaluation.warm_up_s = 0.0;
    let plan = Plan {
        times: usize::from(args.times),
        gaps_s: args.gaps.clone(),
        run_in_s: f64::from(args.run_in),
        watched_s: usize::from(args.watch),
    };
    let longest = f64::from(args.run_in);
    for gap in &plan.gaps_s {
        ensure!(
            *gap > 0.0 && *gap <= longest,
            "--gaps {gap}: a gap is longer than 0 s and no longer than --run-in, {longest} s"
        );
    }
    let mut outputs = args.outputs.beside(args.recordings.iter().flat_map(|path| recording::files(path)));
    let json_file = outputs.file("--json", args.json.as_deref())?;
    let mut pooled: Vec<Outcome> = Vec::new();
    for path in &args.recordings {
        let recording = recording::read(path, &settings.reading).with_context(|| path.display().to_string())?;
        told_problems(&recording);
        let running = bar(&format!("starting in {}", recording.name), starts::steps(&plan));
        let outcomes = starts::run(&recording, &plan, &settings, &|| running.step())?;
        drop(running);
        if pooled.is_empty() {
            pooled = outcomes;
        } else {
            pooled.iter_mut().zip(&outcomes).for_each(|(all, one)| all.add(one));
        }
    }
    print(&report::text(&pooled))?;
    if let Some(file) = json_file {
        let names: Vec<String> = args.recordings.iter().map(|path| path.display().to_string()).collect();
        file.write(serde_json::to_vec_pretty(&json!({ "recordings": names, "plan": plan, "outcomes": pooled }))?)?;
    }
    print(&outputs.told())?;
    Ok(ExitCode::SUCCESS)
}

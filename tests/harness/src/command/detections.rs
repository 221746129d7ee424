//! `viewshed detections`: how rich recordings are, object by object, against range.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use serde_json::json;

use super::print;
use super::progress::bar;
use super::replay::shipped;
use crate::command::options::SettingsArgs;
use crate::evaluation::Settings;
use crate::evaluation::returns::{Group, Returns};
use crate::evaluation::samples;
use crate::recording;
use crate::results::files::OutputArgs;
use crate::results::pictures;
use crate::results::report::table::table;

/// Count detections per object against distance, and plot recordings over each other
///
/// For vehicles with a line of sight: how many detections a radar has of each, cars and vans apart from trucks and
/// buses. Put a real recording beside a simulated one (--real) to see how far the simulation is from it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// MCAP recordings with labels [default: those shipped in tests/recordings]
    #[arg(value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// A real recording that the others are compared with; without it there is no comparison
    #[arg(long, value_name = "RECORDING")]
    real: Option<PathBuf>,
    /// Plot as PNG
    #[arg(long, value_name = "FILE.png", help_heading = "Results")]
    out: Option<PathBuf>,
    /// Write medians and quartiles as JSON
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    json: Option<PathBuf>,
    #[command(flatten)]
    outputs: OutputArgs,
    #[command(flatten)]
    settings: SettingsArgs,
}

/// Stretches of the table, metres.
const STRETCHES: [[f64; 2]; 5] = [[12.5, 25.0], [25.0, 50.0], [50.0, 100.0], [100.0, 150.0], [150.0, 200.0]];

/// Counts, prints, plots.
///
/// # Errors
/// A recording that cannot be read or has no labels, a file that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode> {
    let settings = args.settings.settings()?;
    let paths = if args.recordings.is_empty() { shipped::recordings()? } else { args.recordings.clone() };
    settings.reading.check_for(paths.len())?;
    let mut outputs = args.outputs.beside(paths.iter().chain(&args.real).flat_map(|path| recording::files(path)));
    outputs.reads(args.settings.files());
    let picture = outputs.picture("--out", args.out.as_deref())?;
    let json = outputs.file("--json", args.json.as_deref())?;
    let all = paths.iter().chain(&args.real).map(|path| returns(path, &settings)).collect::<Result<Vec<_>>>()?;
    print(&text(&all, args.real.is_some()))?;
    if let Some(file) = picture {
        let caption = "Lines are medians, bands quartiles, of objects with a line of sight to some part of their box.";
        pictures::returns::draw(&all, caption).save(&file)?;
    }
    if let Some(file) = json {
        let real = args.real.as_ref().and_then(|_| all.last()).map(|r| &r.recording);
        file.write(serde_json::to_string_pretty(&json!({ "recordings": all, "real": real }))? + "\n")?;
    }
    print(&outputs.told())?;
    Ok(ExitCode::SUCCESS)
}

fn returns(path: &Path, settings: &Settings) -> Result<Returns> {
    let recording = recording::read(path, &settings.reading).with_context(|| path.display().to_string())?;
    ensure!(recording.truth.is_some(), "{}: no labelled objects, so nothing to count by", path.display());
    let counting = bar(&format!("counting {}", recording.name), recording.frames.len() as u64);
    let samples = samples::collect(&recording, &settings.evaluation, &|| counting.step());
    drop(counting);
    Ok(Returns::new(&recording, &samples))
}

fn text(all: &[Returns], compared: bool) -> String {
    let mut text = String::from("Median number of detections of an object in sight, by its distance in metres:\n");
    let headings: Vec<String> = STRETCHES.iter().map(|[from, to]| format!("{from}–{to}")).collect();
    let heading: Vec<&str> = ["recording", "objects"].into_iter().chain(headings.iter().map(String::as_str)).collect();
    let number = |v: Option<f64>| v.map_or_else(|| "–".into(), |v| format!("{v:.1}"));
    let rows = all.iter().flat_map(|r| {
        let of = move |group: Group| {
            let medians = STRETCHES.map(|s| number(r.median(group, s)));
            [r.recording.clone(), group.name().to_owned()].into_iter().chain(medians).collect()
        };
        let ratio = STRETCHES.map(|s| {
            let [light, heavy] = Group::ALL.map(|g| r.median(g, s));
            number(heavy.zip(light.filter(|l| *l > 0.0)).map(|(h, l)| h / l))
        });
        let ratio = [r.recording.clone(), "heavy to light".to_owned()].into_iter().chain(ratio).collect();
        [of(Group::Light), of(Group::Heavy), ratio]
    });
    text += &format!("{}\n", table(&heading, rows));
    let Some((real, simulated)) = all.split_last().filter(|_| compared) else {
        return text + "No real recording was given (--real FILE): nothing is compared.\n";
    };
    for r in simulated {
        for group in Group::ALL {
            let shares = STRETCHES.iter().filter_map(|s| {
                let (own, theirs) = (r.median(group, *s)?, real.median(group, *s).filter(|v| *v > 0.0)?);
                Some(format!("{:.0} % at {}–{} m", 100.0 * own / theirs, s[0], s[1]))
            });
            let shares: Vec<String> = shares.collect();
            if !shares.is_empty() {
                text += &format!(
                    "{}: of {} it has, of {}'s detections, {}.\n",
                    r.recording,
                    group.name(),
                    real.recording,
                    shares.join(", ")
                );
            }
        }
        text += &format!(
            "{}: {:.0} detections a frame in all, {}: {:.0}.\n",
            r.recording, r.detections_a_frame, real.recording, real.detections_a_frame
        );
    }
    text
}

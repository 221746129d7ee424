//! `viewshed site`: where to mount a radar, or several.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use serde_json::json;

use super::print;
use super::progress::bar;
use crate::command::options::JudgingArgs;
use crate::results::files::OutputArgs;
use crate::results::pictures;
use crate::results::report::site as report;
use crate::studies::site::sets::Rank;
use crate::studies::site::{Search, Site, grid};
use crate::twin::scene::Scene;

/// Try mounts for the scene's radar over simulated traffic: which one sees how much, which sets see most
///
/// Every combination of the listed heights, places, yaws and pitches is a candidate. All of them measure the same
/// traffic; counted are the vehicles each detects, and the road in its sight past all vehicles and barriers, as
/// shares of what any candidate could have in its field of view. Best come first: one sensor, then sets of them,
/// seen by at least one and by at least two.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Scene file; its radar is the one that is mounted, its mount gives whatever is not listed
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Traffic in place of the scene's own
    #[arg(long, value_name = "FILE")]
    fcd: Option<PathBuf>,
    /// Heights above the road, in metres
    #[arg(long, value_name = "LIST", default_value = "4,6,8", value_parser = List::parse, allow_hyphen_values = true, help_heading = "Candidates")]
    height: List,
    /// Places across the road, in metres to the left of its x axis; lists are 1,2,3 or FROM:TO:STEP
    #[arg(long, value_name = "LIST", default_value = "-15,0,15", value_parser = List::parse, allow_hyphen_values = true, help_heading = "Candidates")]
    lateral: List,
    /// Places along the road, in metres [default: the scene's]
    #[arg(long, value_name = "LIST", value_parser = List::parse, allow_hyphen_values = true, help_heading = "Candidates")]
    along: Option<List>,
    /// Yaws, in degrees to the left
    #[arg(long, value_name = "LIST", default_value = "-10,0,10", value_parser = List::parse, allow_hyphen_values = true, help_heading = "Candidates")]
    yaw: List,
    /// Pitches, in degrees nose down
    #[arg(long, value_name = "LIST", default_value = "2,6", value_parser = List::parse, allow_hyphen_values = true, help_heading = "Candidates")]
    pitch: List,
    /// Largest set of sensors that is tried, 1 to 4
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=4))]
    sensors: u8,
    /// What comes first
    #[arg(long, value_enum, default_value_t = Rank::Vehicles)]
    rank: Rank,
    /// Time between the instants that are looked at, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, allow_negative_numbers = true)]
    every: f64,
    /// Only vehicles and road between these places along the road count, in metres: FROM,TO
    #[arg(long, value_name = "FROM,TO", value_parser = stretch, allow_hyphen_values = true)]
    stretch: Option<[f64; 2]>,
    /// Rows of each table
    #[arg(long, value_name = "N", default_value_t = 10, help_heading = "Results")]
    top: usize,
    /// Heat maps and the road as the best see it, as PNG
    #[arg(long, value_name = "FILE.png", help_heading = "Results")]
    out: Option<PathBuf>,
    /// Write all candidates and the first 1000 sets of each size as JSON, best first
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    json: Option<PathBuf>,
    #[command(flatten)]
    outputs: OutputArgs,
    #[command(flatten)]
    judging: JudgingArgs,
}

/// Sets of one size that go into the JSON.
const SETS_TOLD: usize = 1000;

/// Tries, ranks, prints.
///
/// # Errors
/// A scene, traffic or list that cannot be used, a file that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode> {
    let settings = args.judging.settings()?;
    ensure!(args.every >= 0.05 && args.every <= 3600.0, "--every {} is outside 0.05 to 3600 s", args.every);
    let scene = Scene::read(&args.scene)?;
    let mut outputs = args.outputs.beside(scene.files(args.fcd.as_deref())?.into_iter().chain([args.scene.clone()]));
    outputs.reads(args.judging.files());
    let picture = outputs.picture("--out", args.out.as_deref())?;
    let json_file = outputs.file("--json", args.json.as_deref())?;
    let base = scene.radar.mount;
    let along = args.along.clone().unwrap_or(List(vec![base.x_m]));
    let lists = [&args.height, &along, &args.lateral, &args.yaw, &args.pitch].map(|l| &l.0[..]);
    let search = Search { mounts: grid(&base, lists)?, every_s: args.every, stretch_m: args.stretch };
    let title = format!("{}: {} on {} mounts", scene.name, scene.radar.name, search.mounts.len());
    let trying = bar("trying mounts", search.mounts.len() as u64);
    let site = Site::search(scene, args.fcd.as_deref(), &search, &settings.evaluation, &|| trying.step())?;
    drop(trying);
    let mut ranked: Vec<_> = (1..=usize::from(args.sensors)).map(|size| site.ranked(size, args.rank)).collect();
    print(&report::text(&site, &ranked, args.top))?;
    if let Some(file) = picture {
        pictures::site::draw(&site, &ranked, &title).save(&file)?;
    }
    if let Some(file) = json_file {
        ranked.iter_mut().skip(1).for_each(|sets| sets.truncate(SETS_TOLD));
        file.write(report::json(&site, &ranked, &search, args.rank, &json!(settings.evaluation))?)?;
    }
    print(&outputs.told())?;
    Ok(ExitCode::SUCCESS)
}

/// Numbers to be tried.
#[derive(Debug, Clone, PartialEq)]
struct List(Vec<f64>);

impl List {
    /// `1,2,3` or `FROM:TO:STEP`, both ends included.
    fn parse(text: &str) -> Result<Self> {
        const MOST: usize = 200;
        let number = |t: &str| {
            let value = t.trim().parse::<f64>().ok().filter(|v| v.is_finite());
            value.with_context(|| format!("`{t}` is no number"))
        };
        let parts: Vec<&str> = text.split(':').collect();
        let values = match parts[..] {
            [from, to, step] => {
                let (from, to, step) = (number(from)?, number(to)?, number(step)?);
                ensure!(step > 0.0 && to >= from, "`{text}`: the step must be positive and lead from {from} to {to}");
                let count = ((to - from) / step + 1e-9).floor();
                ensure!(count < MOST as f64, "`{text}` has more than {MOST} values");
                (0..=count as usize).map(|k| from + k as f64 * step).collect()
            }
            [list] => list.split(',').map(number).collect::<Result<Vec<_>>>()?,
            _ => anyhow::bail!("`{text}` is neither a list 1,2,3 nor FROM:TO:STEP"),
        };
        Ok(Self(values))
    }
}

fn stretch(text: &str) -> Result<[f64; 2]> {
    let List(values) = List::parse(text)?;
    match values[..] {
        [from, to] if from < to => Ok([from, to]),
        _ => anyhow::bail!("`{text}` is not FROM,TO with FROM below TO"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_values_or_ranges_with_both_ends() {
        assert_eq!(List::parse("-4,0.5").unwrap().0, [-4.0, 0.5]);
        assert_eq!(List::parse("-15:15:15").unwrap().0, [-15.0, 0.0, 15.0]);
        assert_eq!(List::parse("0:1:0.1").unwrap().0.len(), 11);
        for wrong in ["", "a", "1:2", "2:1:1", "1:2:0", "0:1:1e-9", "nan"] {
            assert!(List::parse(wrong).is_err(), "{wrong}");
        }
        assert_eq!(stretch("-5,120").unwrap(), [-5.0, 120.0]);
        assert!(stretch("5,1").is_err() && stretch("5").is_err());
    }
}

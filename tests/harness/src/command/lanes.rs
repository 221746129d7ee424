//! `viewshed lanes`: which way traffic goes, learnt from recordings or read from a SUMO net.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use viewshed::obstacles::lanes::{MOST_LANES, MOST_SEGMENTS};

use super::options::ReadingArgs;
use super::progress::bar;
use super::{print, told_problems};
use crate::estimators::{self, Lane};
use crate::labels::lanes::{self, segments};
use crate::recording::{self, Recording};
use crate::twin::traffic::frame::RoadFrame;
use crate::twin::traffic::net::{self, Reach};

/// Lanes of a site as the tables [[lanes]] of a daemon's file, learnt from recordings or read from a SUMO net
///
/// At a crossing a radar's speeds alone do not tell where a vehicle heads. With lanes the estimator knows from the first
/// frame. Of a file for `replay` and `experiment` the tables are [[estimators.lanes]]:
///
///   viewshed lanes monday.mcap --table estimators.lanes > lanes.toml
///   viewshed replay tuesday.mcap --config lanes.toml
///
/// Recordings of one radar in one place show where vehicles drive: a minute or two with traffic on every lane are
/// enough. Judge the lanes on other recordings than they are learnt from. In a net, lanes of walkers, bicycles and rails
/// are left out.
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Recordings of the site, or a net NAME.net.xml, plain or gzip
    ///
    /// Of a map, `netconvert --osm-files map.osm.xml -o map.net.xml` makes a net.
    #[arg(value_name = "RECORDING|NET", required = true)]
    sources: Vec<PathBuf>,
    /// Name of the tables
    #[arg(long, value_name = "NAME", default_value = "lanes", value_parser = table_name)]
    table: String,
    #[command(flatten)]
    net: NetArgs,
    #[command(flatten)]
    reading: ReadingArgs,
}

/// Where a net's coordinates lie.
#[derive(Debug, Default, clap::Args)]
#[command(next_help_heading = "Of a net")]
struct NetArgs {
    /// Origin of the road coordinates in those of the net, without the offset the net says, in metres: X,Y [default: 0,0]
    #[arg(long, value_name = "X,Y", value_parser = pair, allow_hyphen_values = true)]
    origin: Option<[f64; 2]>,
    /// Direction of the road's x axis from east, counter-clockwise, in degrees [default: 0]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    heading: Option<f64>,
    /// Place of the radar in road coordinates, in metres: X,Y [default: 0,0]
    #[arg(long, value_name = "X,Y", value_parser = pair, allow_hyphen_values = true)]
    at: Option<[f64; 2]>,
    /// Range of the radar, in metres [default: 200]
    #[arg(long, value_name = "METRES")]
    range: Option<f64>,
}

/// A lane and, of one that was learnt, how many vehicles drove there.
type Counted = (Lane, Option<usize>);

fn pair(text: &str) -> Result<[f64; 2], String> {
    let numbers: Vec<f64> =
        text.split(',').filter_map(|v| v.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    <[f64; 2]>::try_from(numbers).map_err(|_| "not two numbers X,Y".into())
}

/// A name of a TOML table that needs no quotes: words between points.
fn table_name(text: &str) -> Result<String, String> {
    let is_word = |word: &str| {
        !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-'))
    };
    if text.split('.').all(is_word) {
        Ok(text.to_owned())
    } else {
        Err("a table's name is of letters, digits, _ and -, with points between its parts: estimators.lanes".into())
    }
}

/// Reads, learns and prints.
///
/// # Errors
/// A source that cannot be used, recordings of radars in different places, nothing that drives, and a net with more
/// lanes than a unit has room for.
pub fn run(args: &Args) -> Result<ExitCode> {
    let is_net = |path: &PathBuf| {
        let name = path.to_string_lossy();
        name.ends_with(".xml") || name.ends_with(".xml.gz")
    };
    let (lanes, told) = match &args.sources[..] {
        [net] if is_net(net) => of_net(net, &args.net)?,
        all => {
            ensure!(!all.iter().any(is_net), "a net goes alone: give one net, or recordings");
            let NetArgs { origin, heading, at, range } = &args.net;
            ensure!(
                origin.is_none() && heading.is_none() && at.is_none() && range.is_none(),
                "--origin, --heading, --at and --range are of a net; where the radar hangs a recording says, or --mount"
            );
            of_recordings(all, &args.reading)?
        }
    };
    let mut text =
        format!("# {} lanes with {} segments {told}\n", lanes.len(), segments(lanes.iter().map(|(lane, _)| lane)));
    for (number, (lane, followed)) in (1..).zip(&lanes) {
        let driven = followed.map(|n| format!(": {n} vehicles drove there")).unwrap_or_default();
        let points: Vec<String> = lane.points.iter().map(|[x, y]| format!("[{x:?}, {y:?}]")).collect();
        text += &format!("\n# lane {number}{driven}\n[[{}]]\npoints = [{}]\n", args.table, points.join(", "));
    }
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// Lanes, each with how many vehicles were followed there, and where they are from.
fn of_net(net: &Path, args: &NetArgs) -> Result<(Vec<Counted>, String)> {
    let (range_m, heading) = (args.range.unwrap_or(200.0), args.heading.unwrap_or(0.0));
    ensure!(range_m > 0.0 && range_m <= 300.0, "--range {range_m} is outside 0 to 300 m");
    ensure!(heading.abs() <= 360.0, "--heading {heading} is outside -360 to 360 degrees");
    let origin = args.origin.unwrap_or_default();
    let frame = RoadFrame { origin, heading_rad: heading.to_radians(), net_offset: [0.0; 2] };
    let reach = Reach { from: args.at.unwrap_or_default(), reach_m: range_m + Lane::BEYOND_RANGE_M };
    let lanes = net::lanes(net, &frame, &reach)?;
    ensure!(
        lanes.len() <= MOST_LANES && segments(&lanes) <= MOST_SEGMENTS,
        "{}: {} lanes with {} segments, and a unit has room for {MOST_LANES} with {MOST_SEGMENTS}: take a shorter --range",
        net.display(),
        lanes.len(),
        segments(&lanes)
    );
    let [x, y] = reach.from;
    let lanes = lanes.into_iter().map(|lane| (lane, None)).collect();
    Ok((lanes, format!("of {}, within {} m of ({x}, {y})", name(net), reach.reach_m)))
}

fn of_recordings(paths: &[PathBuf], reading: &ReadingArgs) -> Result<(Vec<Counted>, String)> {
    let reading = reading.options();
    let read = |path: &PathBuf| recording::read(path, &reading).with_context(|| path.display().to_string());
    let all: Vec<Recording> = paths.iter().map(read).collect::<Result<_>>()?;
    for (path, recording) in paths.iter().zip(&all) {
        ensure!(
            recording.pose == all[0].pose,
            "{}: its radar does not hang where that of {} does; lanes of another place are learnt on their own",
            path.display(),
            paths[0].display()
        );
    }
    for recording in &all {
        estimators::usable::check(recording, &estimators::Options::default())?;
        told_problems(recording);
    }
    let learning = bar("learning lanes", 100);
    let lanes = lanes::counted(&all, &|share| learning.reach(share));
    drop(learning);
    ensure!(
        !lanes.is_empty(),
        "{}: no two vehicles drive 15 m one behind the other there; take a longer recording",
        paths[0].display()
    );
    let names: Vec<String> = paths.iter().map(|path| name(path)).collect();
    let lanes = lanes.into_iter().map(|(lane, n)| (lane, Some(n))).collect();
    Ok((lanes, format!("learnt from {}", names.join(", "))))
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().display().to_string()
}

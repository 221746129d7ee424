//! `viewshed lanes`: which way traffic goes, from a SUMO net.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, ensure};
use viewshed::obstacles::lanes::{MOST_LANES, MOST_SEGMENTS};

use super::print;
use crate::twin::traffic::frame::RoadFrame;
use crate::twin::traffic::net::{self, Reach};

/// Lanes of a SUMO net as the tables [[lanes]] of a daemon's file
///
/// At a crossing a radar's speeds alone do not tell where a vehicle heads. With lanes the estimator knows from the first
/// frame. Lanes of walkers, bicycles and rails are left out. Of a file for `replay` and `experiment` the tables are
/// [[estimators.lanes]].
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The net, plain or gzip; of a map, `netconvert --osm-files map.osm.xml -o map.net.xml` makes one
    #[arg(value_name = "NET")]
    net: PathBuf,
    /// Origin of the road coordinates in those of the net, without the offset the net says, in metres: X,Y
    #[arg(long, value_name = "X,Y", default_value = "0,0", value_parser = pair, allow_hyphen_values = true)]
    origin: [f64; 2],
    /// Direction of the road's x axis from east, counter-clockwise, in degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true)]
    heading: f64,
    /// Place of the radar in road coordinates, in metres: X,Y
    #[arg(long, value_name = "X,Y", default_value = "0,0", value_parser = pair, allow_hyphen_values = true)]
    at: [f64; 2],
    /// Range of the radar, in metres
    #[arg(long, value_name = "METRES", default_value_t = 200.0)]
    range: f64,
    /// Name of the tables
    #[arg(long, value_name = "NAME", default_value = "lanes")]
    table: String,
}

fn pair(text: &str) -> Result<[f64; 2], String> {
    let numbers: Vec<f64> =
        text.split(',').filter_map(|v| v.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    <[f64; 2]>::try_from(numbers).map_err(|_| "not two numbers X,Y".into())
}

/// Reads and prints.
///
/// # Errors
/// A net that cannot be used, and one with more lanes than a unit has room for.
pub fn run(args: &Args) -> Result<ExitCode> {
    ensure!(args.range > 0.0 && args.range <= 300.0, "--range {} is outside 0 to 300 m", args.range);
    ensure!(args.heading.abs() <= 360.0, "--heading {} is outside -360 to 360 degrees", args.heading);
    let frame = RoadFrame { origin: args.origin, heading_rad: args.heading.to_radians(), net_offset: [0.0; 2] };
    let reach = Reach { from: args.at, reach_m: args.range + Reach::MARGIN_M };
    let lanes = net::lanes(&args.net, &frame, &reach)?;
    let segments: usize = lanes.iter().map(|lane| lane.points.len() - 1).sum();
    ensure!(
        lanes.len() <= MOST_LANES && segments <= MOST_SEGMENTS,
        "{}: {} lanes with {segments} segments, and a unit has room for {MOST_LANES} with {MOST_SEGMENTS}: take a shorter --range",
        args.net.display(),
        lanes.len()
    );
    let mut text = format!(
        "# {} lanes with {segments} segments of {}, within {} m of ({}, {})\n",
        lanes.len(),
        args.net.file_name().unwrap_or_default().display(),
        reach.reach_m,
        args.at[0],
        args.at[1]
    );
    for lane in &lanes {
        let points: Vec<String> = lane.points.iter().map(|[x, y]| format!("[{x:?}, {y:?}]")).collect();
        text += &format!("[[{}]]\npoints = [{}]\n", args.table, points.join(", "));
    }
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

//! `viewshed simulate`: a scene and traffic in, a recording by contract out.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result};
use serde_json::json;

use super::print;
use super::progress::bar;
use crate::results::files::{OutputArgs, Target};
use crate::twin::radar::misses::Misses;
use crate::twin::scene::Scene;
use crate::twin::simulate::{Made, Simulation};

/// Simulate the sensors of a scene over traffic and write a recording with ground truth
///
/// The scene (TOML) has the radar with its mount, field of view and model, perhaps a camera, what stands beside
/// the road, and the seed. The same scene, traffic and seed give the same bytes, however many processors compute
/// them. The recording is an MCAP file that `viewshed replay`, Foxglove, Lichtblick and `ros2 bag` open.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Scene file
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Traffic in place of the scene's own: SUMO's FCD (XML or CSV) or trajectories (CSV), plain or gzip
    #[arg(long, value_name = "FILE")]
    fcd: Option<PathBuf>,
    /// Recording to be written
    #[arg(long, value_name = "REC.mcap")]
    out: PathBuf,
    /// Seed in place of the scene's own
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// What radars miss of vehicles in plain sight, in place of what the scene says: none, real, or a share of the frames
    #[arg(long, value_name = "MISSES")]
    misses: Option<Misses>,
    /// Length in place of the scene's own, in seconds
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    duration: Option<f64>,
    /// Write as JSON what was made: frames, detections, vehicles in view, seconds it took, the scene
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    outputs: OutputArgs,
}

const HELP: &str = "\
The least scene:

  name = \"corner\"
  duration_s = 60.0
  [traffic]
  fcd = \"corner.fcd.xml\"            # sumo --fcd-output corner.fcd.xml --device.fcd.period 0.5
  types = [\"corner.rou.xml\"]        # where its <vType> elements stand, for sizes
  net = \"corner.net.xml\"            # its netOffset is taken away; leave out where there is none
  from_s = 200.0                    # the file's time at the first frame
  origin = [0.0, 0.0]               # of the road frame, in the file's coordinates
  heading_deg = 0.0                 # of the road's x axis, counter-clockwise from east
  [radar]
  name = \"pole\"
  mount = { x_m = 0.0, y_m = -14.0, height_m = 6.0, yaw_deg = 10.0, pitch_deg = 4.0 }   # pitch + nose down
  field_of_view = { azimuth_deg = [-60.0, 60.0], elevation_deg = [-16.0, 16.0], range_m = [3.0, 200.0] }
  rate_hz = 15.0

More that a scene may have, each with defaults:

  [radar]  has_elevation = false             a radar that measures none
  [radar.model]                              wavelength_m, reference_snr_db, max_detections; tables antenna,
                                             resolution, detector, accuracy, fading, road, mirrors,
                                             interference, rounding, misses (the file model.rs of the twin has every
                                             parameter with its source)
  [[radar.interference]]                     from_s, to_s, noise_rise_db
  [[radar.outage]]                           from_s, to_s, frames = \"empty\" or \"missing\"
  [[further_radar]]                          name, mount: like the first, elsewhere; any number
  [camera]                                   name, mount, rate_hz, image = { width_px, height_px, view_deg },
                                             detector = { ... }
  [[static]]                                 id, class (barrier, sign_gantry, or a vehicle's that is parked),
                                             center, heading_deg, length_m, width_m, height_m, bottom_m,
                                             posts = { spacing_m, rcs_dbsm, height_m }, mirror_loss_db

Trajectories from elsewhere (drones, other sensors) are CSV with the columns
  time_s,object_id,class,x_m,y_m[,heading_rad,length_m,width_m,height_m]
x and y are the middle of the footprint; classes: car, van, truck, bus, motorcycle, bicycle, pedestrian.

  viewshed simulate tests/recordings/motorway.toml --out motorway.mcap
  viewshed replay motorway.mcap";

/// An empty road at the end of a recording that is worth telling, seconds.
const EMPTY_S: f64 = 5.0;

/// Simulates and writes.
///
/// # Errors
/// A scene or traffic that cannot be used, a file that cannot be written; then there is no recording.
pub fn run(args: &Args) -> Result<ExitCode> {
    let mut scene = Scene::read(&args.scene)?;
    scene.seed = args.seed.unwrap_or(scene.seed);
    scene.set_misses(args.misses.as_ref());
    if let Some(duration_s) = args.duration {
        scene.duration_s = duration_s;
        scene.check().context("--duration")?;
    }
    let mut outputs = args.outputs.beside(scene.files(args.fcd.as_deref())?.into_iter().chain([args.scene.clone()]));
    let recording = outputs.file("--out", Some(&args.out))?.context("--out is missing")?;
    let json_file = outputs.file("--json", args.json.as_deref())?;
    let simulation = Simulation::new(scene, args.fcd.as_deref())?;
    let started = Instant::now();
    let simulating = bar(&format!("simulating {}", simulation.scene.name), simulation.frames());
    let made = write(&simulation, &recording, &|| simulating.step())?;
    drop(simulating);
    let spent_s = started.elapsed().as_secs_f64();
    let duration_s = simulation.scene.duration_s;
    print(&format!(
        "{}: {duration_s} s in {spent_s:.1} s ({:.0} times real time), {} frames, {:.0} detections a frame,\n\
         {} vehicles, {:.0} in view at a time and {} at most\n",
        args.out.display(),
        duration_s / spent_s,
        made.frames,
        made.detections as f64 / (made.frames as f64).max(1.0),
        made.vehicles,
        made.vehicles_in_view,
        made.most_vehicles_in_view
    ))?;
    let ends_s = simulation.traffic_ends_s();
    if duration_s - ends_s > EMPTY_S {
        print(&format!(
            "traffic ends at {ends_s:.1} s of {duration_s} s: the road is empty from then on; --duration {:.0} leaves that out\n",
            ends_s.ceil()
        ))?;
    }
    if let Some(jumps) = simulation.jumps() {
        print(&format!("{jumps}\n"))?;
    }
    if let Some(file) = json_file {
        let all = json!({
            "recording": args.out.display().to_string(),
            "duration_s": duration_s,
            "spent_s": spent_s,
            "made": made,
            "scene": simulation.scene,
        });
        file.write(serde_json::to_string_pretty(&all)? + "\n")?;
    }
    print(&outputs.told())?;
    Ok(ExitCode::SUCCESS)
}

fn write(simulation: &Simulation, target: &Target, progress: &(dyn Fn() + Sync)) -> Result<Made> {
    let (file, made) = simulation.record(target.create()?, progress)?;
    file.finish()?;
    Ok(made)
}

//! `viewshed simulate`: a scene and traffic in, a recording by contract out.

use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};

use super::print;
use super::progress::bar;
use crate::twin::scene::Scene;
use crate::twin::simulate::Simulation;

/// Simulate the sensors of a scene over traffic and write a recording with ground truth
///
/// The scene (TOML) has the radar with its mount, field of view and model, what stands beside the road, and the
/// seed. Traffic is SUMO's FCD output (XML or CSV) or trajectories as CSV, plain or gzip. The same scene, traffic
/// and seed give the same bytes.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Scene file
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Traffic in place of the scene's own
    #[arg(long, value_name = "FILE")]
    fcd: Option<PathBuf>,
    /// Recording to be written
    #[arg(long, value_name = "REC.mcap")]
    out: PathBuf,
    /// Seed in place of the scene's own
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Length in place of the scene's own, in seconds
    #[arg(long, value_name = "SECONDS")]
    duration: Option<f64>,
}

/// Simulates and writes.
///
/// # Errors
/// A scene or traffic that cannot be used, a file that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode> {
    let mut scene = Scene::read(&args.scene)?;
    scene.seed = args.seed.unwrap_or(scene.seed);
    scene.duration_s = args.duration.unwrap_or(scene.duration_s);
    let simulation = Simulation::new(scene, args.fcd.as_deref())?;
    let place = || format!("cannot write {}", args.out.display());
    let file = BufWriter::new(File::create(&args.out).with_context(place)?);
    let started = std::time::Instant::now();
    let simulating = bar(&format!("simulating {}", simulation.scene.name), simulation.frames());
    simulation.record(file, &|| simulating.step())?;
    drop(simulating);
    let spent_s = started.elapsed().as_secs_f64();
    print(&format!("{}: {} frames in {spent_s:.1} s\n", args.out.display(), simulation.frames()))?;
    Ok(ExitCode::SUCCESS)
}

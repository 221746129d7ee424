//! `viewshed experiment`: the paper's experiment on the digital twin, or crossings and queues of it; a table out.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use serde_json::json;

use super::print;
use super::progress::bar;
use super::replay::shipped;
use crate::command::options::JudgingArgs;
use crate::evaluation::Settings;
use crate::evaluation::replay::{Replay, steps};
use crate::labels::lanes;
use crate::results::files::{OutputArgs, Outputs, Target};
use crate::results::pictures::reliability::{self, Reliability};
use crate::results::report::{
    calibration as calibration_report, experiment as report, gantry_camera as camera_report, json as replay_json,
    scenes as scenes_report, several_sensors as sensors_report, table,
};
use crate::studies::experiment::plan::{Day, Plan};
use crate::studies::experiment::scenes::{self, Extent, LanesFrom, Variant};
use crate::studies::experiment::{Experiment, calibration, gantry_camera, several_sensors, total_steps};
use crate::twin::radar::misses::Misses;
use crate::twin::simulate::Simulation;
use crate::{estimators, recording};

/// Estimators that run, for the progress bar.
const ESTIMATORS: u64 = 4;

/// Worlds of the twin there are experiments on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum World {
    /// The paper's: a motorway from a gantry, five days
    Motorway,
    /// Signalised crossings with turning traffic, buses, trucks, bicycles and walkers, six scenes
    Crossing,
    /// Motorways with lanes that creep or stop and go beside lanes that flow, four scenes
    Queue,
    /// Motorways on a grade of 4 %, a crest, a dip and a ramp, five scenes
    Grade,
    /// A camera on the motorway's gantry, with detectors from ideal to poor, in dense and in light traffic
    GantryCamera,
    /// Two radars at opposite corners of a crossing, each alone and fused, four sites
    TwoRadars,
    /// A radar and a camera on the motorway's gantry, each alone and fused, five days
    RadarCamera,
}

impl World {
    const fn name(self) -> &'static str {
        match self {
            Self::Motorway => "motorway",
            Self::Crossing => "crossing",
            Self::Queue => "queue",
            Self::Grade => "grade",
            Self::GantryCamera => "gantry-camera",
            Self::TwoRadars => "two-radars",
            Self::RadarCamera => "radar-camera",
        }
    }

    const fn plan(self) -> &'static str {
        match self {
            Self::Motorway => "experiment.toml",
            Self::Crossing => "crossing/scenes.toml",
            Self::Queue => "queue/scenes.toml",
            Self::Grade => "grade/scenes.toml",
            Self::GantryCamera => "gantry-camera.toml",
            Self::TwoRadars => "two-radars.toml",
            Self::RadarCamera => "radar-camera.toml",
        }
    }
}

/// Run an experiment on the digital twin: the paper's with its table beside ours, or crossings, or queues
///
/// Motorway: 60 s of 3 + 3 lanes with dense traffic and many trucks, a radar on a gantry at 6 m looking along the
/// direction of travel. Counts are pooled over the reporting days, and beside every rate stands its least and
/// greatest day. Crossing and queue: scenes of 150 s with a mount each (corner, side, far; 4 to 8 m), the first 60 s
/// not counted, pooled with intervals; beside it means, least and most of the scenes, radar-3d without elevation and
/// without warm-up, and every scene.
/// Gantry-camera: a camera in the radar's place, its detector's misses step by step, and why vehicles that were not
/// found were called visible. Two-radars and radar-camera: what each sensor and both together show of the road.
///
/// Scenes, traffic, mounts and seeds stand in files that were fixed before any estimator ran on them; what is tuned
/// is tuned on the training scenes or elsewhere.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Experiment file [default: tests/recordings/experiment.toml, gantry-camera.toml, or scenes.toml of crossing/ or queue/ there]
    #[arg(value_name = "PLAN")]
    plan: Option<PathBuf>,
    /// Where vehicles drive
    #[arg(long, value_enum, value_name = "NAME", default_value_t = World::Motorway)]
    scene: World,
    /// Fit probabilities of detection on some days of each unit and judge them on others; motorway, crossing and queue
    ///
    /// PLAN is calibration.toml of the same folder. Recordings of --beside are fitted on the first half of their frames
    /// and judged on the second.
    #[arg(long, conflicts_with_all = ["scene", "train", "only_elevation", "learn_lanes", "keep"])]
    calibration: bool,
    /// Write each unit's table, NAME.probability.toml, and reliability diagram, NAME.png, into this folder
    #[arg(long, value_name = "DIR", requires = "calibration", help_heading = "Results")]
    tables: Option<PathBuf>,
    /// Run the training scenes in place of those that are reported (crossing, queue, grade)
    #[arg(long)]
    train: bool,
    /// Judge every Nth frame only, which is faster; estimators are given all frames (all but motorway)
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1000))]
    every: u16,
    /// Let radars miss vehicles in plain sight, as in real ones: none, real, or a share of the frames (motorway, crossing, queue, grade)
    ///
    /// In bursts, `real` by range: a twentieth of the frames near the sensor and a fifth beyond 75 m. What is missed in sight counts
    /// as not detected, so most vehicles' FVR then is of vehicles in sight: the rows geometry-slice and geometry-box have it too.
    #[arg(long, value_name = "MISSES")]
    misses: Option<Misses>,
    /// Leave out the runs without elevation, which is faster (crossing, queue, grade)
    #[arg(long)]
    only_elevation: bool,
    /// Give lanes learnt from 90 s of another day, not those of the traffic's net (crossing)
    ///
    /// As `viewshed lanes RECORDING` learns them: the row radar-3d-lanes. And as a unit learns them that has run over
    /// these 90 s before: the row radar-3d-learning.
    #[arg(long)]
    learn_lanes: bool,
    /// Print tables as wide as they are: all intervals, and distances to the bound geometry-slice, too
    #[arg(long, help_heading = "Results")]
    wide: bool,
    /// Write everything as JSON: pooled with its `spread`, and by day (`seeds`) or by scene (`variants`)
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    json: Option<PathBuf>,
    /// Keep the simulated recordings in this folder, DAY.mcap or SCENE.mcap each
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
        None if args.calibration => shipped::file("calibration.toml")?,
        None => shipped::file(args.scene.plan())?,
    };
    let mut outputs = args.outputs.beside(args.beside.iter().flat_map(|path| recording::files(path)));
    outputs.reads(args.judging.files().chain([path.clone()]));
    if !args.calibration {
        fit_together(args)?;
    }
    match args.scene {
        _ if args.calibration => calibration(args, &path, &settings, &mut outputs)?,
        World::Motorway => motorway(args, &path, &settings, &mut outputs)?,
        World::Crossing | World::Queue | World::Grade => several_scenes(args, &path, &settings, &mut outputs)?,
        World::GantryCamera => gantry_camera(args, &path, &settings, &mut outputs)?,
        World::TwoRadars | World::RadarCamera => several_sensors(args, &path, &settings, &mut outputs)?,
    }
    print(&outputs.told())?;
    Ok(ExitCode::SUCCESS)
}

/// Refuses options that are of other worlds.
fn fit_together(args: &Args) -> Result<()> {
    use World::{Crossing, GantryCamera, Grade, Motorway, Queue, RadarCamera, TwoRadars};
    const SCENES: &[World] = &[Crossing, Queue, Grade];
    // of the plans that are shipped crossings alone name other days
    let learning = if args.plan.is_some() { SCENES } else { &[Crossing][..] };
    let options: [(&str, bool, &[World]); 7] = [
        ("--misses", args.misses.is_some(), &[Motorway, Crossing, Queue, Grade]),
        ("--train", args.train, SCENES),
        ("--only-elevation", args.only_elevation, SCENES),
        ("--learn-lanes", args.learn_lanes, learning),
        ("--every", args.every > 1, &[Crossing, Queue, Grade, GantryCamera, TwoRadars, RadarCamera]),
        ("--keep", args.keep.is_some(), &[Motorway, Crossing, Queue, Grade, TwoRadars, RadarCamera]),
        ("--beside", !args.beside.is_empty(), &[Motorway, Crossing, Queue, Grade]),
    ];
    for (option, is_asked, worlds) in options {
        let names = || worlds.iter().map(|world| world.name()).collect::<Vec<_>>().join(", ");
        ensure!(
            !is_asked || worlds.contains(&args.scene),
            "{option} does not go with --scene {}; it goes with {}",
            args.scene.name(),
            names()
        );
    }
    Ok(())
}

fn motorway(args: &Args, path: &Path, settings: &Settings, outputs: &mut Outputs) -> Result<()> {
    let mut plan = Plan::read(path)?;
    plan.misses = args.misses.clone().or(plan.misses);
    outputs.reads(plan.files()?);
    let json_file = outputs.file("--json", args.json.as_deref())?;
    let kept = kept(args, plan.days().map(Day::name), outputs)?;
    let running = bar(
        "simulating and replaying",
        total_steps(&plan, ESTIMATORS + u64::from(settings.estimators.far_road.is_some()))?,
    );
    let keep = |day: &Day, bytes: &[u8]| kept.get(&day.name()).map_or(Ok(()), |file| file.write(bytes));
    let experiment = Experiment::run(&plan, settings, &keep, &|| running.step())?;
    drop(running);
    print(&report::text(&experiment, table::Extent::of(args.wide)))?;
    let beside = beside(args, settings)?;
    if let Some(file) = json_file {
        let plan = json!({ "file": path.display().to_string(), "content": plan });
        file.write(report::json(&experiment, &beside, &plan, json_options(settings))?)?;
    }
    Ok(())
}

fn several_scenes(args: &Args, path: &Path, settings: &Settings, outputs: &mut Outputs) -> Result<()> {
    let mut plan = scenes::Plan::read(path)?;
    plan.misses = args.misses.clone().or(plan.misses);
    let set = if args.train { &plan.training } else { &plan.reporting };
    let all = plan.scenes(set)?;
    outputs.reads(set.scenes.iter().map(|scene| plan.folder.join(scene)));
    for scene in &all {
        outputs.reads(scene.files(None)?);
    }
    let json_file = outputs.file("--json", args.json.as_deref())?;
    let kept = kept(args, all.iter().map(|scene| scene.name.clone()), outputs)?;
    let extent = Extent { every: usize::from(args.every), without_elevation: !args.only_elevation };
    let on_grades = all.iter().all(|scene| !scene.ground.is_empty());
    let lanes = if args.learn_lanes {
        let days = plan.other_days(set)?;
        outputs.reads(days.iter().cloned());
        LanesFrom::OtherDays(days, |recordings| lanes::learnt(recordings, &|_| ()))
    } else {
        LanesFrom::nets(&all)
    };
    let has_lanes = !matches!(lanes, LanesFrom::Settings);
    let more = [has_lanes, on_grades, settings.estimators.far_road.is_some()];
    let learning = u64::from(args.learn_lanes);
    let estimators = ESTIMATORS + learning + estimators::site_rows(more.map(u64::from).iter().sum());
    let running = bar("simulating and replaying", scenes::total_steps(&all, extent, &lanes, estimators));
    let keep = |name: &str, bytes: &[u8]| kept.get(name).map_or(Ok(()), |file| file.write(bytes));
    let results = scenes::run(&all, settings, extent, &lanes, &keep, &|| running.step())?;
    drop(running);
    let counted: Vec<_> =
        Variant::ALL.iter().filter_map(|v| scenes::count(&results, *v, set.warm_up_s, settings)).collect();
    let title = scenes_report::Title {
        name: args.scene.name(),
        set: if args.train { "training" } else { "reporting" },
        warm_up_s: set.warm_up_s,
        every: extent.every,
        lanes_learnt: args.learn_lanes,
        extent: table::Extent::of(args.wide),
    };
    print(&scenes_report::text(&title, &plan, &counted, &settings.evaluation))?;
    let beside = beside(args, settings)?;
    if let Some(file) = json_file {
        let plan = json!({ "file": path.display().to_string(), "content": plan });
        file.write(scenes_report::json(&title, &plan, &all, &counted, &beside, json_options(settings))?)?;
    }
    Ok(())
}

fn gantry_camera(args: &Args, path: &Path, settings: &Settings, outputs: &mut Outputs) -> Result<()> {
    let plan = gantry_camera::Plan::read(path)?;
    outputs.reads(plan.files()?);
    let json_file = outputs.file("--json", args.json.as_deref())?;
    let running = bar("simulating and replaying", plan.steps()?);
    let sets = gantry_camera::run(&plan, settings, usize::from(args.every), &|| running.step())?;
    drop(running);
    print(&camera_report::text(&sets, table::Extent::of(args.wide)))?;
    if let Some(file) = json_file {
        let plan = json!({ "file": path.display().to_string(), "content": plan });
        file.write(camera_report::json(&sets, &plan, json_options(settings))?)?;
    }
    Ok(())
}

fn several_sensors(args: &Args, path: &Path, settings: &Settings, outputs: &mut Outputs) -> Result<()> {
    let plan = several_sensors::Plan::read(path)?;
    outputs.reads(plan.files()?);
    let json_file = outputs.file("--json", args.json.as_deref())?;
    let file = |site: &str| site.replace(", ", "-");
    let kept = kept(args, plan.site.iter().map(|site| file(&site.name())), outputs)?;
    let keep = |site: &str, simulation: &Simulation| {
        let Some(target) = kept.get(&file(site)) else { return Ok(()) };
        let (bytes, _) = simulation.record(Cursor::new(Vec::new()), &|| ())?;
        target.write(bytes.into_inner())
    };
    let running = bar("simulating and replaying", plan.steps()?);
    let all = several_sensors::run(&plan, settings, usize::from(args.every), &keep, &|| running.step())?;
    drop(running);
    print(&sensors_report::text(&all, table::Extent::of(args.wide)))?;
    if let Some(file) = json_file {
        let plan = json!({ "file": path.display().to_string(), "content": plan });
        file.write(sensors_report::json(&all, &plan, json_options(settings))?)?;
    }
    Ok(())
}

fn calibration(args: &Args, path: &Path, settings: &Settings, outputs: &mut Outputs) -> Result<()> {
    ensure!(args.every == 1, "--every does not go with --calibration");
    let plan = calibration::Plan::read(path)?;
    outputs.reads(plan.files()?);
    let json_file = outputs.file("--json", args.json.as_deref())?;
    let folder = args.tables.as_deref().map(|path| outputs.folder("--tables", path)).transpose()?;
    let running = bar("simulating, fitting and judging", plan.steps()?);
    let mut all = calibration::run(&plan, settings, &|| running.step())?;
    drop(running);
    for path in &args.beside {
        let recording = recording::read(path, &settings.reading).with_context(|| path.display().to_string())?;
        let judging = bar(&format!("judging {}", recording.name), steps(&recording, 1));
        all.push(calibration::run_halves(&recording, settings, &|| judging.step())?);
    }
    print(&calibration_report::text(&all, table::Extent::of(args.wide)))?;
    for judged in &all {
        let Some(folder) = &folder else { break };
        folder.file(format!("{}.probability.toml", judged.name))?.write(judged.fitted.text()?)?;
        let curve = |name: &str, bins: &[_]| Reliability { name: name.to_owned(), bins: bins.to_vec() };
        let curves = [curve("table", &judged.diagram), curve("grade / 255", &judged.diagram_of_grade)];
        let title = format!("{}: probability said against share detected", judged.name);
        let picture = reliability::draw(
            &curves,
            &title,
            "15 bins of equal count; on the diagonal a probability means what it says",
        );
        folder.file(format!("{}.png", judged.name))?.write(picture.png()?)?;
    }
    if let Some(file) = json_file {
        let plan = json!({ "file": path.display().to_string(), "content": plan });
        file.write(calibration_report::json(&all, &plan, json_options(settings))?)?;
    }
    Ok(())
}

/// The recording of each day or scene. They are worth more than pictures: what exists needs `--force`.
fn kept(args: &Args, names: impl Iterator<Item = String>, outputs: &mut Outputs) -> Result<BTreeMap<String, Target>> {
    let Some(folder) = &args.keep else { return Ok(BTreeMap::new()) };
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let file = |name: String| {
        let path = folder.join(format!("{name}.mcap"));
        Ok(outputs.file("--keep", Some(&path))?.map(|target| (name, target)))
    };
    Ok(names.map(file).collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
}

/// Replays and prints the recordings that are to stand beside.
fn beside(args: &Args, settings: &Settings) -> Result<Vec<replay_json::Report>> {
    args.beside
        .iter()
        .map(|path| {
            let replay = replay(path, settings)?;
            print(&format!("\n{}", report::beside(&replay)))?;
            Ok(replay_json::report(&replay, None, &[], json_options(settings)))
        })
        .collect()
}

fn json_options(settings: &Settings) -> replay_json::Options<'_> {
    replay_json::Options {
        reading: &settings.reading,
        evaluation: &settings.evaluation,
        estimators: &settings.estimators,
    }
}

fn replay(path: &Path, settings: &Settings) -> Result<Replay> {
    let recording = recording::read(path, &settings.reading).with_context(|| path.display().to_string())?;
    let mut running = estimators::all(&recording, &settings.estimators)?;
    let replaying = bar(&format!("replaying {}", recording.name), steps(&recording, running.len()));
    Ok(Replay::new(recording, &mut running, &settings.evaluation, &|| replaying.step()))
}

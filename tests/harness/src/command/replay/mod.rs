//! `viewshed replay`: recordings in, the paper's table out.

mod board;
mod fused;
mod out;
mod pictures;
mod report;
pub mod risk;
mod run_in;
pub mod shipped;
mod window;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail, ensure};
use rayon::prelude::*;
use serde_json::Value;

use self::fused::FusedReplay;
use self::run_in::RunIn;
use super::progress::bar;
use super::{BAD_INPUT, complain, print};
use crate::command::options::{SettingsArgs, finite};
use crate::evaluation::Settings;
use crate::evaluation::causes::{Causes, causes};
use crate::evaluation::examples::{self, Example};
use crate::evaluation::mount_error::{Extent, Sensitivity, sensitivity};
use crate::evaluation::replay::{Replay, camera_steps, steps};
use crate::recording::unheld::{MOST_HELD, PART};
use crate::recording::{ReadOptions, Recording, file};
use crate::results::files::{OutputArgs, Target};
use crate::results::foxglove;
use crate::results::report::csv::SampleWriter;
use crate::results::report::json::{self, Report};
use crate::results::report::{ORIGIN, table};
use crate::{estimators, recording};

/// The estimator examples are looked for in.
const SHOWN: &str = "radar-3d";

/// The same of a camera.
const SHOWN_OF_CAMERA: &str = "camera-3d";

/// Replay recordings through the estimators and report how far their maps can be trusted
///
/// For every radar frame each estimator says where the sensor can see. Every labelled object inside the
/// field of view is then compared: was it called visible (V), was it detected (D)? TVR = share of detected
/// objects called visible, FVR = share of undetected ones called visible (unknown blind spots: unsafe),
/// FIR = share of detected ones called invisible (less availability). The rows geometry-slice and
/// geometry-box are exact lines of sight past the labelled boxes, the bounds of any such method. Cell FVR
/// and FIR compare the map itself with exact lines of sight, wherever traffic passes.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LABELS, group = clap::ArgGroup::new("drawn").args(["out", "report"]).multiple(true))]
pub struct Args {
    /// MCAP recordings, CAN logs (ARS408) of `candump`, Vector ASC or SavvyCAN, captures of a TI mmWave radar's data port or
    /// of the native format, a camera's boxes (NAME.boxes.csv beside NAME.camera.toml) [default: the MCAP files in tests/recordings]
    #[arg(value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// Write everything that was found as JSON: an object, for several recordings an array
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    json: Option<PathBuf>,
    /// Write every object at every counted frame as CSV: V_O and grade of each estimator, D_O, class, range;
    /// of a camera beside the radar into NAME.camera.csv
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    csv: Option<PathBuf>,
    /// Write the input with an estimator's map beside it, to open in Foxglove or Lichtblick
    ///
    /// The map is a foxglove.Grid on /visibility/ESTIMATOR: blue is visible, orange invisible, dark occupied,
    /// nothing unknown. FILE.layout.json beside it has the panels: import it as a layout.
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    mcap: Option<PathBuf>,
    /// Estimator whose map goes into --mcap
    #[arg(long, value_name = "NAME", default_value = SHOWN, requires = "mcap", help_heading = "Results")]
    mcap_estimator: String,
    /// Write a report to send around: one HTML file with tables, curves, pictures and the worst moments, which opens offline
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    report: Option<PathBuf>,
    /// Write table and pictures into this folder, one subfolder a recording where there are several
    #[arg(long, value_name = "DIR", help_heading = "Results")]
    out: Option<PathBuf>,
    /// Draw the frame at this time after the first, in seconds [default: one with a hidden vehicle, or the middle]
    #[arg(long, value_name = "SECONDS", requires = "drawn", value_parser = finite, allow_negative_numbers = true, help_heading = "Results")]
    time: Option<f64>,
    /// Print the rates by class and by distance too
    #[arg(long, help_heading = "Results")]
    breakdown: bool,
    /// Judge radar and camera of a recording as one map, too; several radars in one recording always are
    #[arg(long, help_heading = "Results")]
    fused: bool,
    /// Print tables as wide as they are: all intervals, and distances to the bound geometry-slice, too
    #[arg(long, help_heading = "Results")]
    wide: bool,
    /// Replay again with the mount wrong by this pitch (degrees) and height (metres), each way
    ///
    /// Only the estimators are given the wrong mount, truth keeps the right one. Without values 0.5,0.2;
    /// others as --mount-error=1,0.1
    #[arg(
        long,
        value_name = "PITCH,HEIGHT",
        value_parser = extent,
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "0.5,0.2",
        help_heading = "Results"
    )]
    mount_error: Option<Extent>,
    /// Say why the cells of radar-3d are wrong: which vehicles have no box, one too low, one elsewhere
    ///
    /// Every fifth counted frame is looked at; the causes add up to the cells' FVR and FIR there. On a flat road only.
    #[arg(long, help_heading = "Results")]
    causes: bool,
    /// Let a unit run over this recording of the same radar before and learn its lanes: the row radar-3d-learning
    ///
    /// Of other hours than the one that is replayed; may be repeated, oldest first.
    #[arg(long, value_name = "RECORDING", conflicts_with = "board", help_heading = "Estimators")]
    run_in: Vec<PathBuf>,
    #[command(flatten)]
    risk: risk::RiskArgs,
    #[command(flatten)]
    processor: board::BoardArgs,
    #[command(flatten)]
    outputs: OutputArgs,
    #[command(flatten)]
    settings: SettingsArgs,
}

const LABELS: &str = "\
Labels beside the recording, in the road frame (x along the road, y to the left):

  NAME.labels.csv      time_s,object_id,class,x_m,y_m[,heading_rad,length_m,width_m,height_m]
                       a row is an object at an instant; between two rows of one object_id its place is
                       interpolated. time_s counts from the first frame, or is the recording's own clock.
                       x_m, y_m: middle of the box; heading_rad anticlockwise from +x; a heading that is missing
                       is the path's, a size the class's: car, van, truck, bus, motorcycle, bicycle, pedestrian
  NAME.occlusion.csv   object_id,occlusion_0_to_2
                       how much of it a person saw hidden: 0 nothing, 1 some, 2 most

  Examples: example.labels.csv and example.occlusion.csv in tests/recordings.";

const NO_CAUSES: &str =
    "Why cells are wrong cannot be said: that takes labels, a flat road and an estimator with boxes.\n";

/// Replays one recording after the other. One that cannot be replayed is reported, and the rest go on.
///
/// # Errors
/// Options that cannot be used at all, and files that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode> {
    let mut settings = args.settings.settings()?;
    let paths = if args.recordings.is_empty() { shipped::recordings()? } else { args.recordings.clone() };
    settings.reading.check_for(paths.len())?;
    let run_in = RunIn::read(&args.run_in, &settings.reading)?;
    settings.estimators.before = run_in.before();
    let mut outputs = args.outputs.beside(paths.iter().chain(&args.run_in).flat_map(|path| recording::files(path)));
    outputs.reads(args.settings.files().chain(args.risk.files()));
    let json_file = outputs.file("--json", args.json.as_deref())?;
    let out = args.out.as_deref().map(|path| outputs.folder("--out", path)).transpose()?;
    if args.processor.board.is_some() || args.processor.port.is_some() {
        ensure!(
            args.report.is_none(),
            "--report has rates, and a comparison with a board has none; leave one of them out"
        );
        let pictures = out.map_or_else(|| outputs.folder("--out", Path::new("out")), Ok)?;
        let ended = board::run(
            &args.processor,
            &paths,
            &pictures,
            json_file.as_ref(),
            (&settings, table::Extent::of(args.wide)),
        )?;
        print(&outputs.told())?;
        return Ok(ended);
    }
    let one_only = args.mcap.as_ref().map(|_| "--mcap").or(args.report.as_ref().map(|_| "--report"));
    if let Some(option) = one_only.filter(|_| paths.len() > 1) {
        bail!("{option} writes one recording and {} are to be replayed; name one", paths.len());
    }
    let mcap = outputs.file("--mcap", args.mcap.as_deref())?;
    let panels = args.mcap.as_deref().map(|path| path.with_extension("layout.json"));
    let panels = outputs.file("--mcap", panels.as_deref())?;
    let mcap = mcap.zip(panels);
    let page = outputs.file("--report", args.report.as_deref())?;
    let csv = outputs.file("--csv", args.csv.as_deref())?;
    let camera_csv = args.csv.as_deref().map(of_camera);
    let camera_csv = outputs.file("--csv", camera_csv.as_deref())?;
    let mut camera_samples = None;
    let folders = out.map(|out| out::folders(&out, &paths)).transpose()?;
    let mut samples = csv.map(|file| file.create()).transpose()?.map(SampleWriter::new);
    let mut reports = Vec::new();
    let (mut failed, mut synthetic) = (false, false);
    let mut of_all: Vec<Causes> = Vec::new();
    // a typing error is said at once, not after the minutes that the others take
    let missing = missing(&paths);
    for (k, path) in paths.iter().enumerate() {
        if missing.contains(&path) {
            failed = true;
            continue;
        }
        let radars = match radars(path, &settings, one_only) {
            Ok(radars) => radars,
            Err(error) => {
                complain(&error);
                failed = true;
                continue;
            }
        };
        let several = radars.len() > 1;
        let folder = folders.as_ref().and_then(|f| f.get(k));
        let mut fused = fused(path, &radars, args, &settings).unwrap_or_else(|error| {
            complain(&error);
            failed = true;
            None
        });
        let extent = table::Extent::of(args.wide);
        let fused_text = fused.as_ref().map(|fused| fused.text(extent));
        if let (Some(fused), Some(folder)) = (&fused, folder) {
            fused.write(folder, extent)?;
        }
        for (recording, reading) in radars {
            let settings = Settings { reading, ..settings.clone() };
            let one = run_in.check(&recording).and_then(|()| replay(path, recording, args, mcap.as_ref(), &settings));
            let one = match one {
                Ok(one) => one,
                Err(error) => {
                    complain(&error);
                    failed = true;
                    continue;
                }
            };
            synthetic |= one.of_simulated_labels();
            add_up(&mut of_all, &one.causes);
            let text = one.text(args, &settings) + &args.risk.told(&one.replay)?;
            print(&text)?;
            if let Some(csv) = &mut samples {
                csv.write(&one.replay)?;
            }
            if let (Some(camera), Some(file)) = (&one.replay.camera, &camera_csv) {
                let csv = match &mut camera_samples {
                    Some(csv) => csv,
                    None => camera_samples.insert(SampleWriter::new(file.create()?)),
                };
                csv.write(camera)?;
            }
            if let Some(folder) = folder {
                let origin = if one.of_simulated_labels() { format!("\n{ORIGIN}\n") } else { String::new() };
                let own = if several { folder.folder(&one.replay.recording.name) } else { folder.clone() };
                out::write(&own, &(text + &origin), &one, &args.risk, &settings)?;
            }
            if let Some(target) = &page {
                report::write(target, &one, &settings)?;
            }
            // with the first of its sensors
            let fused = fused.take().map(|fused| fused.json(&settings));
            reports.push(one.report(fused, &settings));
        }
        if let Some(text) = fused_text {
            print(&text)?;
        }
    }
    if let [_, _, ..] = reports[..] {
        let extent = table::Extent::of(args.wide);
        let told = of_all.iter().map(|causes| table::causes(causes, extent)).collect::<String>();
        print(&if told.is_empty() { told } else { format!("\nAll recordings together\n{told}") })?;
    }
    for csv in [samples.filter(|_| !reports.is_empty()), camera_samples].into_iter().flatten() {
        csv.finish()?.finish()?;
    }
    if let Some(file) = json_file {
        // the number asked for decides the form, not the number that could be read; a file can have several radars
        match (&paths[..], &reports[..]) {
            ([_], []) => {}
            ([_], [report]) => file.write(json::object(report)?)?,
            (_, several) => file.write(json::array(several)?)?,
        }
    }
    if synthetic {
        print(&format!("\n{ORIGIN}\n"))?;
    }
    print(&outputs.told())?;
    Ok(if failed { ExitCode::from(BAD_INPUT) } else { ExitCode::SUCCESS })
}

impl Args {
    /// What was asked for and needs labels, said of a recording that has none.
    fn without_labels(&self) -> String {
        let asked = [
            ("--mount-error", self.mount_error.is_some()),
            ("--breakdown", self.breakdown),
            ("--csv", self.csv.is_some()),
        ];
        let asked: Vec<&str> = asked.iter().filter(|(_, asked)| *asked).map(|(option, _)| *option).collect();
        match &asked[..] {
            [] => String::new(),
            [one] => format!("{one} needs labels, and there are none.\n"),
            several => format!("{} need labels, and there are none.\n", several.join(", ")),
        }
    }
}

/// One recording replayed, with what was asked for beside its rates.
struct Replayed {
    replay: Replay,
    examples: Vec<Example>,
    mount_error: Option<Vec<Sensitivity>>,
    causes: Vec<Causes>,
    /// The frame of --time.
    shown_frame: Option<usize>,
}

/// Complains of the files that are not there.
fn missing(paths: &[PathBuf]) -> Vec<&PathBuf> {
    let complained = |path: &&PathBuf| file::there(path).inspect_err(complain).is_err();
    paths.iter().filter(complained).collect()
}

/// What each radar of a file recorded, and how it is read.
fn radars(path: &Path, settings: &Settings, one_only: Option<&str>) -> Result<Vec<(Recording, ReadOptions)>> {
    let radars = recording::open_each(path, &settings.reading, Some(PART)).map_err(|error| named(error, path))?;
    if let (Some(option), [_, _, ..]) = (one_only, &radars[..]) {
        let topics: Vec<&str> = radars.iter().filter_map(|(_, reading)| reading.radar_topic.as_deref()).collect();
        bail!(
            "{option} writes one radar's map: {} has {}; choose with --radar-topic",
            path.display(),
            topics.join(", ")
        );
    }
    // what shows every frame, or copies it
    let Some(option) = one_only else { return Ok(radars) };
    radars.into_iter().map(|(recording, reading)| Ok((recording.hold(option, MOST_HELD)?, reading))).collect()
}

/// All sensors of a file as one map, where that is asked for or the file has several radars.
fn fused(
    path: &Path,
    radars: &[(Recording, ReadOptions)],
    args: &Args,
    settings: &Settings,
) -> Result<Option<FusedReplay>> {
    if !fused::is_due(radars.first().map(|(first, _)| first), radars.len(), args.fused)? {
        return Ok(None);
    }
    let radars: Vec<Recording> = radars.iter().map(|(recording, _)| recording.clone()).collect();
    FusedReplay::new(&file::stem(path), &radars, args.time, settings).map(Some)
}

fn replay(
    path: &Path,
    recording: Recording,
    args: &Args,
    mcap: Option<&(Target, Target)>,
    settings: &Settings,
) -> Result<Replayed> {
    let mut recording = recording;
    let shown_frame = args.time.map(|time_s| frame_at(&recording, time_s)).transpose()?;
    let mut running = args.risk.estimators(&recording, settings)?;
    if args.out.is_some() {
        recording.keep(&[shown_frame.unwrap_or(recording.count() / 2)]);
    }
    let (name, passes) = (recording.name.clone(), steps(&recording, running.len()));
    let replaying = bar(&format!("replaying {name}"), passes + camera_steps(&recording));
    let replay = if recording.of_camera().is_some() {
        Replay::of_camera(recording, &settings.estimators, &settings.evaluation, &|| replaying.step())?
    } else {
        let mut replay = Replay::new(recording, &mut running, &settings.evaluation, &|| replaying.step());
        replay.add_camera(&settings.estimators, &settings.evaluation, &|| replaying.step());
        replay
    };
    drop(replaying);
    judged(&replay, settings)?;

    if let Some((target, panels)) = mcap {
        write_mcap(path, [target, panels], &args.mcap_estimator, &replay, settings)?;
    }
    let wrong = |extent: Extent| {
        let again = bar(&format!("replaying {name} with a wrong mount"), 4 * passes);
        let of =
            |replay: &Replay| sensitivity(replay, extent, &settings.evaluation, &settings.estimators, &|| again.step());
        let mut all = of(&replay)?;
        // the camera's own mount, wrong by the same
        for (radar, camera) in all.iter_mut().zip(replay.camera.as_deref().map(of).transpose()?.into_iter().flatten()) {
            radar.estimators.extend(camera.estimators);
        }
        anyhow::Ok(all)
    };
    // without truth there are no rates that could move
    let labelled = replay.recording.truth.is_some();
    let mount_error = args.mount_error.filter(|_| labelled).map(wrong).transpose()?;
    let causes = if args.causes { why(&replay, settings)? } else { Vec::new() };
    let shown = replay.score(SHOWN).or(replay.score(SHOWN_OF_CAMERA));
    let examples = shown.map(|s| examples::find(&replay.recording, &replay.samples, s)).unwrap_or_default();
    Ok(Replayed { replay, examples, mount_error, causes, shown_frame })
}

/// Adds up the wrong cells of each estimator.
fn add_up(all: &mut Vec<Causes>, causes: &[Causes]) {
    for one in causes {
        match all.iter_mut().find(|known| known.estimator == one.estimator) {
            Some(known) => *known += one,
            None => all.push(one.clone()),
        }
    }
}

/// Why cells are wrong, of each estimator of this kind.
fn why(replay: &Replay, settings: &Settings) -> Result<Vec<Causes>> {
    let recording = &replay.recording;
    if recording.truth.is_none() {
        return Ok(Vec::new());
    }
    let mut running = estimators::all(recording, &settings.estimators)?;
    running.retain(|e| e.name().starts_with(SHOWN));
    let frames = (recording.frames.len() * running.len()) as u64;
    let again = bar(&format!("asking why cells of {} are wrong", recording.name), frames);
    let height_m = settings.evaluation.slice_height_m;
    let of = |e: &mut Box<dyn estimators::Estimator>| {
        causes(recording, e.as_mut(), &replay.samples, height_m, &|| again.step())
    };
    Ok(running.par_iter_mut().filter_map(of).collect())
}

/// The frame nearest to a time since the first.
fn frame_at(recording: &Recording, time_s: f64) -> Result<usize> {
    let (start, duration_s) = (recording.start_ns(), recording.duration_s());
    let (mut number, mut nearest) = (0, None);
    recording.all().each(&mut |frame| {
        let apart = (frame.time_ns.saturating_sub(start) as f64 * 1e-9 - time_s).abs();
        if nearest.is_none_or(|(_, least)| apart < least) {
            nearest = Some((number, apart));
        }
        number += 1;
    });
    let Some((frame, _)) = nearest.filter(|_| (-1.0..=duration_s + 1.0).contains(&time_s)) else {
        bail!("--time {time_s}: {} lasts {duration_s:.1} s; name a time from 0 to that", recording.name);
    };
    Ok(frame)
}

/// Refuses a recording of which no frame counts, and a labelled one of which nothing could be judged: a table without a
/// number tells nobody anything.
fn judged(replay: &Replay, settings: &Settings) -> Result<()> {
    let (recording, summary) = (&replay.recording, &replay.summary);
    let (name, frames) = (&recording.name, recording.count());
    if summary.frames == 0 {
        bail!(
            "{name}: nothing can be judged: its {frames} frames, {:.1} s, end within the warm-up of {} s; shorten that with --warm-up",
            recording.duration_s(),
            settings.evaluation.warm_up_s
        );
    }
    let cells = summary.rows.iter().any(|row| row.cell_fvr().is_some() || row.cell_fir().is_some());
    let truth = recording.truth.as_ref().filter(|truth| !truth.tracks.is_empty());
    let Some(truth) = truth.filter(|_| summary.objects == 0 && !cells) else { return Ok(()) };
    bail!(
        "{name}: nothing can be judged: of its {} labelled objects none is faster than {} m/s and in the field of view in one of the {} frames that count; look at times, places and --fov, or set --min-speed",
        truth.tracks.len(),
        settings.evaluation.min_speed_mps,
        summary.frames
    );
}

/// `NAME.camera.csv` beside `NAME.csv`.
fn of_camera(csv: &Path) -> PathBuf {
    csv.with_extension("camera.csv")
}

/// The error with the file's name before it, where it does not say it itself.
fn named(error: anyhow::Error, path: &Path) -> anyhow::Error {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    if format!("{error:#}").contains(&*stem) { error } else { error.context(path.display().to_string()) }
}

fn write_mcap(
    source: &Path,
    targets: [&Target; 2],
    estimator: &str,
    replay: &Replay,
    settings: &Settings,
) -> Result<()> {
    let mut names = Vec::new();
    let mut found = None;
    for replay in [Some(replay), replay.camera.as_deref()].into_iter().flatten() {
        for one in estimators::all(&replay.recording, &settings.estimators)? {
            names.push(one.name().to_owned());
            if one.name() == estimator {
                found = Some((replay, one));
            }
        }
    }
    let Some((replay, mut estimator)) = found else {
        bail!("--mcap-estimator: no estimator `{estimator}`; there are {}", names.join(", "));
    };
    let (recording, name) = (&replay.recording, estimator.name().to_owned());
    let writing = bar(&format!("writing {}", targets[0].path().display()), recording.frames.len() as u64);
    let boxes = |frame| pictures::boxes(replay, &name, frame);
    foxglove::write(source, targets, recording, &settings.reading, estimator.as_mut(), &boxes, &|| writing.step())
}

impl Replayed {
    /// Whether its rates are of a simulated world.
    fn of_simulated_labels(&self) -> bool {
        self.replay.recording.sensor.synthetic && self.replay.recording.truth.is_some()
    }

    fn text(&self, args: &Args, settings: &Settings) -> String {
        let extent = table::Extent::of(args.wide);
        let mut text = table::text(&self.replay, &settings.evaluation, extent);
        // without labels there is nothing to break down, and `without_labels` says so
        if args.breakdown && self.replay.recording.truth.is_some() {
            text += &table::breakdown(&self.replay.summary, extent);
            text += &self.replay.camera.as_ref().map(|c| table::breakdown(&c.summary, extent)).unwrap_or_default();
        }
        if let Some(sensitivities) = &self.mount_error {
            text += &table::mount_error(sensitivities, extent);
        }
        for causes in &self.causes {
            text += &table::causes(causes, extent);
        }
        if args.causes && self.causes.is_empty() {
            text += NO_CAUSES;
        }
        if self.replay.recording.truth.is_none() {
            text += &args.without_labels();
        }
        text
    }

    fn report(&self, fused: Option<Value>, settings: &Settings) -> Report {
        let options = json::Options {
            reading: &settings.reading,
            evaluation: &settings.evaluation,
            estimators: &settings.estimators,
        };
        let mut report = json::report(&self.replay, self.mount_error.as_deref(), &self.examples, options);
        report.causes = json::causes(&self.causes);
        report.fused = fused;
        report
    }
}

fn extent(text: &str) -> Result<Extent, String> {
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0);
    let wrong = || format!("`{text}` is not PITCH,HEIGHT: two numbers from 0, in degrees and metres");
    let (pitch, height) = text.split_once(',').ok_or_else(wrong)?;
    Ok(Extent { pitch_deg: number(pitch).ok_or_else(wrong)?, height_m: number(height).ok_or_else(wrong)? })
}

//! The camera's experiment on the twin: detectors from ideal to poor over days of dense and of light traffic.
//!
//! A [`Plan`] names sets of days. On each day every detector is given the same views, and its boxes go through
//! `camera-3d`; `camera-true-boxes` has the true boxes, and what a detector found is what it is judged by. Days are
//! pooled, detector by detector.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::plan::{self, Day};
use crate::estimators::{Estimator, camera_3d};
use crate::evaluation::Settings;
use crate::evaluation::camera::{self as judged, visible_shares};
use crate::evaluation::pool::{Seconds, pool};
use crate::evaluation::replay::Replay;
use crate::evaluation::samples::FrameSamples;
use crate::evaluation::score::{Score, score};
use crate::recording::Recording;
use crate::recording::camera::RecordedCamera;
use crate::recording::truth::Truth;
use crate::twin::camera::detector::DetectorModel;
use crate::twin::scene::{CameraSection, Scene};
use crate::twin::simulate::Simulation;

/// What is simulated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Scene file with a camera, seen from the plan's folder as all paths here.
    pub scene: PathBuf,
    /// Length of each day, seconds.
    pub duration_s: f64,
    pub set: Vec<Set>,
    /// Folder of the file.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// Days that are pooled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Set {
    pub name: String,
    /// In place of the scene's camera.
    pub camera: Option<CameraSection>,
    pub day: Vec<Day>,
}

/// A detector by its name.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Detector {
    pub name: &'static str,
    pub model: DetectorModel,
}

/// Finds all of which this share shows, without noise.
const IDEAL_SHARE: f64 = 0.3;

/// Those that are compared, the ideal one first: then the one that is fitted to a real detector, and two that miss so
/// much of what the ideal one finds, whatever its size, and err as the fitted one in all else.
pub fn detectors() -> [Detector; 4] {
    let fitted = DetectorModel::default();
    let ideal = DetectorModel {
        best: 1.0,
        half_height_px: 1.0,
        fall: 0.01,
        share: [IDEAL_SHARE - 2e-6, IDEAL_SHARE],
        noise_px: 0.0,
        noise_share: 0.0,
        merge_overlap: 1.0,
        false_boxes: 0.0,
    };
    let missing = |share: f64| DetectorModel {
        best: 1.0 - share,
        noise_px: fitted.noise_px,
        noise_share: fitted.noise_share,
        false_boxes: fitted.false_boxes,
        ..ideal
    };
    [
        Detector { name: "ideal", model: ideal },
        Detector { name: "fitted", model: fitted },
        Detector { name: "5 % missed", model: missing(0.05) },
        Detector { name: "15 % missed", model: missing(0.15) },
    ]
}

impl Plan {
    /// Reads a plan.
    ///
    /// # Errors
    /// File, line and key of what cannot be read; a set without days, traffic or a seed that is named twice in a set.
    pub fn read(path: &Path) -> Result<Self> {
        plan::read(path, |plan: &mut Self, folder| {
            plan.folder = folder;
            plan.check()
        })
    }

    fn check(&self) -> Result<()> {
        ensure!(!self.set.is_empty(), "no [[set]]");
        for set in &self.set {
            ensure!(!set.day.is_empty(), "set `{}` has no [[set.day]]", set.name);
            for (k, day) in set.day.iter().enumerate() {
                let twice = set.day[..k].iter().any(|d| d.fcd == day.fcd || d.seed == day.seed);
                ensure!(!twice, "set `{}`: {} or its seed is named twice", set.name, day.fcd.display());
            }
        }
        Ok(())
    }

    fn day_scene(&self, set: &Set, day: &Day) -> Result<Scene> {
        let mut scene = Scene::read(&self.folder.join(&self.scene))?;
        scene.seed = day.seed;
        scene.duration_s = self.duration_s;
        scene.camera = set.camera.clone().or(scene.camera);
        scene.check().with_context(|| format!("set `{}`", set.name))?;
        ensure!(scene.camera.is_some(), "neither the scene nor set `{}` has a [camera]", set.name);
        Ok(scene)
    }

    /// Every file that is read for its days, beside its own.
    ///
    /// # Errors
    /// Those of the scene.
    pub fn files(&self) -> Result<Vec<PathBuf>> {
        let path = self.folder.join(&self.scene);
        let scene = Scene::read(&path)?;
        let days = self.set.iter().flat_map(|set| &set.day);
        let files = days.map(|day| scene.files(Some(&self.folder.join(&day.fcd))));
        Ok([path].into_iter().chain(files.collect::<Result<Vec<_>>>()?.into_iter().flatten()).collect())
    }

    /// Calls of `progress` by [`run`].
    ///
    /// # Errors
    /// Those of the scene.
    pub fn steps(&self) -> Result<u64> {
        let mut frames = 0;
        for set in &self.set {
            for day in &set.day {
                let scene = self.day_scene(set, day)?;
                frames += scene.camera.map_or(0, |c| (self.duration_s * c.rate_hz).floor() as u64 + 1);
            }
        }
        // seen, sampled, the reference, and once a detector
        Ok(frames * (3 + detectors().len() as u64))
    }
}

/// Why vehicles that were not found were called visible, in object-steps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Causes {
    /// Nothing of it shows, but enough of the column above it does.
    pub hidden: u64,
    /// Less than 30 % of it shows.
    pub little: u64,
    /// More of it shows, and the detector missed it.
    pub missed: u64,
    /// True boxes would have hidden it: what stands before it was missed or misplaced.
    pub occluder: u64,
}

impl std::ops::AddAssign for Causes {
    fn add_assign(&mut self, o: Self) {
        self.hidden += o.hidden;
        self.little += o.little;
        self.missed += o.missed;
        self.occluder += o.occluder;
    }
}

/// One detector over the days of a set.
#[derive(Debug)]
pub struct Detected {
    pub detector: Detector,
    pub pooled: Replay,
    pub causes: Causes,
}

/// A set, run.
#[derive(Debug)]
pub struct SetResult {
    pub set: Set,
    /// Share of heavy vehicles among all tracks.
    pub heavy: f64,
    pub detected: Vec<Detected>,
}

/// Simulates and replays every day. `every`-th frames are judged; `progress` is called after each of [`Plan::steps`].
///
/// # Errors
/// Those of the scene, the traffic and of the estimators' parameters.
pub fn run(plan: &Plan, settings: &Settings, every: usize, progress: &(dyn Fn() + Sync)) -> Result<Vec<SetResult>> {
    let one = |set: &Set| -> Result<SetResult> {
        let days = set.day.iter().map(|day| {
            let scene = plan.day_scene(set, day)?;
            day_of(scene, &plan.folder.join(&day.fcd), settings, every, progress)
                .with_context(|| format!("set `{}`, {}", set.name, day.name()))
        });
        let days = days.collect::<Result<Vec<_>>>()?;
        let heavy: Vec<[usize; 2]> = days.iter().map(|d| d.heavy).collect();
        let [heavy, all] = [0, 1].map(|k| heavy.iter().map(|h| h[k]).sum::<usize>());
        let detected = detectors().into_iter().enumerate().filter_map(|(k, detector)| {
            let parts: Vec<&Seconds> = days.iter().map(|d| &d.detected[k].0).collect();
            let mut causes = Causes::default();
            days.iter().for_each(|d| causes += d.detected[k].1);
            // the warm-up is left out of the samples
            let pooled = pool(detector.name, &parts, 0.0, &settings.evaluation)?;
            Some(Detected { detector, pooled, causes })
        });
        let detected = detected.collect();
        Ok(SetResult { set: set.clone(), heavy: heavy as f64 / all.max(1) as f64, detected })
    };
    plan.set.iter().map(one).collect()
}

/// One day: of each detector what was counted and why.
struct DayResult {
    detected: Vec<(Seconds, Causes)>,
    /// Heavy vehicles, and all.
    heavy: [usize; 2],
}

fn day_of(
    scene: Scene,
    fcd: &Path,
    settings: &Settings,
    every: usize,
    progress: &(dyn Fn() + Sync),
) -> Result<DayResult> {
    let section = scene.camera.clone().context("no camera")?;
    let camera = section.camera();
    let models = detectors().map(|d| d.model);
    let simulation = Simulation::new(scene, Some(fcd))?;
    let views: Vec<_> = (0..simulation.camera_frames())
        .into_par_iter()
        .map(|number| {
            progress();
            simulation.camera_views(&camera, section.rate_hz, number, &models)
        })
        .collect::<Result<_>>()?;
    let (mut labels, mut frames) = (Vec::new(), vec![Vec::with_capacity(views.len()); models.len()]);
    for (own, found) in views {
        labels.extend(own);
        frames.iter_mut().zip(found).for_each(|(all, one)| all.push(one));
    }
    let truth = Truth::new(labels);
    let named = |t: &&crate::recording::truth::Track, names: &[&str]| names.contains(&t.class.as_str());
    let heavy = truth.tracks.iter().filter(|t| named(t, &["truck", "bus"])).count();
    let all = truth.tracks.iter().filter(|t| !named(t, &["barrier"])).count();

    let config = &settings.estimators.camera_3d;
    let (range_m, share) = (f64::from(config.range_max_m), f64::from(config.visible_share));
    let recording_of = |frames| {
        let camera = RecordedCamera { pose: camera.pose, intrinsics: camera.intrinsics, frames, alone: true };
        camera.alone("gantry-camera".into(), simulation.sensor(), Some(truth.clone()), range_m)
    };
    let mut samples: Option<Vec<FrameSamples>> = None;
    let mut reference: Option<Score> = None;
    let mut detected = Vec::new();
    for frames in frames {
        let recording = recording_of(frames);
        match &mut samples {
            Some(samples) => judged::detect_again(&recording, samples, &settings.evaluation),
            None => samples = Some(judged::samples(&recording, share, &settings.evaluation, every, progress)),
        }
        let Some(samples) = &samples else { continue };
        let mut running = camera_3d::all(recorded(&recording)?, Some(&truth), config)?;
        if reference.is_some() {
            running.truncate(1);
        }
        let grid = settings.evaluation.grid;
        let run = |e: &mut Box<dyn Estimator>| score(e.as_mut(), &recording, samples, grid, &|| progress());
        let mut scores: Vec<Score> = running.par_iter_mut().map(run).collect();
        match &reference {
            Some(own) => scores.push(own.clone()),
            None => reference = scores.get(1).cloned(),
        }
        let causes = causes(&recording, samples, &scores);
        detected.push((Seconds::new(recording, samples, scores), causes));
    }
    Ok(DayResult { detected, heavy: [heavy, all] })
}

fn recorded(recording: &Recording) -> Result<&RecordedCamera> {
    recording.camera.as_ref().context("a recording without its camera")
}

/// Looks at every object that was called visible and not found.
fn causes(recording: &Recording, samples: &[FrameSamples], scores: &[Score]) -> Causes {
    let [own, reference] = scores else { return Causes::default() };
    let (Some(camera), Some(truth)) = (&recording.camera, &recording.truth) else { return Causes::default() };
    let of_frame = |k: usize| {
        let mut causes = Causes::default();
        let wrong = |i: &usize| own.verdicts[k][*i].visible && !samples[k].objects[*i].detected;
        let wrong: Vec<usize> = (0..samples[k].objects.len()).filter(wrong).collect();
        if wrong.is_empty() {
            return causes;
        }
        let objects = truth.at(recording.frames[k].time_ns);
        let shares = visible_shares(camera, &objects);
        for i in wrong {
            let share = objects.iter().position(|o| o.track == samples[k].objects[i].track).map_or(0.0, |o| shares[o]);
            *match (reference.verdicts[k][i].visible, share) {
                (false, _) => &mut causes.occluder,
                (true, s) if s <= 0.0 => &mut causes.hidden,
                (true, s) if s < IDEAL_SHARE => &mut causes.little,
                (true, _) => &mut causes.missed,
            } += 1;
        }
        causes
    };
    let frames = (0..samples.len()).into_par_iter().map(of_frame);
    frames.reduce(Causes::default, |mut a, b| {
        a += b;
        a
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_plan_is_the_one_that_was_fixed() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/gantry-camera.toml");
        let plan = Plan::read(&path).unwrap();
        let sets: Vec<(&str, Vec<u64>)> =
            plan.set.iter().map(|s| (s.name.as_str(), s.day.iter().map(|d| d.seed).collect())).collect();
        let seeds = |from: u64| (from..from + 5).collect::<Vec<_>>();
        let expected = [("dense", seeds(11)), ("few heavy vehicles", seeds(21)), ("another camera", seeds(31))];
        assert_eq!(sets, expected);
        let files = plan.files().unwrap();
        assert!(files.iter().all(|f| f.exists()), "{files:?}");
        for set in &plan.set {
            let scene = plan.day_scene(set, &set.day[0]).unwrap();
            assert!(scene.camera.is_some() && scene.seed == set.day[0].seed);
        }
    }

    #[test]
    fn a_plan_that_cannot_be_run_says_why() {
        let plan = |text: &str| toml::from_str::<Plan>(text).map_err(anyhow::Error::from).and_then(|p| p.check());
        let error = |text: &str| format!("{:#}", plan(text).unwrap_err());
        let head = "scene = \"s.toml\"\nduration_s = 6.0\n";
        assert!(error(&format!("{head}set = []")).contains("no [[set]]"));
        let set = format!("{head}[[set]]\nname = \"a\"\n");
        assert!(error(&format!("{set}day = []")).contains("set `a` has no [[set.day]]"));
        let day = "[[set.day]]\nfcd = \"x\"\nseed = 1\n";
        assert!(plan(&format!("{set}{day}")).is_ok());
        assert!(error(&format!("{set}{day}[[set.day]]\nfcd = \"y\"\nseed = 1\n")).contains("named twice"));
        assert!(error(&format!("{set}{day}cars = 1\n")).contains("unknown field"));
    }

    #[test]
    fn the_ideal_detector_finds_what_shows_and_nothing_else() {
        use crate::geometry::solid::Solid;
        use crate::twin::camera::Target;
        use crate::twin::camera::made_up::camera;
        let mut camera = camera();
        camera.model = detectors()[0].model;
        camera.model.check().unwrap();
        let car = |x: f64| Target {
            class: "car",
            solid: Solid { center: [x, 0.0, 0.75], yaw_rad: 0.0, size: [4.6, 1.8, 1.5] },
        };
        let wall = |y: f64| Solid { center: [70.0, y, 5.0], yaw_rad: 0.0, size: [1.0, 2.0, 10.0] };
        let (seen, targets) = (camera.view(&[car(80.0).solid], &[wall(-0.75)]), [car(80.0)]);
        assert!(seen[0].share < 0.45 && seen[0].share > IDEAL_SHARE, "{}", seen[0].share);
        for number in 0..50 {
            let boxes = camera.detect(&targets, &[wall(-0.75)], 3, number);
            assert_eq!((boxes.len(), boxes[0].edges), (1, seen[0].edges));
            assert!(camera.detect(&targets, &[wall(-0.5)], 3, number).is_empty());
        }
    }
}

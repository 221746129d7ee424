//! Crossings and queues of the twin: several scenes with a mount each, pooled to one table.
//!
//! A [`Plan`] names scenes to train on and scenes to report. Each is simulated and replayed, with elevation and,
//! where asked, without; seconds are kept, so that the same run is counted after its warm-up and from its start.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::plan;
use crate::estimators::{self, Before, Lane};
use crate::evaluation::Settings;
use crate::evaluation::pool::{Seconds, pool};
use crate::evaluation::replay::Replay;
use crate::evaluation::samples::{self, FrameSamples};
use crate::evaluation::score::score;
use crate::recording::{Recording, file};
use crate::twin::radar::misses::Misses;
use crate::twin::scene::Scene;
use crate::twin::simulate::Simulation;

/// What is simulated, and what each scene is for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// What may be tuned on.
    pub training: Set,
    /// What is reported, and never tuned on.
    pub reporting: Set,
    /// What `radar-3d` has to reach, and what it should.
    pub floor: Option<Goal>,
    pub aim: Option<Goal>,
    /// Folder of the file.
    #[serde(skip)]
    pub folder: PathBuf,
    /// What radars miss, in place of what scenes say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub misses: Option<Misses>,
}

/// Scenes that are pooled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Set {
    /// Start of each scene that is not counted, seconds: an estimator may need time to learn a site.
    pub warm_up_s: f64,
    /// Scene files, seen from the plan's folder.
    pub scenes: Vec<PathBuf>,
    /// Traffic of another day at each of them, which its lanes can be learnt from.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub other_days: Vec<PathBuf>,
}

/// Rates to be reached, FVR and FIR, in points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// Of road cells.
    pub cells: [f64; 2],
    /// Of objects, from `geometry-slice`.
    pub objects_from_slice: [f64; 2],
}

impl Plan {
    /// Reads a plan and all its scenes.
    ///
    /// # Errors
    /// File, line and key of what cannot be read; a scene, a seed or traffic that two scenes share.
    pub fn read(path: &Path) -> Result<Self> {
        plan::read(path, |plan: &mut Self, folder| {
            plan.folder = folder;
            plan.check()
        })
    }

    fn check(&self) -> Result<()> {
        let (mut seeds, mut files) = (BTreeSet::new(), BTreeSet::new());
        for (name, set) in [("training", &self.training), ("reporting", &self.reporting)] {
            ensure!(!set.scenes.is_empty(), "[{name}] has no scenes");
            ensure!(
                set.other_days.is_empty() || set.other_days.len() == set.scenes.len(),
                "[{name}] names other_days of {} of its {} scenes",
                set.other_days.len(),
                set.scenes.len()
            );
            for scene in self.scenes(set)? {
                let traffic = scene.source(None)?.path;
                ensure!(
                    set.warm_up_s >= 0.0 && set.warm_up_s < scene.duration_s,
                    "[{name}] warm_up_s {} leaves nothing of `{}`, which has {} s",
                    set.warm_up_s,
                    scene.name,
                    scene.duration_s
                );
                let other_days = set.other_days.iter().map(|day| self.folder.join(day));
                ensure!(
                    other_days.clone().all(|day| day != traffic),
                    "[{name}] other_days has the traffic `{}` is judged on",
                    scene.name
                );
                ensure!(seeds.insert(scene.seed), "`{}` has the seed {} of another scene", scene.name, scene.seed);
                ensure!(
                    files.insert(traffic.clone()),
                    "`{}` has the traffic {} of another scene",
                    scene.name,
                    traffic.display()
                );
            }
        }
        Ok(())
    }

    /// The scenes of one of its sets.
    ///
    /// # Errors
    /// Those of reading a scene.
    pub fn scenes(&self, set: &Set) -> Result<Vec<Scene>> {
        let read = |path: &PathBuf| {
            let mut scene = Scene::read(&self.folder.join(path))?;
            scene.set_misses(self.misses.as_ref());
            Ok(scene)
        };
        set.scenes.iter().map(read).collect()
    }

    /// Traffic of another day at each scene of a set.
    ///
    /// # Errors
    /// The set names none.
    pub fn other_days(&self, set: &Set) -> Result<Vec<PathBuf>> {
        ensure!(
            !set.other_days.is_empty(),
            "these scenes name no other_days that lanes could be learnt from, as those of --scene crossing do"
        );
        Ok(set.other_days.iter().map(|day| self.folder.join(day)).collect())
    }
}

/// Where estimators have the lanes of each scene from.
#[derive(Debug, Clone)]
pub enum LanesFrom {
    /// What the settings say.
    Settings,
    /// The net of its traffic.
    Nets,
    /// `LEARNT_S` of other traffic, seen by the same radar, and what learns them from that.
    OtherDays(Vec<PathBuf>, fn(&[Recording]) -> Vec<Lane>),
}

/// How much of another day lanes are learnt from at most, seconds.
const LEARNT_S: f64 = 90.0;
/// What the seed of another day is greater by.
const OTHER_SEED: u64 = 1 << 32;

impl LanesFrom {
    /// The nets of scenes, where all name one.
    pub fn nets(scenes: &[Scene]) -> Self {
        let has_net = |scene: &Scene| scene.traffic.as_ref().is_some_and(|traffic| traffic.net.is_some());
        if scenes.iter().all(has_net) { Self::Nets } else { Self::Settings }
    }

    /// What the radar of scene number `k` saw on another day.
    fn other_day(
        &self,
        k: usize,
        scene: &Scene,
        settings: &Settings,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Option<Recording>> {
        let Self::OtherDays(days, _) = self else { return Ok(None) };
        let (duration_s, seed) = (scene.duration_s.min(LEARNT_S), scene.seed + OTHER_SEED);
        let other = Scene { duration_s, seed, ..scene.clone() };
        let day = days.get(k).with_context(|| format!("`{}` has no other day", scene.name))?;
        let simulation = Simulation::new(other, Some(day))?;
        plan::recorded(&simulation, &file::stem(day), settings, progress).map(|(_, recording)| Some(recording))
    }

    /// Lanes of a scene, of which this was seen on another day.
    fn of(&self, scene: &Scene, other: Option<&Recording>, settings: &Settings) -> Result<Vec<Lane>> {
        match (self, other) {
            (Self::Nets, _) => scene.lanes(),
            (Self::OtherDays(_, learn), Some(other)) => {
                let lanes = learn(std::slice::from_ref(other));
                ensure!(
                    !lanes.is_empty(),
                    "{}: no lanes can be learnt from {} s of it",
                    other.name,
                    other.duration_s().round()
                );
                Ok(lanes)
            }
            _ => Ok(settings.estimators.lanes.clone()),
        }
    }
}

/// How much is run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Every how many frames are judged; estimators are given all.
    pub every: usize,
    /// Whether each scene is run again with a radar that measures no elevation.
    pub without_elevation: bool,
}

/// One scene, run.
#[derive(Debug)]
pub struct SceneResult {
    pub scene: Scene,
    with_elevation: Seconds,
    without_elevation: Option<Seconds>,
}

/// What is counted of the runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// With elevation, after the warm-up: what is reported.
    Main,
    /// Without elevation, after the warm-up.
    WithoutElevation,
    /// With elevation, from the first second on.
    WithoutWarmUp,
}

impl Variant {
    pub const ALL: [Self; 3] = [Self::Main, Self::WithoutElevation, Self::WithoutWarmUp];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Main => "with elevation, after the warm-up",
            Self::WithoutElevation => "without elevation",
            Self::WithoutWarmUp => "without warm-up",
        }
    }
}

/// One way of counting, all scenes together and each alone.
#[derive(Debug)]
pub struct Counted {
    pub variant: Variant,
    pub pooled: Replay,
    pub scenes: Vec<Replay>,
}

/// Simulates and replays every scene. `keep` is given the name and the bytes of each recording with elevation,
/// `progress` called after each of [`total_steps`].
///
/// # Errors
/// Those of the scenes, the traffic and of the estimators' parameters.
pub fn run(
    scenes: &[Scene],
    settings: &Settings,
    extent: Extent,
    lanes: &LanesFrom,
    keep: &(dyn Fn(&str, &[u8]) -> Result<()> + Sync),
    progress: &(dyn Fn() + Sync),
) -> Result<Vec<SceneResult>> {
    let one = |k: usize, scene: &Scene| -> Result<SceneResult> {
        // what a radar is told of its site, it has seen itself
        let told = |scene: &Scene| -> Result<Settings> {
            let other = lanes.other_day(k, scene, settings, progress)?;
            let mut told = settings.clone();
            told.estimators.lanes = lanes.of(scene, other.as_ref(), settings)?;
            told.estimators.before = Before::of(other);
            Ok(told)
        };
        let recording = record(scene, settings, keep, progress)?;
        let mut samples = samples::collect_every(&recording, &settings.evaluation, extent.every, progress);
        let with_elevation = seconds(recording, &samples, &told(scene)?, progress)?;
        let without_elevation = extent
            .without_elevation
            .then(|| {
                let mut flat = scene.clone();
                flat.radar.has_elevation = false;
                let recording = record(&flat, settings, &|_, _| Ok(()), progress)?;
                samples::detect_again(&recording, &mut samples, &settings.evaluation);
                seconds(recording, &samples, &told(&flat)?, progress)
            })
            .transpose()?;
        Ok(SceneResult { scene: scene.clone(), with_elevation, without_elevation })
    };
    let all = scenes.par_iter().enumerate();
    all.map(|(k, scene)| one(k, scene).with_context(|| format!("scene `{}`", scene.name))).collect()
}

fn record(
    scene: &Scene,
    settings: &Settings,
    keep: &dyn Fn(&str, &[u8]) -> Result<()>,
    progress: &(dyn Fn() + Sync),
) -> Result<Recording> {
    let simulation = Simulation::new(scene.clone(), None)?;
    let (bytes, recording) = plan::recorded(&simulation, &scene.name, settings, progress)?;
    keep(&scene.name, &bytes)?;
    Ok(recording)
}

fn seconds(
    recording: Recording,
    samples: &[FrameSamples],
    settings: &Settings,
    progress: &(dyn Fn() + Sync),
) -> Result<Seconds> {
    let mut running = estimators::all(&recording, &settings.estimators)?;
    let scores = running
        .par_iter_mut()
        .map(|e| score(e.as_mut(), &recording, samples, settings.evaluation.grid, &|| progress()))
        .collect();
    Ok(Seconds::new(recording, samples, scores))
}

/// Counts the runs in one way; `None` where a scene was not run for it.
pub fn count(results: &[SceneResult], variant: Variant, warm_up_s: f64, settings: &Settings) -> Option<Counted> {
    let runs = results.iter().map(|r| match variant {
        Variant::Main | Variant::WithoutWarmUp => Some(&r.with_elevation),
        Variant::WithoutElevation => r.without_elevation.as_ref(),
    });
    let runs: Vec<&Seconds> = runs.collect::<Option<_>>()?;
    let from_s = if variant == Variant::WithoutWarmUp { 0.0 } else { warm_up_s };
    let pooled = pool("pooled", &runs, from_s, &settings.evaluation)?;
    let alone =
        |(run, result): (&&Seconds, &SceneResult)| pool(&result.scene.name, &[*run], from_s, &settings.evaluation);
    let scenes = runs.par_iter().zip(results).map(alone).collect::<Option<_>>()?;
    Some(Counted { variant, pooled, scenes })
}

/// Calls of `progress` by [`run`].
pub fn total_steps(scenes: &[Scene], extent: Extent, lanes: &LanesFrom, estimators: u64) -> u64 {
    let steps = |most_s: f64| scenes.iter().map(|s| (s.duration_s.min(most_s) * s.radar.rate_hz).ceil() as u64).sum();
    let frames: u64 = steps(f64::INFINITY);
    let other_day: u64 = if matches!(lanes, LanesFrom::OtherDays(..)) { steps(LEARNT_S) } else { 0 };
    // simulated and sampled, and once an estimator; without elevation the samples are there
    other_day * (1 + u64::from(extent.without_elevation))
        + frames * (2 + estimators + if extent.without_elevation { 1 + estimators } else { 0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shipped(name: &str) -> Plan {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings");
        Plan::read(&folder.join(name).join("scenes.toml")).unwrap()
    }

    /// Scenes that nothing was chosen on have seeds, mounts and traffic of their own.
    #[test]
    fn unseen_scenes_share_nothing_with_those_of_training_and_reporting() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings");
        for (name, scenes) in [("crossing", 6), ("queue", 4)] {
            let plan = Plan::read(&folder.join(name).join("unseen.toml")).unwrap();
            let unseen = plan.scenes(&plan.reporting).unwrap();
            assert_eq!(unseen.len(), scenes);
            if name == "crossing" {
                assert!(plan.other_days(&plan.reporting).unwrap().iter().all(|day| day.exists()));
            }
            let fixed = shipped(name);
            let mut others = fixed.scenes(&fixed.training).unwrap();
            others.extend(fixed.scenes(&fixed.reporting).unwrap());
            for (ours, other) in unseen.iter().flat_map(|ours| others.iter().map(move |other| (ours, other))) {
                assert!(ours.seed != other.seed && ours.radar.mount != other.radar.mount, "{}", ours.name);
                let traffic = |scene: &Scene| std::fs::read(scene.source(None).unwrap().path).unwrap();
                assert!(traffic(ours) != traffic(other), "{} and {}", ours.name, other.name);
            }
        }
        let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
        let days =
            |text: &str| text.lines().filter_map(|l| l.strip_prefix("fcd = ")).map(str::to_owned).collect::<Vec<_>>();
        let unseen = days(&read("unseen.toml"));
        assert_eq!(unseen.len(), 11, "ten to report, and the one that is trained on");
        let others = ["experiment.toml", "gantry-camera.toml", "calibration.toml", "tuning.toml"].map(read).join("\n");
        assert!(unseen[1..].iter().all(|day| !others.contains(day.as_str())), "{unseen:?}");
    }

    #[test]
    fn the_shipped_scenes_are_those_that_were_fixed() {
        let fixed = |name: &str| -> Vec<(String, u64, f64, f64)> {
            let plan = shipped(name);
            [&plan.training, &plan.reporting]
                .iter()
                .flat_map(|set| plan.scenes(set).unwrap())
                .map(|s| (s.name.clone(), s.seed, s.duration_s, s.radar.mount.height_m))
                .collect()
        };
        let of = |all: &[(&str, u64, f64, f64)]| -> Vec<(String, u64, f64, f64)> {
            all.iter().map(|&(name, seed, s, h)| (name.to_owned(), seed, s, h)).collect()
        };
        let crossings = [
            ("train-1", 1101, 90.0, 5.5),
            ("train-2", 1102, 90.0, 6.5),
            ("wide-1", 2101, 150.0, 6.0),
            ("wide-2", 2102, 150.0, 7.5),
            ("skewed-1", 2103, 150.0, 4.5),
            ("skewed-2", 2104, 150.0, 8.0),
            ("tee-1", 2105, 150.0, 7.0),
            ("tee-2", 2106, 150.0, 5.0),
        ];
        let queues = [
            ("train-1", 3101, 90.0, 6.0),
            ("train-2", 3102, 90.0, 7.0),
            ("exit-1", 4101, 150.0, 6.5),
            ("exit-2", 4102, 150.0, 4.5),
            ("waves-1", 4103, 150.0, 8.0),
            ("waves-2", 4104, 150.0, 5.0),
        ];
        let grades = [
            ("train-1", 6101, 60.0, 6.0),
            ("train-2", 6102, 60.0, 7.0),
            ("up", 7101, 60.0, 6.0),
            ("down", 7102, 60.0, 7.0),
            ("crest", 7103, 60.0, 6.5),
            ("dip", 7104, 60.0, 5.5),
            ("ramp", 7105, 60.0, 6.0),
        ];
        assert_eq!((fixed("crossing"), fixed("queue")), (of(&crossings), of(&queues)));
        assert_eq!(fixed("grade"), of(&grades));
        for name in ["crossing", "queue"] {
            let plan = shipped(name);
            assert_eq!(plan.reporting.warm_up_s, 60.0);
            assert!(plan.scenes(&plan.reporting).unwrap().iter().all(|s| s.radar.has_elevation));
        }
    }

    #[test]
    fn the_traffic_script_makes_every_scenes_traffic_and_no_other() {
        for name in ["crossing", "queue"] {
            let plan = shipped(name);
            let script = std::fs::read_to_string(plan.folder.join("traffic.sh")).unwrap();
            let lines = script.lines().filter_map(|l| l.strip_prefix("traffic "));
            let mut made: Vec<(String, f64)> = lines
                .map(|l| {
                    let words: Vec<&str> = l.split(' ').collect();
                    (words[0].to_owned(), words[words.len() - 1].parse().unwrap())
                })
                .collect();
            let unseen = Plan::read(&plan.folder.join("unseen.toml")).unwrap();
            let sets = [&plan.training, &plan.reporting, &unseen.reporting];
            let scenes: Vec<Scene> = sets.iter().flat_map(|set| plan.scenes(set).unwrap()).collect();
            let mut used: Vec<(String, f64)> = scenes.iter().map(|s| (s.name.clone(), s.duration_s)).collect();
            for scene in &scenes {
                let file = scene.source(None).unwrap().path;
                assert_eq!(file.file_name().unwrap().to_str(), Some(&*format!("{}.fcd.xml.gz", scene.name)));
                assert!(file.exists(), "{}", file.display());
            }
            made.sort_by(|a, b| a.0.cmp(&b.0));
            used.sort_by(|a, b| a.0.cmp(&b.0));
            assert_eq!(made, used, "{name}");
        }
    }

    #[test]
    fn other_days_are_one_for_each_scene_and_not_the_one_that_is_judged() {
        let plan = shipped("crossing");
        let days = plan.other_days(&plan.reporting).unwrap();
        assert!(days.len() == plan.reporting.scenes.len() && days.iter().all(|day| day.exists()), "{days:?}");
        let refused = |change: &dyn Fn(&mut Vec<PathBuf>)| {
            let mut plan = shipped("crossing");
            change(&mut plan.reporting.other_days);
            plan.check().unwrap_err().to_string()
        };
        let few = refused(&|days| drop(days.pop()));
        assert!(few.contains("[reporting] names other_days of 5 of its 6 scenes"), "{few}");
        let same = refused(&|days| days[3] = "tee-1.fcd.xml.gz".into());
        assert!(same.contains("other_days has the traffic `tee-1` is judged on"), "{same}");
        let none = plan.other_days(&plan.training).unwrap_err().to_string();
        assert!(none.contains("no other_days"), "{none}");
    }

    #[test]
    fn lanes_are_learnt_from_the_other_day_alone_seen_from_the_same_place() {
        let plan = shipped("crossing");
        let mut scene = plan.scenes(&plan.reporting).unwrap().remove(0);
        scene.duration_s = 2.0;
        let learn = |recordings: &[Recording]| {
            let [x, y, _] = recordings[0].pose.position;
            let ids = recordings[0].truth.as_ref().map_or(0, |truth| truth.tracks.len());
            vec![Lane { points: vec![[x as f32, y as f32], [recordings[0].frames.len() as f32, ids as f32]] }]
        };
        let settings = Settings::default();
        let of = |day: &str| {
            let days = vec![plan.folder.join(day)];
            let lanes = LanesFrom::OtherDays(days, learn);
            let other = lanes.other_day(0, &scene, &settings, &|| ()).unwrap();
            lanes.of(&scene, other.as_ref(), &settings).unwrap().remove(0).points
        };
        let [there, seen] = of("wide-day-1.fcd.xml.gz")[..] else { panic!("two points") };
        assert_eq!((there, seen[0]), ([scene.radar.mount.x_m as f32, scene.radar.mount.y_m as f32], 30.0));
        assert_ne!(seen[1], of("wide-day-2.fcd.xml.gz")[1][1], "other vehicles on another day");
        let nothing = LanesFrom::OtherDays(vec![plan.folder.join("wide-day-1.fcd.xml.gz")], |_| Vec::new());
        let other = nothing.other_day(0, &scene, &settings, &|| ()).unwrap();
        let error = nothing.of(&scene, other.as_ref(), &settings).unwrap_err().to_string();
        assert!(error.contains("wide-day-1") && error.contains("no lanes can be learnt from 2 s"), "{error}");
        assert!(matches!(LanesFrom::nets(&[scene.clone()]), LanesFrom::Nets));
        scene.traffic.as_mut().unwrap().net = None;
        assert!(matches!(LanesFrom::nets(&[scene]), LanesFrom::Settings));
    }

    #[test]
    fn a_radar_without_elevation_learns_lanes_from_what_it_saw_itself() {
        static SEEN: std::sync::Mutex<Vec<bool>> = std::sync::Mutex::new(Vec::new());
        let learn = |recordings: &[Recording]| {
            let mut detections = recordings.iter().flat_map(|r| &r.frames).flat_map(|f| &f.detections);
            SEEN.lock().unwrap().push(detections.any(|d| d.elevation_rad.is_some()));
            vec![Lane { points: vec![[0.0, 0.0], [50.0, 0.0]] }]
        };
        let plan = shipped("crossing");
        let mut scene = plan.scenes(&plan.reporting).unwrap().remove(0);
        scene.duration_s = 1.0;
        let lanes = LanesFrom::OtherDays(plan.other_days(&plan.reporting).unwrap(), learn);
        let extent = Extent { every: 15, without_elevation: true };
        run(&[scene], &Settings::default(), extent, &lanes, &|_, _| Ok(()), &|| ()).unwrap();
        assert_eq!(*SEEN.lock().unwrap(), [true, false]);
    }

    #[test]
    fn every_scene_has_what_it_is_named_after() {
        use crate::twin::traffic::types::Class;
        for name in ["crossing", "queue"] {
            let plan = shipped(name);
            for scene in plan.scenes(&plan.reporting).unwrap() {
                let (id, seconds) = (format!("{name}/{}", scene.name), scene.duration_s);
                let simulation = Simulation::new(scene, None).unwrap();
                let classes: BTreeSet<Class> = simulation.traffic.vehicles.iter().map(|v| v.kind.class).collect();
                let of_a_town = [Class::Bus, Class::Bicycle, Class::Pedestrian];
                assert!(classes.contains(&Class::Truck), "{id}");
                assert!(name == "queue" || of_a_town.iter().all(|c| classes.contains(c)), "{id}: {classes:?}");
                let (mut steps, mut standing, mut driving) = (0, 0, 0);
                for since_s in (0..seconds as u32).step_by(5) {
                    for (_, pose) in simulation.traffic.at(simulation.scene.from_s() + f64::from(since_s)) {
                        let speed = pose.velocity[0].hypot(pose.velocity[1]);
                        steps += 1;
                        standing += u32::from(speed < 2.5);
                        driving += u32::from(speed > 5.0);
                    }
                }
                assert!(steps > 30 * (seconds / 5.0) as u32, "{id}: {steps} vehicle-steps");
                assert!(standing * 5 > steps && driving * 5 > steps, "{id}: {standing} and {driving} of {steps}");
            }
        }
    }

    /// A scene of the grades, its road raised as a whole, for two seconds, and its recording.
    fn on_grade(name: &str, raised_m: f64) -> (Simulation, Recording) {
        let plan = shipped("grade");
        let mut scene = Scene::read(&plan.folder.join(name).with_extension("toml")).unwrap();
        scene.duration_s = 2.0;
        scene.ground.iter_mut().for_each(|point| point[1] += raised_m);
        let simulation = Simulation::new(scene, None).unwrap();
        let (_, recording) = plan::recorded(&simulation, name, &Settings::default(), &|| ()).unwrap();
        (simulation, recording)
    }

    #[test]
    fn a_recording_on_a_grade_says_so_and_all_stands_on_it() {
        for (name, raised_m) in [("up", 0.0), ("down", 0.0), ("crest", 300.0)] {
            let (simulation, recording) = on_grade(name, raised_m);
            let ground = &recording.ground;
            assert_eq!(ground.points(), simulation.scene.ground);
            let truth = recording.truth.as_ref().unwrap();
            for solid in truth.solids() {
                let over = solid.bottom() - ground.height(solid.center[0]);
                assert!(over.abs() < 0.01, "{name}: {solid:?} stands {over} m over the road");
            }
            // what is detected is vehicles' height above the road, near and far, and not above the road at the mast
            let mut heights: Vec<[f64; 2]> = Vec::new();
            for d in recording.frames.iter().flat_map(|frame| &frame.detections).filter(|d| d.range_m > 120.0) {
                let [x, _, z] = d.road_position(&recording.pose, 1.0);
                heights.push([z - ground.height(x), z - ground.height(0.0)]);
            }
            let median = |k: usize| {
                let mut of: Vec<f64> = heights.iter().map(|h| h[k]).collect();
                of.sort_by(f64::total_cmp);
                of[of.len() / 2]
            };
            assert!(heights.len() > 30 && (-0.3..1.8).contains(&median(0)), "{name}: {}", median(0));
            assert!(name == "crest" || (median(1) - median(0)).abs() > 4.0, "{name}: {}", median(1));
            // and the mount is that of the scene, whatever the road's height
            let sensor = estimators::sensor(&recording, &Default::default());
            assert!((f64::from(sensor.mount.height_m) - simulation.scene.radar.mount.height_m).abs() < 1e-4);
            let names = estimators::all(&recording, &Settings::default().estimators).unwrap();
            assert!(names.iter().any(|e| e.name() == "radar-3d-ground"), "{name}");
        }
    }

    #[test]
    fn behind_a_crest_less_is_detected_than_on_a_level_road() {
        let far = |recording: &Recording| {
            recording.frames.iter().flat_map(|f| &f.detections).filter(|d| d.range_m > 170.0).count()
        };
        let (simulation, crest) = on_grade("crest", 0.0);
        let mut scene = simulation.scene.clone();
        // lower by half the mast, so that the crest hides what is far
        scene.radar.mount.height_m = 2.5;
        let low = Simulation::new(scene.clone(), None).unwrap();
        scene.ground.clear();
        let level = Simulation::new(scene, None).unwrap();
        let [low, level] = [low, level].map(|s| plan::recorded(&s, "s", &Settings::default(), &|| ()).unwrap().1);
        assert!(
            far(&low) * 3 < far(&level),
            "{} and {} from 2.5 m, {} from 6.5 m",
            far(&low),
            far(&level),
            far(&crest)
        );
    }

    #[test]
    fn what_is_reported_is_not_trained_on() {
        let mut plan = shipped("crossing");
        plan.reporting.scenes.push(plan.training.scenes[0].clone());
        plan.reporting.other_days.clear();
        let error = plan.check().unwrap_err().to_string();
        assert!(error.contains("`train-1` has the seed 1101 of another scene"), "{error}");
        let mut plan = shipped("queue");
        plan.reporting.warm_up_s = 200.0;
        assert!(plan.check().unwrap_err().to_string().contains("leaves nothing of `exit-1`, which has 150 s"));
    }
}

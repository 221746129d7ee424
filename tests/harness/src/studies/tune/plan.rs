//! Which simulated recordings parameters are found on, and which they are judged on (TOML).

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use serde::{Deserialize, Serialize};

use crate::evaluation::Settings;
use crate::recording::Recording;
use crate::studies::experiment::plan;
use crate::twin::scene::{Mount, Scene};
use crate::twin::simulate::Simulation;

/// Every unit that parameters are found for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub unit: Vec<Unit>,
    /// Folder of the file, which its paths start from.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// Recordings of one kind of place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unit {
    pub name: String,
    /// Start of each recording that is not counted, seconds.
    pub warm_up_s: f64,
    /// What is searched on.
    pub train: Vec<Run>,
    /// What is judged.
    pub report: Vec<Run>,
}

/// One recording: a scene, and what is other than in it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    pub scene: PathBuf,
    pub fcd: Option<PathBuf>,
    pub seed: Option<u64>,
    /// At most what the traffic lasts.
    pub duration_s: Option<f64>,
    /// Of the radar.
    pub mount: Option<Mount>,
}

impl Plan {
    /// # Errors
    /// File, line and key of what cannot be read; a unit without recordings or that is there twice, a recording that
    /// is both trained and judged on or there twice, a warm-up that leaves nothing.
    pub fn read(path: &Path) -> Result<Self> {
        plan::read(path, |plan: &mut Self, folder| {
            plan.folder = folder;
            plan.check()
        })
    }

    fn check(&self) -> Result<()> {
        let mut names = BTreeSet::new();
        for unit in &self.unit {
            let name = &unit.name;
            ensure!(names.insert(name), "two units are called `{name}`");
            ensure!(
                !unit.train.is_empty() && !unit.report.is_empty(),
                "`{name}` has nothing to train on, or nothing to judge"
            );
            let mut seeds = BTreeSet::new();
            for run in unit.train.iter().chain(&unit.report) {
                let scene = self.scene(run)?;
                let (file, seed, all) = (run.scene.display(), scene.seed, scene.duration_s);
                ensure!(seeds.insert(seed), "`{name}`: {file} has the seed {seed} of another recording");
                let warm_up = unit.warm_up_s;
                ensure!(
                    (0.0..all).contains(&warm_up),
                    "`{name}`: warm_up_s {warm_up} leaves nothing of {file}, which has {all} s"
                );
            }
        }
        Ok(())
    }

    /// The unit of a name.
    ///
    /// # Errors
    /// Says which there are.
    pub fn unit(&self, name: &str) -> Result<&Unit> {
        let all: Vec<&str> = self.unit.iter().map(|unit| unit.name.as_str()).collect();
        let found = self.unit.iter().find(|unit| unit.name == name);
        found.with_context(|| format!("the plan has no unit `{name}`, but {}", all.join(", ")))
    }

    fn scene(&self, run: &Run) -> Result<Scene> {
        let mut scene = Scene::read(&self.folder.join(&run.scene))?;
        scene.seed = run.seed.unwrap_or(scene.seed);
        scene.duration_s = run.duration_s.unwrap_or(scene.duration_s);
        scene.radar.mount = run.mount.unwrap_or(scene.radar.mount);
        // what does not change what the radar sees
        scene.camera = None;
        scene.further_radars.clear();
        scene.check().with_context(|| run.scene.display().to_string())?;
        Ok(scene)
    }

    /// Every file that is read for a unit, beside the plan.
    ///
    /// # Errors
    /// Those of the scenes.
    pub fn files(&self, unit: &Unit) -> Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for run in unit.train.iter().chain(&unit.report) {
            files.push(self.folder.join(&run.scene));
            files.extend(self.scene(run)?.files(self.fcd(run).as_deref())?);
        }
        Ok(files)
    }

    /// Simulates one recording, named after its scene and its seed. `progress` is called after each frame.
    ///
    /// # Errors
    /// Those of the scene and of its traffic.
    pub fn recording(&self, run: &Run, settings: &Settings, progress: &(dyn Fn() + Sync)) -> Result<Recording> {
        let scene = self.scene(run)?;
        let name = format!("{}-{}", plan::name(&run.scene), scene.seed);
        let simulation = Simulation::new(scene, self.fcd(run).as_deref())?;
        plan::recorded(&simulation, &name, settings, progress).map(|(_, recording)| recording)
    }

    /// Frames of a recording.
    ///
    /// # Errors
    /// Those of the scene.
    pub fn frames(&self, run: &Run) -> Result<u64> {
        let scene = self.scene(run)?;
        Ok((scene.duration_s * scene.radar.rate_hz).ceil() as u64)
    }

    fn fcd(&self, run: &Run) -> Option<PathBuf> {
        run.fcd.as_ref().map(|fcd| self.folder.join(fcd))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shipped() -> Plan {
        Plan::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/tuning.toml")).unwrap()
    }

    #[test]
    fn the_shipped_plan_judges_seeds_that_nothing_was_tuned_on_and_other_mounts() {
        let plan = shipped();
        let units: Vec<&str> = plan.unit.iter().map(|u| u.name.as_str()).collect();
        assert_eq!(units, ["motorway", "crossing", "crossing-place", "queue"]);
        for unit in &plan.unit {
            assert!(plan.files(unit).unwrap().iter().all(|file| file.exists()));
            let mounts =
                |runs: &[Run]| -> Vec<Mount> { runs.iter().map(|run| plan.scene(run).unwrap().radar.mount).collect() };
            let (train, report) = (mounts(&unit.train), mounts(&unit.report));
            let unseen = report.iter().filter(|mount| !train.contains(mount)).count();
            let (least, most) = if unit.name == "crossing-place" { (0, 0) } else { (4, report.len()) };
            assert!((least..=most).contains(&unseen), "{}: {unseen}", unit.name);
        }
    }

    #[test]
    fn a_mount_is_other_than_the_scenes_only_where_the_plan_says_so() {
        let plan = shipped();
        let train = &plan.unit("queue").unwrap().train;
        let mounts: Vec<f64> = train.iter().map(|run| plan.scene(run).unwrap().radar.mount.y_m).collect();
        assert_eq!((mounts[0], mounts[3]), (-17.5, 17.5));
        assert!(plan.unit("tunnel").unwrap_err().to_string().contains("but motorway, crossing, crossing-place, queue"));
    }

    #[test]
    fn nothing_is_judged_that_was_trained_on() {
        let refused = |change: &dyn Fn(&mut Plan)| {
            let mut plan = shipped();
            change(&mut plan);
            format!("{:#}", plan.check().unwrap_err())
        };
        assert!(refused(&|p| p.unit[0].report[0].seed = Some(9003)).contains("has the seed 9003 of another recording"));
        assert!(refused(&|p| p.unit[1].report.clear()).contains("`crossing` has nothing to train on"));
        assert!(refused(&|p| p.unit[3].warm_up_s = 90.0).contains("leaves nothing of queue/train-1.toml"));
        assert!(refused(&|p| p.unit[3].name = "motorway".into()).contains("two units are called `motorway`"));
        assert!(refused(&|p| p.unit[0].train[2].mount.as_mut().unwrap().height_m = -1.0).contains("height_m"));
    }
}

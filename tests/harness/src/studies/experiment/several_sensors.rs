//! Two sensors on one road, each alone and fused: two radars at a crossing, or a radar and a camera on a gantry.
//!
//! Both sensors look at the same traffic at the same time, and are judged as any [set](crate::evaluation::sensor_set)
//! is. Then each watches the other.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::monitoring::turned::{self, Turned};
use super::monitoring::{self, Follows};
use super::plan;
use crate::evaluation::Settings;
use crate::evaluation::sensor_set::{self, Judged, SensorSet};
use crate::twin::scene::{FurtherRadar, Scene};
use crate::twin::simulate::Simulation;

/// What is simulated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Start of each site that is not counted, seconds.
    pub warm_up_s: f64,
    /// Otherwise sensors are watched only, which is faster.
    #[serde(default = "yes")]
    pub judged: bool,
    /// Otherwise sensors are watched in order only, which is faster: for long runs.
    #[serde(default = "yes")]
    pub broken: bool,
    pub site: Vec<Site>,
    /// Folder of the file.
    #[serde(skip)]
    pub folder: PathBuf,
}

fn yes() -> bool {
    true
}

/// A scene and its second sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Site {
    /// Scene file, seen from the plan's folder as all paths here; its radar is the first sensor.
    pub scene: PathBuf,
    /// In place of the scene's own.
    pub fcd: Option<PathBuf>,
    /// In place of the scene's own.
    pub seed: u64,
    /// In place of the scene's own.
    pub duration_s: Option<f64>,
    /// A second radar like the first; without it the scene's camera is the second sensor.
    pub second_radar: Option<FurtherRadar>,
    /// A third one, which watches with them.
    pub third_radar: Option<FurtherRadar>,
}

impl Site {
    /// The scene's, and the traffic's where that is not its own.
    pub fn name(&self) -> String {
        let scene = self.scene.file_stem().unwrap_or_default().to_string_lossy();
        self.fcd.as_ref().map_or(scene.to_string(), |fcd| format!("{scene}, {}", plan::name(fcd)))
    }
}

impl Plan {
    /// Reads a plan.
    ///
    /// # Errors
    /// File, line and key of what cannot be read; no site, a seed twice, a warm-up that leaves nothing.
    pub fn read(path: &Path) -> Result<Self> {
        plan::read(path, |plan: &mut Self, folder| {
            plan.folder = folder;
            plan.check()
        })
    }

    fn check(&self) -> Result<()> {
        ensure!(!self.site.is_empty(), "no [[site]]");
        for (k, site) in self.site.iter().enumerate() {
            let name = site.scene.display();
            ensure!(self.site[..k].iter().all(|s| s.seed != site.seed), "{name}: seed {} is named twice", site.seed);
            let scene = self.scene(site)?;
            let (warm_up, all) = (self.warm_up_s, scene.duration_s);
            ensure!(warm_up >= 0.0 && warm_up < all, "warm_up_s {warm_up} leaves nothing of {name}, which has {all} s");
        }
        Ok(())
    }

    fn scene(&self, site: &Site) -> Result<Scene> {
        let mut scene = Scene::read(&self.folder.join(&site.scene))?;
        scene.seed = site.seed;
        scene.duration_s = site.duration_s.unwrap_or(scene.duration_s);
        if let Some(second) = &site.second_radar {
            scene.further_radars = [second.clone()].into_iter().chain(site.third_radar.clone()).collect();
            scene.camera = None;
        } else {
            scene.further_radars.clear();
            ensure!(scene.camera.is_some(), "{}: neither second_radar nor a camera in the scene", site.scene.display());
        }
        scene.check().with_context(|| site.scene.display().to_string())?;
        Ok(scene)
    }

    /// Every file that is read, beside the plan.
    ///
    /// # Errors
    /// Those of the scenes.
    pub fn files(&self) -> Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for site in &self.site {
            let fcd = site.fcd.as_ref().map(|fcd| self.folder.join(fcd));
            files.push(self.folder.join(&site.scene));
            files.extend(self.scene(site)?.files(fcd.as_deref())?);
        }
        Ok(files)
    }

    /// Calls of `progress` by [`run`].
    ///
    /// # Errors
    /// Those of the scenes.
    pub fn steps(&self) -> Result<u64> {
        let steps = |site: &Site| -> Result<u64> {
            let scene = self.scene(site)?;
            let frames = (scene.duration_s * scene.radar.rate_hz).ceil() as u64;
            let sensors = 2 + u64::from(site.third_radar.is_some());
            // looked at; each sensor's samples, each sensor twice, and fused
            Ok(frames * if self.judged { 2 + 3 * sensors } else { 1 })
        };
        self.site.iter().map(steps).sum()
    }
}

/// One site, or all of them pooled.
#[derive(Debug)]
pub struct Counted {
    pub name: String,
    /// None where sensors were watched only.
    pub set: Option<SensorSet>,
    pub watched: Watched,
}

/// What monitors said.
#[derive(Debug, Clone, Copy, Default)]
pub struct Watched {
    /// Each sensor, with faults that come while it runs.
    pub judged: monitoring::Judged,
    /// With mounts that are wrong from the first day.
    pub turned: Turned,
}

struct SiteResult {
    name: String,
    judged: Option<Judged>,
    watched: Watched,
}

/// Simulates and judges every site; the pooled result comes first. `every`-th frames are judged. `keep` is given each
/// site's name and what it is recorded with.
///
/// # Errors
/// Those of the scenes, the traffic and of the estimators' parameters.
pub fn run(
    plan: &Plan,
    settings: &Settings,
    every: usize,
    keep: &dyn Fn(&str, &Simulation) -> Result<()>,
    progress: &(dyn Fn() + Sync),
) -> Result<Vec<Counted>> {
    let mut settings = settings.clone();
    settings.evaluation.warm_up_s = plan.warm_up_s;
    let one = |site: &Site| {
        site_of(plan, site, &settings, every, keep, progress).with_context(|| format!("site {}", site.scene.display()))
    };
    let sites = plan.site.iter().map(one).collect::<Result<Vec<_>>>()?;
    let counted = |name: &str, sites: &[&SiteResult]| {
        let judged: Option<Vec<&Judged>> = sites.iter().map(|site| site.judged.as_ref()).collect();
        let set = judged.and_then(|judged| SensorSet::pooled(name, &judged, &settings.evaluation));
        let mut watched = Watched::default();
        for site in sites {
            watched.judged += site.watched.judged;
            watched.turned += site.watched.turned;
        }
        Counted { name: name.to_owned(), set, watched }
    };
    let all: Vec<&SiteResult> = sites.iter().collect();
    let pooled = std::iter::once(counted("pooled", &all));
    Ok(pooled.chain(all.iter().map(|site| counted(&site.name, &[site]))).collect())
}

fn site_of(
    plan: &Plan,
    site: &Site,
    settings: &Settings,
    every: usize,
    keep: &dyn Fn(&str, &Simulation) -> Result<()>,
    progress: &(dyn Fn() + Sync),
) -> Result<SiteResult> {
    let fcd = site.fcd.as_ref().map(|fcd| plan.folder.join(fcd));
    let scene = plan.scene(site)?;
    let has_net = scene.traffic.as_ref().is_some_and(|traffic| traffic.net.is_some());
    let lanes = turned::pieces(&if has_net { scene.lanes()? } else { Vec::new() });
    let simulation = Simulation::new(scene, fcd.as_deref())?;
    let name = site.name();
    keep(&name, &simulation)?;
    let range_m = f64::from(settings.estimators.camera_3d.range_max_m);
    let all = simulation.recordings(range_m, progress)?;
    let judged = plan.judged.then(|| sensor_set::judge(&all, settings, every, progress)).transpose()?;
    let follows: Vec<Follows> = all.par_iter().map(|r| monitoring::follow(r, settings)).collect::<Result<_>>()?;
    let watched = Watched {
        judged: monitoring::judge(&all, &follows, &lanes, settings, plan.broken)?,
        turned: turned::compare(&all, &follows, &lanes, settings, plan.broken)?,
    };
    Ok(SiteResult { name, judged, watched })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shipped(name: &str) -> Plan {
        Plan::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings").join(name)).unwrap()
    }

    #[test]
    fn the_shipped_plans_are_those_that_were_fixed() {
        let fixed = |name: &str| -> Vec<(String, u64, bool)> {
            let plan = shipped(name);
            assert!(plan.files().unwrap().iter().all(|f| f.exists()));
            plan.site.iter().map(|s| (s.scene.display().to_string(), s.seed, s.second_radar.is_some())).collect()
        };
        let crossings = ["wide-1", "wide-2", "skewed-1", "tee-1"];
        let radars: Vec<_> =
            crossings.iter().zip(5101..).map(|(s, seed)| (format!("crossing/{s}.toml"), seed, true)).collect();
        assert_eq!(fixed("two-radars.toml"), radars);
        let camera: Vec<_> = (5201..5206).map(|seed| ("motorway.toml".to_owned(), seed, false)).collect();
        assert_eq!(fixed("radar-camera.toml"), camera);
        let long: Vec<_> = (5301..5306).map(|seed| ("motorway.toml".to_owned(), seed, false)).collect();
        assert_eq!(fixed("monitoring-motorway.toml"), long);
        let queues = ["exit-1", "exit-2", "waves-1", "waves-2"];
        let queues: Vec<_> =
            queues.iter().zip(5401..).map(|(s, seed)| (format!("queue/{s}.toml"), seed, true)).collect();
        assert_eq!(fixed("monitoring-queues.toml"), queues);
        let three = ["crossing/wide-1", "crossing/wide-2", "motorway", "motorway"];
        let three: Vec<_> = three.iter().zip(5501..).map(|(s, seed)| (format!("{s}.toml"), seed, true)).collect();
        assert_eq!(fixed("three-radars.toml"), three);
        // what is tuned on is none of these
        let training = shipped("monitoring-train.toml");
        assert!(training.site.iter().all(|site| (6101..6200).contains(&site.seed)));
    }
}

//! Two sensors on one road, each alone and fused: two radars at a crossing, or a radar and a camera on a gantry.
//!
//! Both sensors look at the same traffic at the same time. Each is judged alone, on what lies in its own view; the fused map is judged
//! on what lies in either's, and an object is detected if either detects it. Beside the rates stands what the set shows of the
//! road and what each sensor shows of the same: cells seen, and objects detected.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::monitoring::{self, Worth};
use super::pair::{estimator, newest};
use super::plan;
use crate::estimators::{Estimator, fused};
use crate::evaluation::counts::rate;
use crate::evaluation::pool::{Seconds, pool};
use crate::evaluation::replay::Replay;
use crate::evaluation::samples::{self, Cell, FrameSamples, Sample};
use crate::evaluation::score::{Score, score};
use crate::evaluation::{Settings, camera as judged};
use crate::recording::camera::RecordedCamera;
use crate::recording::problems::Problems;
use crate::recording::truth::Truth;
use crate::recording::{Frame, Recording};
use crate::twin::scene::{Look, Mount, RadarSection, Scene};
use crate::twin::simulate::Simulation;

/// What is simulated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Start of each site that is not counted, seconds.
    pub warm_up_s: f64,
    pub site: Vec<Site>,
    /// Folder of the file.
    #[serde(skip)]
    pub folder: PathBuf,
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
    pub second_radar: Option<Second>,
}

/// Where the second radar hangs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Second {
    pub name: String,
    pub mount: Mount,
}

/// Draws of the second radar are its own: its frames have numbers no frame of the first has.
const SECOND: u64 = 1 << 32;

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
        if site.second_radar.is_some() {
            scene.camera = None;
        } else {
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
        // looked at, each sensor's samples, each sensor twice, fused
        let frames = |site| Ok((self.scene(site)?.duration_s * self.scene(site)?.radar.rate_hz).ceil() as u64);
        self.site.iter().map(|site| frames(site).map(|n: u64| 8 * n)).sum()
    }
}

/// What a set of sensors shows of a road, or one of them alone.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Shown {
    /// Object-time-steps in any sensor's view.
    pub objects: u64,
    /// Of them detected.
    pub detected: u64,
    /// Road cells in any sensor's view.
    pub cells: u64,
    /// Of them in exact sight.
    pub in_sight: u64,
    /// Of them called visible.
    pub visible: u64,
    /// Called visible and in exact sight.
    pub rightly: u64,
}

impl std::ops::AddAssign for Shown {
    fn add_assign(&mut self, o: Self) {
        self.objects += o.objects;
        self.detected += o.detected;
        self.cells += o.cells;
        self.in_sight += o.in_sight;
        self.visible += o.visible;
        self.rightly += o.rightly;
    }
}

impl Shown {
    /// Share of the objects that are detected.
    pub fn coverage(&self) -> Option<f64> {
        rate(self.detected, self.objects)
    }

    /// Share of the road that is not called visible.
    pub fn hidden(&self) -> Option<f64> {
        rate(self.cells - self.visible, self.cells)
    }

    /// Share of the road that is not in exact sight.
    pub fn truly_hidden(&self) -> Option<f64> {
        rate(self.cells - self.in_sight, self.cells)
    }
}

/// One site, or all of them pooled.
#[derive(Debug)]
pub struct Counted {
    pub name: String,
    /// The first sensor, the second, both fused: each judged on its own road.
    pub rows: Vec<(String, Replay)>,
    /// In the same order, all on the road of the set.
    pub shown: Vec<Shown>,
    /// Each sensor watched by the other.
    pub watched: Worth,
}

struct SiteResult {
    name: String,
    rows: Vec<(String, Seconds)>,
    shown: Vec<Shown>,
    watched: Worth,
}

/// Simulates and judges every site; the pooled result comes first. `every`-th frames are judged.
///
/// # Errors
/// Those of the scenes, the traffic and of the estimators' parameters.
pub fn run(plan: &Plan, settings: &Settings, every: usize, progress: &(dyn Fn() + Sync)) -> Result<Vec<Counted>> {
    let mut settings = settings.clone();
    settings.evaluation.warm_up_s = plan.warm_up_s;
    let one = |site: &Site| {
        site_of(plan, site, &settings, every, progress).with_context(|| format!("site {}", site.scene.display()))
    };
    let sites = plan.site.iter().map(one).collect::<Result<Vec<_>>>()?;
    let counted = |name: &str, sites: &[&SiteResult]| -> Option<Counted> {
        let first = sites.first()?;
        let row = |k: usize| {
            let parts: Vec<&Seconds> = sites.iter().map(|s| &s.rows[k].1).collect();
            // the warm-up is left out of the samples
            Some((first.rows[k].0.clone(), pool(name, &parts, 0.0, &settings.evaluation)?))
        };
        let rows = (0..first.rows.len()).map(row).collect::<Option<Vec<_>>>()?;
        let mut shown = vec![Shown::default(); first.shown.len()];
        sites.iter().for_each(|site| shown.iter_mut().zip(&site.shown).for_each(|(sum, one)| *sum += *one));
        let mut watched = Worth::default();
        for site in sites {
            watched.iter_mut().zip(site.watched).for_each(|(sum, one)| *sum += one);
        }
        Some(Counted { name: name.to_owned(), rows, shown, watched })
    };
    let all: Vec<&SiteResult> = sites.iter().collect();
    let pooled = counted("pooled", &all).into_iter();
    Ok(pooled.chain(all.iter().filter_map(|site| counted(&site.name, &[site]))).collect())
}

/// Both sensors' recordings of the same traffic.
fn recordings(plan: &Plan, site: &Site, settings: &Settings, progress: &(dyn Fn() + Sync)) -> Result<[Recording; 2]> {
    let scene = plan.scene(site)?;
    let fcd = site.fcd.as_ref().map(|fcd| plan.folder.join(fcd));
    let second = site.second_radar.as_ref().map(|second| RadarSection {
        name: second.name.clone(),
        mount: second.mount,
        ..scene.radar.clone()
    });
    let mut looks = scene.looks();
    looks.extend(second.as_ref().map(|second| Look::new(&second.mount, second.field_of_view.azimuth_deg)));
    let simulation = Simulation::seen_by(scene.clone(), fcd.as_deref(), &looks)?;
    let radar = second.as_ref().map(RadarSection::radar);
    let steps = (0..simulation.frames()).into_par_iter().map(|number| {
        progress();
        let step = simulation.step(number)?;
        let since_s = number as f64 / scene.radar.rate_hz;
        let detections = radar.as_ref().map(|radar| simulation.scan(radar, since_s, number + SECOND));
        let frame = detections.map(|detections| Frame { time_ns: step.time_ns, detections, refused: 0 });
        Ok((step, frame))
    });
    let (mut own, mut others, mut labels) = (Vec::new(), Vec::new(), Vec::new());
    for (step, frame) in steps.collect::<Result<Vec<_>>>()? {
        labels.extend(step.labels);
        own.extend(step.radar);
        others.extend(frame);
    }
    let truth = Some(Truth::new(labels));
    let first = Recording {
        name: scene.radar.name.clone(),
        sensor: simulation.sensor(),
        pose: simulation.radar.pose,
        frames: own,
        truth: truth.clone(),
        occlusion: Default::default(),
        camera: None,
        problems: Problems::default(),
    };
    let other = match (&second, &radar, &scene.camera) {
        (Some(section), Some(radar), _) => Recording {
            name: section.name.clone(),
            sensor: crate::recording::Sensor { name: section.name.clone(), ..first.sensor.clone() },
            pose: radar.pose,
            frames: others,
            ..first.clone()
        },
        (_, _, Some(section)) => {
            let camera = section.camera();
            let frames = (0..simulation.camera_frames())
                .into_par_iter()
                .map(|number| simulation.camera_step(&camera, section.rate_hz, number))
                .collect::<Result<Vec<_>>>()?;
            let recorded = RecordedCamera { pose: camera.pose, intrinsics: camera.intrinsics, frames, alone: true };
            let range_m = f64::from(settings.estimators.camera_3d.range_max_m);
            recorded.alone(section.name.clone(), first.sensor.clone(), truth, range_m)
        }
        _ => anyhow::bail!("no second sensor"),
    };
    Ok([first, other])
}

fn site_of(
    plan: &Plan,
    site: &Site,
    settings: &Settings,
    every: usize,
    progress: &(dyn Fn() + Sync),
) -> Result<SiteResult> {
    let both = recordings(plan, site, settings, progress)?;
    let evaluation = &settings.evaluation;
    let share = f64::from(settings.estimators.camera_3d.visible_share);
    let samples: Vec<Vec<FrameSamples>> = both
        .iter()
        .map(|recording| match recording.of_camera() {
            // its frames come at times of their own
            Some(_) => judged::samples(recording, share, evaluation, 1, progress),
            None => samples::collect_every(recording, evaluation, every, progress),
        })
        .collect();
    let [first, second] = &both;
    let union = union(&both, &samples);
    let grid = evaluation.grid;
    let judge = |running: &mut dyn Estimator, recording: &Recording, samples: &[FrameSamples]| {
        score(running, recording, samples, grid, &|| progress())
    };
    let alone: Vec<Score> = both
        .par_iter()
        .zip(&samples)
        .map(|(recording, samples)| Ok(judge(&mut *estimator(recording, settings)?, recording, samples)))
        .collect::<Result<_>>()?;
    // both on the road of the set, at the first sensor's times, and fused
    let mut running: Vec<Box<dyn Estimator>> = Vec::new();
    for members in [&both[..1], &both[1..], &both[..]] {
        let members = members.iter().map(|r| Ok((estimator(r, settings)?, r.frames.clone())));
        running.push(fused::new(members.collect::<Result<_>>()?, &road(&union), every)?);
    }
    let on_the_set: Vec<Score> = running.par_iter_mut().map(|e| judge(&mut **e, first, &union)).collect();

    let mut shown: Vec<Shown> = on_the_set.iter().map(called).collect();
    for (k, shown) in shown.iter_mut().enumerate() {
        let members = if k < 2 { k..k + 1 } else { 0..2 };
        count(shown, &both, &samples, &union, members);
    }
    let mut rows = Vec::new();
    for ((recording, samples), own) in both.iter().zip(&samples).zip(alone) {
        rows.push((own.name.clone(), Seconds::new(recording.clone(), samples, vec![own])));
    }
    let fused = on_the_set.into_iter().nth(2).context("three rows")?;
    rows.push((fused.name.clone(), Seconds::new(first.clone(), &union, vec![fused])));
    let names = [&first.name, &second.name];
    rows.iter_mut().zip(names).for_each(|((row, _), sensor)| *row = format!("{row}, {sensor}"));
    let name = site.scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let name = site.fcd.as_ref().map_or(name.clone(), |fcd| format!("{name}, {}", plan::name(fcd)));
    let watched = monitoring::watch(&both, settings)?;
    Ok(SiteResult { name, rows, shown, watched })
}

/// What the set is judged on at each of the first sensor's frames: all objects and cells that any sensor is judged on.
fn union(both: &[Recording; 2], samples: &[Vec<FrameSamples>]) -> Vec<FrameSamples> {
    let Some(truth) = &both[0].truth else { return Vec::new() };
    let of_frame = |(frame, own): (&Frame, &FrameSamples)| {
        if !own.counted {
            return FrameSamples::default();
        }
        let seen: Vec<&FrameSamples> = both
            .iter()
            .zip(samples)
            .filter_map(|(recording, samples)| samples.get(newest(recording, frame.time_ns)?))
            .collect();
        let mut objects: BTreeMap<usize, Sample> = BTreeMap::new();
        for sample in seen.iter().flat_map(|s| &s.objects) {
            let known = objects.entry(sample.track).or_insert_with(|| sample.clone());
            known.detections = known.detections.max(sample.detections);
            known.detected |= sample.detected;
            known.slice_in_sight |= sample.slice_in_sight;
            known.box_in_sight |= sample.box_in_sight;
        }
        // where they are now, whatever the age of the frame they are known from
        let now = truth.at(frame.time_ns);
        for object in &now {
            if let Some(sample) = objects.get_mut(&object.track) {
                sample.solid = object.solid;
                sample.cells = object.solid.cells().collect();
            }
        }
        let taken: BTreeSet<Cell> = now.iter().flat_map(|o| o.solid.cells()).collect();
        let mut cells: BTreeMap<Cell, bool> = BTreeMap::new();
        for (cell, in_sight) in seen.iter().flat_map(|s| &s.cells).filter(|(cell, _)| !taken.contains(cell)) {
            *cells.entry(*cell).or_default() |= in_sight;
        }
        FrameSamples { counted: true, objects: objects.into_values().collect(), cells: cells.into_iter().collect() }
    };
    both[0].frames.par_iter().zip(&samples[0]).map(of_frame).collect()
}

/// Every cell that is judged.
fn road(samples: &[FrameSamples]) -> Vec<Cell> {
    let cells =
        samples.iter().flat_map(|s| s.cells.iter().map(|c| c.0).chain(s.objects.iter().flat_map(|o| o.cells.clone())));
    cells.collect::<BTreeSet<_>>().into_iter().collect()
}

/// What a map calls visible of the road.
fn called(score: &Score) -> Shown {
    let c = score.cell_counts();
    let rightly = c.clear - c.clear_not_visible;
    Shown { cells: c.blocked + c.clear, visible: c.blocked_visible + rightly, ..Shown::default() }
}

/// What some of the sensors detect of the set's objects, and have in exact sight of its cells.
fn count(
    shown: &mut Shown,
    both: &[Recording; 2],
    samples: &[Vec<FrameSamples>],
    union: &[FrameSamples],
    members: std::ops::Range<usize>,
) {
    for (frame, all) in both[0].frames.iter().zip(union).filter(|(_, all)| all.counted) {
        let own: Vec<&FrameSamples> =
            members.clone().filter_map(|k| samples[k].get(newest(&both[k], frame.time_ns)?)).collect();
        let detected: BTreeSet<usize> =
            own.iter().flat_map(|s| &s.objects).filter(|o| o.detected).map(|o| o.track).collect();
        shown.objects += all.objects.len() as u64;
        shown.detected += all.objects.iter().filter(|o| detected.contains(&o.track)).count() as u64;
        let sight: BTreeSet<Cell> = own.iter().flat_map(|s| &s.cells).filter(|c| c.1).map(|c| c.0).collect();
        shown.in_sight += all.cells.iter().filter(|c| sight.contains(&c.0)).count() as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::by_hand::{frames, recording, sample};

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
    }

    #[test]
    fn the_set_sees_and_detects_what_any_of_them_does() {
        // the second sensor's frames lie 40 ms before the first one's
        let mut both = [recording(3, 3), recording(3, 3)];
        both[1].frames.iter_mut().for_each(|f| f.time_ns -= 40_000_000);
        let mut first = frames((0..3).map(|_| vec![sample(0, 40.0, false, false), sample(1, 60.0, true, true)]));
        let mut second = frames((0..3).map(|_| vec![sample(0, 40.0, true, true), sample(2, 90.0, false, false)]));
        first.iter_mut().for_each(|f| f.cells = vec![((20, 9), false), ((21, 9), true)]);
        second.iter_mut().for_each(|f| f.cells = vec![((20, 9), true), ((22, 9), false)]);
        first[0].counted = false;
        let samples = vec![first, second];
        let set = union(&both, &samples);
        assert!(!set[0].counted && set[1].counted);
        let objects: Vec<(usize, bool, bool)> =
            set[1].objects.iter().map(|o| (o.track, o.detected, o.slice_in_sight)).collect();
        assert_eq!(objects, [(0, true, true), (1, true, true), (2, false, false)]);
        assert_eq!(set[1].cells, [((20, 9), true), ((21, 9), true), ((22, 9), false)]);
        let shown = |members| {
            let mut shown = Shown::default();
            count(&mut shown, &both, &samples, &set, members);
            [shown.objects, shown.detected, shown.in_sight]
        };
        assert_eq!([shown(0..1), shown(1..2), shown(0..2)], [[6, 2, 2], [6, 2, 2], [6, 4, 4]]);
        // a camera that stopped long ago says nothing any more
        assert_eq!(newest(&both[1], 10_000_000_000), None);
    }
}

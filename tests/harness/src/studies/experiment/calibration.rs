//! Probabilities fitted on some days of a unit and judged on others.
//!
//! A [`Plan`] names units, each a scene with its mount, and days of traffic to fit on and to judge on. A recording that
//! is given as well is fitted on the first half of its frames and judged on the second.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::plan::{self, Day};
use crate::estimators;
use crate::evaluation::Settings;
use crate::evaluation::bootstrap::{Draws, Interval};
use crate::evaluation::calibration::{Bin, ByTrack, Metrics, diagram};
use crate::evaluation::probability::Threshold;
use crate::evaluation::probability::file::Fitted;
use crate::evaluation::probability::fit;
use crate::evaluation::probability::risk::{self, Kept};
use crate::evaluation::probability::samples::{Places, fingerprint};
use crate::evaluation::samples::{self, FrameSamples};
use crate::evaluation::score::{Score, score};
use crate::recording::Recording;
use crate::twin::scene::Scene;
use crate::twin::simulate::Simulation;

/// Risks that are asked for.
pub const RISKS: [f64; 3] = [0.05, 0.1, 0.2];

/// Which units there are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub unit: Vec<UnitPlan>,
    /// Folder of the file, which its paths start from.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// One unit: a mount, and the days of its traffic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnitPlan {
    pub name: String,
    pub scene: PathBuf,
    /// Length of each day's recording, seconds.
    pub duration_s: f64,
    /// Start of each day that is not counted, seconds.
    pub warm_up_s: f64,
    /// What the table is fitted on.
    pub fit: Vec<Day>,
    /// What it is judged on.
    pub report: Vec<Day>,
}

impl Plan {
    /// # Errors
    /// File, line and key of what cannot be read; a unit without days, a day or a seed that is there twice.
    pub fn read(path: &Path) -> Result<Self> {
        plan::read(path, |plan: &mut Self, folder| {
            plan.folder = folder;
            plan.check()
        })
    }

    fn check(&self) -> Result<()> {
        let (mut names, mut traffic, mut seeds) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
        for unit in &self.unit {
            let name = &unit.name;
            ensure!(names.insert(name), "two units are called `{name}`");
            ensure!(
                !unit.fit.is_empty() && !unit.report.is_empty(),
                "`{name}` has no days to fit on, or none to judge"
            );
            ensure!(
                unit.warm_up_s >= 0.0 && unit.warm_up_s < unit.duration_s,
                "`{name}`: warm_up_s {} leaves nothing of {} s",
                unit.warm_up_s,
                unit.duration_s
            );
            for day in unit.fit.iter().chain(&unit.report) {
                let fcd = day.fcd.display();
                ensure!(traffic.insert(&day.fcd), "`{fcd}` is there twice: nothing is judged that was fitted on");
                ensure!(seeds.insert(day.seed), "`{fcd}` has the seed {} of another day", day.seed);
            }
        }
        Ok(())
    }

    /// Every file that is read beside its own.
    ///
    /// # Errors
    /// Those of the scenes.
    pub fn files(&self) -> Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for unit in &self.unit {
            let path = self.folder.join(&unit.scene);
            let scene = Scene::read(&path)?;
            files.push(path);
            for day in unit.fit.iter().chain(&unit.report) {
                files.extend(scene.files(Some(&self.folder.join(&day.fcd)))?);
            }
        }
        Ok(files)
    }

    /// Calls of `progress` by [`run`].
    ///
    /// # Errors
    /// Those of the scenes.
    pub fn steps(&self) -> Result<u64> {
        let of = |unit: &UnitPlan| -> Result<u64> {
            let rate_hz = Scene::read(&self.folder.join(&unit.scene))?.radar.rate_hz;
            // simulated, sampled, and estimated
            Ok((unit.duration_s * rate_hz).ceil() as u64 * 3 * (unit.fit.len() + unit.report.len()) as u64)
        };
        self.unit.iter().map(of).sum()
    }

    fn simulation(&self, unit: &UnitPlan, day: &Day) -> Result<Simulation> {
        let mut scene = Scene::read(&self.folder.join(&unit.scene))?;
        scene.seed = day.seed;
        scene.duration_s = unit.duration_s;
        scene.camera = None;
        Simulation::new(scene, Some(&self.folder.join(&day.fcd)))
    }
}

/// What a set of days has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Extent {
    /// 1 for a half of a recording.
    pub days: usize,
    pub units: usize,
    /// What units are, `tracks` or `frames`.
    pub kind: &'static str,
    pub samples: usize,
}

/// A figure and its interval by tracks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Figure {
    pub value: Option<f64>,
    pub interval: Option<Interval>,
}

/// What one predictor is worth.
#[derive(Debug, Clone, Serialize)]
pub struct Predictor {
    pub name: &'static str,
    pub metrics: Metrics,
    pub ece: Figure,
    pub ks: Figure,
    /// Brier score less that of the base rate.
    pub against_base_rate: Figure,
    pub auc: Figure,
    pub two_sample_ks: Option<f64>,
}

/// What a risk that is asked for comes to.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Risk {
    pub asked: f64,
    pub threshold: Threshold,
    pub kept: Kept,
    pub interval: Option<Interval>,
}

/// One unit judged.
#[derive(Debug, Clone, Serialize)]
pub struct Judged {
    pub name: String,
    #[serde(skip)]
    pub fitted: Fitted,
    pub fit: Extent,
    pub report: Extent,
    /// The table, the grade as it is, and the fit without limits of size.
    pub predictors: Vec<Predictor>,
    /// Resolution of the table over that of the fit without limits.
    pub resolution_share: Figure,
    /// Area under the table's curve less that under the grade's.
    pub auc_gain: Figure,
    pub diagram: Vec<Bin>,
    pub diagram_of_grade: Vec<Bin>,
    pub risks: Vec<Risk>,
}

/// Simulates, fits and judges every unit. `progress` is called after each of [`Plan::steps`].
///
/// # Errors
/// Those of the scenes, the traffic and of the estimator's parameters; a unit in which nothing could be judged.
pub fn run(plan: &Plan, settings: &Settings, progress: &(dyn Fn() + Sync)) -> Result<Vec<Judged>> {
    let one = |unit: &UnitPlan| -> Result<Judged> {
        let day = |day: &Day| -> Result<(Places, u32)> {
            let (_, recording) = plan::recorded(&plan.simulation(unit, day)?, &day.name(), settings, progress)?;
            let mut settings = settings.clone();
            settings.evaluation.warm_up_s = unit.warm_up_s;
            let (samples, score) = scored(&recording, &settings, progress)?;
            Ok((Places::of(&recording, &samples, &score), fingerprint(&recording, &settings.estimators)?))
        };
        let days = |days: &[Day]| -> Result<Vec<(Places, u32)>> { days.par_iter().map(day).collect() };
        let (fit, report) = (days(&unit.fit)?, days(&unit.report)?);
        let configuration = fit.first().map_or(0, |(_, configuration)| *configuration);
        judge(&unit.name, joined(fit), joined(report), configuration, settings)
    };
    plan.unit.iter().map(|unit| one(unit).with_context(|| format!("unit `{}`", unit.name))).collect()
}

/// Fits on the first half of a recording's frames and judges on the second.
///
/// # Errors
/// A recording without labels, or with nothing to judge in one of its halves; those of the estimator's parameters.
pub fn run_halves(recording: &Recording, settings: &Settings, progress: &(dyn Fn() + Sync)) -> Result<Judged> {
    let name = &recording.name;
    ensure!(recording.truth.is_some(), "{name} has no labels: a probability needs to know what was missed");
    let (samples, score) = scored(recording, settings, progress)?;
    let half = samples.len() / 2;
    let of = |kept: &dyn Fn(usize) -> bool| {
        let part = |(k, frame): (usize, &FrameSamples)| if kept(k) { frame.clone() } else { FrameSamples::default() };
        let part: Vec<FrameSamples> = samples.iter().enumerate().map(part).collect();
        let mut score = score.clone();
        score.verdicts.iter_mut().enumerate().filter(|(k, _)| !kept(*k)).for_each(|(_, v)| v.clear());
        (1, Places::of(recording, &part, &score))
    };
    judge(name, of(&|k| k < half), of(&|k| k >= half), fingerprint(recording, &settings.estimators)?, settings)
}

fn scored(
    recording: &Recording,
    settings: &Settings,
    progress: &(dyn Fn() + Sync),
) -> Result<(Vec<FrameSamples>, Score)> {
    let samples = samples::collect(recording, &settings.evaluation, progress);
    ensure!(recording.of_camera().is_none(), "{} is of a camera; probabilities are of radars", recording.name);
    settings.estimators.has_tables()?;
    let mut estimator = estimators::own(recording, &settings.estimators)?;
    let score = score(estimator.as_mut(), recording, &samples, settings.evaluation.grid, &|| progress());
    Ok((samples, score))
}

fn joined(days: Vec<(Places, u32)>) -> (usize, Places) {
    let mut all = Places::default();
    let n = days.len();
    days.into_iter().for_each(|(places, _)| all.join(places));
    (n, all)
}

fn judge(
    name: &str,
    (fit_days, fit): (usize, Places),
    (report_days, report): (usize, Places),
    configuration: u32,
    settings: &Settings,
) -> Result<Judged> {
    let nothing = || format!("{name}: no object of known grade to fit on");
    let table = fit::table(&fit, configuration).with_context(nothing)?;
    let offline = fit::offline(&fit).with_context(nothing)?;
    let counted = fit::left_out(&fit).with_context(nothing)?;
    let said = report.said(|p| fit::look_up(&table, p));
    let (grade, unlimited) = (report.said(|p| p.grade), report.said(|p| offline.p(p)));
    let draws = Draws::new(said.tracks(), settings.evaluation.bootstrap, settings.evaluation.seed);
    let predictor = |name: &'static str, said: &ByTrack| -> Result<Predictor> {
        let metrics = Metrics::of(&said.total())
            .with_context(|| format!("nothing to judge in the days of the report: {name}"))?;
        let figure = |value: fn(&Metrics) -> Option<f64>| Figure {
            value: value(&metrics),
            interval: said.interval(&draws, value),
        };
        Ok(Predictor {
            name,
            metrics,
            ece: figure(|m| Some(m.ece)),
            ks: figure(|m| Some(m.ks)),
            against_base_rate: figure(|m| Some(m.against_base_rate())),
            auc: figure(|m| m.auc),
            two_sample_ks: said.two_sample_ks(),
        })
    };
    let predictors = vec![predictor("table", &said)?, predictor("grade", &grade)?, predictor("offline", &unlimited)?];
    let with = |other: usize, said_by: &ByTrack, value: fn(&Metrics, &Metrics) -> Option<f64>| Figure {
        value: value(&predictors[0].metrics, &predictors[other].metrics),
        interval: said.interval_with(said_by, &draws, value),
    };
    let risk = |asked: f64| {
        let threshold = risk::keeping(asked, &counted);
        let drawn = draws.iter().map(|times| Kept::of(threshold, &said.drawn(times)).risk);
        Risk { asked, threshold, kept: Kept::of(threshold, &said.total()), interval: Interval::of(drawn) }
    };
    let extent = |days, of: &Places| Extent { days, units: of.units, kind: of.kind, samples: of.all.len() };
    Ok(Judged {
        name: name.to_owned(),
        fit: extent(fit_days, &fit),
        report: extent(report_days, &report),
        resolution_share: with(2, &unlimited, |a, b| (b.resolution > 0.0).then(|| a.resolution / b.resolution)),
        auc_gain: with(1, &grade, |a, b| a.auc.zip(b.auc).map(|(a, b)| a - b)),
        diagram: diagram(&said.total()),
        diagram_of_grade: diagram(&grade.total()),
        risks: RISKS.map(risk).to_vec(),
        predictors,
        fitted: Fitted { table, counted },
    })
}

#[cfg(test)]
mod tests {
    use viewshed::probability::fitted_with;

    use super::*;
    use crate::evaluation::samples::made_up::{frames, recording, sample};

    fn shipped() -> Plan {
        Plan::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/calibration.toml")).unwrap()
    }

    #[test]
    fn the_shipped_plan_judges_ten_days_of_each_unit_that_nothing_was_fitted_on() {
        let plan = shipped();
        let units: Vec<&str> = plan.unit.iter().map(|u| u.name.as_str()).collect();
        assert_eq!(units, ["motorway", "crossing", "queue"]);
        assert!(plan.unit.iter().all(|u| u.report.len() == 10 && u.fit.len() == 4));
        assert!(plan.files().unwrap().iter().all(|file| file.exists()));
    }

    #[test]
    fn a_day_cannot_be_fitted_on_and_judged() {
        let refused = |change: &dyn Fn(&mut Plan)| {
            let mut plan = shipped();
            change(&mut plan);
            plan.check().unwrap_err().to_string()
        };
        let twice = refused(&|p| p.unit[0].report[0].fcd = p.unit[0].fit[1].fcd.clone());
        assert!(twice.contains("day-6.fcd.xml.gz` is there twice"), "{twice}");
        assert!(refused(&|p| p.unit[1].fit[0].seed = 7001).contains("has the seed 7001 of another day"));
        assert!(refused(&|p| p.unit[2].report.clear()).contains("`queue` has no days"));
        assert!(refused(&|p| p.unit[2].warm_up_s = 90.0).contains("leaves nothing of 90 s"));
    }

    /// Clear objects are detected in 19 of 20 frames, half hidden ones in every second, whatever the grade says.
    fn halves() -> ((usize, Places), (usize, Places)) {
        let of = |from: usize| {
            let objects = |k: usize| {
                let clear = (0..20).map(move |t| sample(t, 20.0 + t as f64, !(k + t).is_multiple_of(20), true));
                let hidden = (20..40).map(move |t| sample(t, 20.0 + t as f64, (k + t).is_multiple_of(2), false));
                clear.chain(hidden).collect()
            };
            let samples = frames((from..from + 40).map(objects));
            let score = crate::evaluation::score::made_up::score("radar-3d", &samples, |s| {
                Some(if s.slice_in_sight { 255 } else { 20 })
            });
            (1, Places::of(&recording(40, 40), &samples, &score))
        };
        (of(0), of(40))
    }

    #[test]
    fn a_table_is_calibrated_where_the_grade_is_not_and_keeps_the_risk() {
        let (fit, report) = halves();
        let mut settings = Settings::default();
        settings.evaluation.bootstrap = 100;
        let judged = judge("by-hand", fit, report, 7, &settings).unwrap();
        let [table, grade, _] = &judged.predictors[..] else { panic!("three predictors") };
        assert!(table.metrics.ece < 0.03 && grade.metrics.ece > 0.2, "{judged:?}");
        assert!(table.against_base_rate.interval.unwrap().1 < 0.0);
        assert!(judged.auc_gain.value.unwrap() > -1e-9 && judged.resolution_share.value.unwrap() > 0.95);
        // 1 in 20 of the clear ones; 11 in 40 of all
        assert!(matches!(judged.risks[1].threshold, Threshold::From(_)));
        assert!((judged.risks[1].kept.risk.unwrap() - 0.05).abs() < 1e-9, "{:?}", judged.risks);
        assert_eq!(judged.fitted.table.fingerprint(), fitted_with(7));
        assert_eq!((judged.report.units, judged.report.samples), (40, 1600));
    }
}

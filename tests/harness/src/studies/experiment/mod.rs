//! The paper's experiment on the digital twin: the same rows, over several days.
//!
//! A [`plan`] names the scene and the days; each day is simulated as a recording, read back like any other
//! and replayed. Counts are pooled over the reporting days, and every rate is kept by day for its spread.
//! [`scenes`] are crossings and queues, which have a mount each, [`gantry_camera`] is a camera's experiment,
//! [`several_sensors`] are two on one road; [`calibration`] fits probabilities and judges them.

pub mod calibration;
pub mod gantry_camera;
pub mod monitoring;
pub mod plan;
pub mod scenes;
pub mod several_sensors;

use anyhow::Result;

use crate::estimators;
use crate::evaluation::Settings;
use crate::evaluation::bounds::BOX;
use crate::evaluation::cells::CellCounts;
use crate::evaluation::counts::{Counts, rate};
use crate::evaluation::replay::Replay;
use crate::evaluation::summary::Row;
use plan::{Day, Plan};

/// A row of the paper's table, in per cent (arXiv 2211.06308: its own 60 s of motorway).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PaperRow {
    pub name: &'static str,
    /// Our row for the same method.
    pub ours: &'static str,
    pub tvr: f64,
    pub fvr: f64,
    pub fir: f64,
}

/// The paper's results.
pub const PAPER: [PaperRow; 4] = [
    PaperRow { name: "conventional 2D radar grid", ours: "radar-2d", tvr: 77.0, fvr: 61.0, fir: 23.0 },
    PaperRow { name: "3D radar grid", ours: "radar-3d", tvr: 83.0, fvr: 36.0, fir: 17.0 },
    PaperRow { name: "3D radar, perfect occupancy", ours: "true-boxes", tvr: 90.0, fvr: 31.0, fir: 10.0 },
    PaperRow { name: "3D camera grid", ours: "camera-3d", tvr: 93.0, fvr: 2.0, fir: 7.0 },
];
pub const PAPER_TRAJECTORIES: u32 = 41;
pub const PAPER_COVERAGE: f64 = 92.6;

/// One day replayed.
#[derive(Debug)]
pub struct DayResult {
    pub day: Day,
    pub replay: Replay,
}

/// Everything the experiment gave.
#[derive(Debug)]
pub struct Experiment {
    pub training: DayResult,
    pub reporting: Vec<DayResult>,
    pub pooled: Vec<Pooled>,
}

/// One estimator over all reporting days.
#[derive(Debug, Clone)]
pub struct Pooled {
    pub name: String,
    pub counts: Counts,
    pub cells: Option<CellCounts>,
}

impl Pooled {
    /// Rows of one estimator, summed.
    pub fn of(name: &str, rows: &[&Row]) -> Self {
        let mut pooled = Self { name: name.to_owned(), counts: Counts::default(), cells: None };
        for row in rows {
            pooled.counts += row.counts;
            if let Some(cells) = row.cells {
                *pooled.cells.get_or_insert_default() += cells;
            }
        }
        pooled
    }
}

impl DayResult {
    /// Share of the object-time-steps that no line of sight to the box reaches.
    pub fn hidden(&self) -> Option<f64> {
        self.replay.summary.row(BOX).and_then(|row| hidden(&row.counts))
    }
}

/// Share of object-time-steps that `geometry-box` calls invisible.
pub fn hidden(of_box: &Counts) -> Option<f64> {
    rate(of_box.ti + of_box.fi, of_box.total())
}

impl Experiment {
    /// Simulates and replays every day of the plan. `keep` is given the bytes of each day's recording.
    /// `progress` is called after each of [`total_steps`].
    ///
    /// # Errors
    /// Those of the scene, the traffic and of the estimators' parameters.
    pub fn run(
        plan: &Plan,
        settings: &Settings,
        keep: &dyn Fn(&Day, &[u8]) -> Result<()>,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        let one = |day: &Day| -> Result<DayResult> {
            let simulation = plan.simulation(day)?;
            let (bytes, recording) = plan::recorded(&simulation, &day.name(), settings, progress)?;
            keep(day, &bytes)?;
            let mut running = estimators::all(&recording, &settings.estimators)?;
            let replay = Replay::new(recording, &mut running, &settings.evaluation, progress);
            Ok(DayResult { day: day.clone(), replay })
        };
        let training = one(&plan.training)?;
        let reporting = plan.reporting.iter().map(one).collect::<Result<Vec<_>>>()?;
        let names = reporting.first().map(|d| &d.replay.summary.rows).into_iter().flatten().map(|r| r.name.clone());
        let pooled = names.map(|name| Pooled::of(&name, &rows(&reporting, &name))).collect();
        Ok(Self { training, reporting, pooled })
    }

    /// One estimator's rows, by reporting day.
    pub fn rows(&self, name: &str) -> Vec<&Row> {
        rows(&self.reporting, name)
    }

    pub fn pooled(&self, name: &str) -> Option<&Pooled> {
        self.pooled.iter().find(|p| p.name == name)
    }

    /// Share of detected object-time-steps, over all reporting days.
    pub fn coverage(&self) -> Option<f64> {
        self.pooled(BOX).and_then(|p| p.counts.coverage())
    }

    /// Distinct tracks counted, all days together.
    pub fn trajectories(&self) -> usize {
        self.reporting.iter().map(|d| d.replay.summary.objects).sum()
    }

    /// Counted frames, all days together.
    pub fn frames(&self) -> usize {
        self.reporting.iter().map(|d| d.replay.summary.frames).sum()
    }
}

fn rows<'a>(days: &'a [DayResult], name: &str) -> Vec<&'a Row> {
    days.iter().filter_map(|d| d.replay.summary.row(name)).collect()
}

/// Calls of `progress` by [`Experiment::run`].
///
/// # Errors
/// Those of the scene and the training day's traffic.
pub fn total_steps(plan: &Plan, estimators: u64) -> Result<u64> {
    let frames = plan.simulation(&plan.training)?.frames();
    // simulated once, sampled once, and once an estimator
    Ok(frames * (2 + estimators) * (1 + plan.reporting.len() as u64))
}

//! All stages in order, from measurements to a polar map; an estimator for the evaluation.

use viewshed::fixed::time::Time;
use viewshed::frame::detection::Measurement;
use viewshed::frame::gate::Rejection;
use viewshed::frame::health::{Condition, Continuity, Health, HealthLimits};
use viewshed::grid::evidence::Around;
use viewshed::map::query::Footprint;
use viewshed::map::{CellState, VisibilityMap};
use viewshed::radar_3d::{Radar3dConfig, Radar3dParameters};
use viewshed::sensor::Sensor;
use viewshed::sensor::road::RoadPoint;
use viewshed_harness::estimators::{Estimator, PolarCells, measurement};
use viewshed_harness::recording::Frame;

use crate::evidence::{InverseSensor, around};
use crate::gate::Scan;
use crate::geometry::{Levelled, Placed};
use crate::grid::{Axes, Grid};
use crate::obstacles::{Obstacles, Rules};
use crate::raycast::{Map, cast};
use crate::repeatability::Repeatability;
use crate::scene::{AZIMUTHS, ELEVATIONS, RANGES};
use crate::settling::Settling;
use crate::shadow;

/// Obstacles followed at most.
const OBSTACLES: usize = 96;
/// Longest time from frame to frame that is none of a gap, seconds.
const LONGEST_STEP_S: f64 = 1.0;
/// How far behind the field of view's range obstacles are followed, metres.
const BEYOND_M: f64 = 25.0;

pub struct Pipeline {
    sensor: Sensor,
    config: Radar3dConfig,
    levelled: Levelled,
    pub rules: Rules,
    inverse_sensor: InverseSensor,
    pub axes: Axes,
    health_limits: HealthLimits,
    health: Health,
    settling: Settling,
    repeatability: Repeatability,
    pub obstacles: Obstacles,
    grid: Grid,
    map: Map,
    refused: Vec<Rejection>,
}

impl Pipeline {
    pub fn new(sensor: &Sensor, config: &Radar3dConfig) -> Self {
        let levelled = Levelled::new(&sensor.mount);
        let slice_height_m = f64::from(config.visibility.slice_height_m);
        let integer = Radar3dParameters::<RANGES, AZIMUTHS, ELEVATIONS>::new(sensor, config).expect("checked before");
        let (shape, narrow) = ([RANGES, AZIMUTHS, ELEVATIONS], integer.axes().narrow);
        let axes = Axes::new(shape, &levelled, &sensor.field_of_view, slice_height_m, narrow);
        let limit = f64::from(sensor.field_of_view.range_max_m) + BEYOND_M;
        Self {
            sensor: *sensor,
            config: *config,
            rules: Rules::new(&config.obstacles, &sensor.noise, levelled.road_axis(), limit),
            inverse_sensor: InverseSensor::new(&config.evidence, &sensor.noise, &axes),
            health_limits: config.health.limits().expect("checked before"),
            health: Health::NEW,
            settling: Settling::default(),
            repeatability: Repeatability::default(),
            obstacles: Obstacles::new(OBSTACLES),
            grid: Grid::new(&axes),
            map: Map::unknown(&axes),
            refused: Vec::new(),
            levelled,
            axes,
        }
    }

    /// Takes a frame and brings the map up to its time.
    pub fn process(&mut self, now: Time, measurements: &[Measurement]) {
        let (view, noise) = (&self.sensor.field_of_view, self.repeatability.noise(&self.sensor.noise));
        let scan = Scan::new(measurements, &self.config.gate, view, &noise, &self.levelled);
        let mut points = scan.points;
        let reached = |d: &Placed| {
            let place = self.axes.column_place(d.bearing());
            let column = (place >= 0.0).then(|| self.axes.view.get(place as usize)).flatten();
            column.is_some_and(|view| d.ground() / self.axes.cell_m < view.end as f64)
        };
        if !scan.placed.iter().any(reached) {
            (points.inside, points.outside) = (0, points.inside + points.outside);
        }
        let continuity = self.health.frame(now, &points, false, &self.health_limits);
        if continuity.resets() {
            self.obstacles.list.clear();
            self.grid.clear();
            self.settling = Settling::default();
        }
        let (first, passed) = match continuity {
            Continuity::Follows(micros) => (false, micros as f64 * 1e-6),
            _ => (true, 0.0),
        };
        let (dt, gap) = (passed.min(LONGEST_STEP_S), (passed - LONGEST_STEP_S).max(0.0));
        if gap > 0.0 {
            self.map.forget();
            self.settling.gap(gap, &self.config.settling, &self.axes, &self.grid);
            self.obstacles.bridge(gap, &self.rules);
            self.inverse_sensor.fade(&mut self.grid, &self.map, &self.axes, gap);
        }
        if !first && gap == 0.0 {
            self.repeatability.compare(&scan.placed, &self.sensor.noise);
        }
        let (axes, map, visible_from) = (&self.axes, &self.map, self.visible_from());
        let in_view = |at| axes.locate(at).and_then(|(a, r)| map.grade(a, r)).is_some_and(|g| g >= visible_from);
        let claimed = self.obstacles.step(&scan.placed, dt, &self.rules, in_view);
        self.inverse_sensor.fade(&mut self.grid, &self.map, &self.axes, dt);
        self.inverse_sensor.clear(&scan.placed, &self.axes, &mut self.grid);
        let unclaimed: Vec<Placed> =
            scan.placed.iter().zip(&claimed).filter(|(_, claimed)| !**claimed).map(|(d, _)| *d).collect();
        for (d, claimed) in scan.placed.iter().zip(claimed) {
            // what moves leaves no lasting evidence; in a first frame nobody knows yet what moves
            if first || !(claimed || self.rules.course(d).is_some()) {
                let around = if first { Around::Unknown } else { around(d, &unclaimed) };
                self.inverse_sensor.add(d, around, &self.axes, &mut self.grid);
            }
        }
        let healthy = self.health.condition(now, &self.health_limits) == Condition::Healthy;
        if healthy {
            cast(&self.grid, &self.axes, &mut self.map);
        } else {
            self.map.forget();
        }
        for solid in self.obstacles.solids(&self.rules) {
            shadow::cast(&solid, &self.axes, &mut self.grid, &mut self.map);
        }
        if healthy {
            let looked = if gap > 0.0 { 0.0 } else { dt };
            self.settling.settle(looked, &self.config.settling, &self.axes, &self.grid, &mut self.map);
        }
        self.refused.extend(scan.refused);
    }

    fn visible_from(&self) -> f64 {
        f64::from(self.config.visibility.visible_from)
    }

    pub fn cell(&self, azimuth: usize, range: usize) -> CellState {
        self.map.cell(azimuth, range, self.visible_from(), f64::from(self.config.visibility.occupied_from))
    }
}

impl VisibilityMap for Pipeline {
    fn at(&self, p: RoadPoint) -> CellState {
        let at = self.levelled.place([p.x_cm, p.y_cm].map(|v| f64::from(v) / 100.0));
        self.axes.locate(at).map_or(CellState::UNKNOWN, |(a, r)| self.cell(a, r))
    }

    fn cells_in(&self, _: &Footprint, visit: &mut dyn FnMut(CellState)) {
        // its table asks of points only
        visit(CellState::UNKNOWN);
    }
}

impl Estimator for Pipeline {
    fn name(&self) -> &str {
        "radar-3d in double precision"
    }

    fn reset(&mut self) {
        self.repeatability = Repeatability::default();
        self.obstacles = Obstacles::new(OBSTACLES);
        self.grid.clear();
        self.health = Health::NEW;
        self.settling = Settling::default();
        self.map.forget();
    }

    fn step(&mut self, frame: &Frame) {
        let measurements: Vec<Measurement> = frame.detections.iter().map(measurement).collect();
        self.process(Time::from_micros(u64::try_from(frame.time_ns / 1000).unwrap_or(0)), &measurements);
    }

    fn map(&self) -> &dyn VisibilityMap {
        self
    }

    fn polar(&self) -> Option<PolarCells<'_>> {
        Some(PolarCells {
            azimuths: self.axes.azimuths,
            ranges: self.axes.ranges,
            azimuth_rad: [self.axes.right_rad, self.axes.right_rad + self.axes.span_rad],
            narrow: self.axes.narrow.map(|v| v as u8),
            cell_m: self.axes.cell_m,
            cell: Box::new(|a, r| self.cell(a, r)),
        })
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        let count = |reason: Rejection| self.refused.iter().filter(|r| **r == reason).count() as u64;
        Rejection::ALL.iter().map(|r| (r.name(), count(*r))).filter(|(_, n)| *n > 0).collect()
    }
}

//! `true-boxes`: perfect occupancy from ground-truth boxes, through the library's visibility step.
//!
//! One grid for all objects. A cell holds the share of it that boxes fill, taken over sub-columns
//! in azimuth, points in range and, exactly, the span of slopes a box covers in elevation.

use anyhow::Result;
use viewshed::grid::axes::Axes;
use viewshed::grid::raycast;
use viewshed::grid::spherical::SphericalGrid;
use viewshed::map::VisibilityMap;
use viewshed::map::polar::PolarMap;
use viewshed::radar_3d::{Radar3dConfig, Radar3dParameters};
use viewshed::sensor::Sensor;

use super::radar_3d::{AZIMUTHS, ELEVATIONS, RANGES};
use super::{Estimator, PolarCells};
use super::{Options, polar_cells};
use crate::geometry::azimuths;
use crate::geometry::ground::Ground;
use crate::geometry::pose::SensorPose;
use crate::geometry::solid::{Solid, clipped};
use crate::recording::truth::Truth;
use crate::recording::{Frame, Recording};

/// Sub-columns a column is divided into.
const SUB_COLUMNS: usize = 8;

/// Part of a column, around its centre, over which the share is taken. A bit is the visibility at
/// the centre, so what stands beside the centre line must not fill the cell.
const WINDOW: f64 = 0.5;

struct Reference {
    truth: Truth,
    pose: SensorPose,
    /// Height of the road below the sensor.
    foot_m: f64,
    parameters: Box<Radar3dParameters<RANGES, AZIMUTHS, ELEVATIONS>>,
    grid: Box<SphericalGrid<RANGES, AZIMUTHS, ELEVATIONS>>,
    map: Box<PolarMap<RANGES, AZIMUTHS>>,
    /// Stored share that a cell filled by `--reference-share` gets: half of full.
    scale: f64,
}

pub fn new(
    recording: &Recording,
    truth: &Truth,
    sensor: &Sensor,
    ground: &Ground,
    options: &Options,
) -> Result<Box<dyn Estimator>> {
    anyhow::ensure!(
        options.reference_share > 0.0 && options.reference_share <= 1.0,
        "--reference-share {} is outside 0 to 1",
        options.reference_share
    );
    let config = Radar3dConfig { ground: ground.kept(), ..options.radar_3d };
    let parameters = Box::new(Radar3dParameters::new(sensor, &config)?);
    let map = Box::new(parameters.map());
    Ok(Box::new(Reference {
        truth: truth.clone(),
        pose: recording.pose,
        foot_m: recording.ground.height(recording.pose.position[0]),
        parameters,
        grid: Box::default(),
        map,
        scale: 0.5 / options.reference_share * 256.0,
    }))
}

impl Estimator for Reference {
    fn name(&self) -> &str {
        "true-boxes"
    }

    fn reset(&mut self) {}

    fn step(&mut self, frame: &Frame) {
        self.grid.clear();
        let axes = self.parameters.axes();
        for object in self.truth.at(frame.time_ns) {
            fill(&object.solid, (&self.pose, self.foot_m), axes, self.scale, &mut self.grid);
        }
        raycast::cast(&self.grid, axes, &mut self.map);
    }

    fn map(&self) -> &dyn VisibilityMap {
        &*self.map
    }

    fn polar(&self) -> Option<PolarCells<'_>> {
        Some(polar_cells(&self.map))
    }
}

/// Adds the share of every cell that a box fills.
fn fill(
    solid: &Solid,
    (pose, foot_m): (&SensorPose, f64),
    axes: &Axes<RANGES, AZIMUTHS, ELEVATIONS>,
    scale: f64,
    grid: &mut SphericalGrid<RANGES, AZIMUTHS, ELEVATIONS>,
) {
    let (sensor, yaw) = (pose.position, pose.yaw_rad());
    let cell_m = f64::from(axes.cell_cm) / 100.0;
    // slopes a point at this ground distance is seen under, from the box's bottom to its top
    // below the sensor the road may lie at any height
    let slope = |z: f64, ground: f64| (z - foot_m - f64::from(axes.sensor_height_cm()) / 100.0) / ground;
    let ends = azimuths::ends_rad(axes.azimuth_origin, axes.azimuth_span);
    let towards = |place: f64| yaw + azimuths::bearing_rad(ends, axes.narrow.to_bytes(), AZIMUTHS, place);
    for a in 0..AZIMUTHS {
        let width = towards(a as f64 + 1.0) - towards(a as f64);
        if !near(solid, [sensor[0], sensor[1]], towards(a as f64 + 0.5), width) {
            continue;
        }
        let Some(column) = grid.column_mut(a) else { continue };
        let mut shares = [[0.0; ELEVATIONS]; RANGES];
        let mut any = false;
        for sub in 0..SUB_COLUMNS {
            let place = a as f64 + 0.5 + WINDOW * ((sub as f64 + 0.5) / SUB_COLUMNS as f64 - 0.5);
            let Some((enter, leave)) = crossing(solid, [sensor[0], sensor[1]], towards(place)) else { continue };
            any = true;
            let (first, last) = ((enter / cell_m) as usize, (leave / cell_m) as usize);
            for (r, rows) in shares.iter_mut().enumerate().take(last + 1).skip(first) {
                let (near, far) = ((r as f64 * cell_m).max(enter), ((r + 1) as f64 * cell_m).min(leave));
                // the steepest and the flattest line the box stops within the cell
                let (low, high) = spanned(solid.bottom().min(0.0), solid.top(), near, far, &slope);
                for (row, share) in rows.iter_mut().enumerate() {
                    let (from, to) = axes.row_slopes(row);
                    let covered = (high.min(to) - low.max(from)) / (to - from);
                    *share += covered.clamp(0.0, 1.0) / SUB_COLUMNS as f64;
                }
            }
        }
        if !any {
            continue;
        }
        for (r, rows) in shares.iter().enumerate().filter(|(_, rows)| rows.iter().any(|s| *s > 0.0)) {
            let Some(stack) = column.evidence(r) else { continue };
            for (cell, share) in stack.iter_mut().zip(rows) {
                *cell = cell.saturating_add((share * scale).round().min(255.0) as u8);
            }
        }
    }
}

/// Slopes of the lines of sight that a box stops between two ground distances.
fn spanned(bottom: f64, top: f64, near: f64, far: f64, slope: &impl Fn(f64, f64) -> f64) -> (f64, f64) {
    let low = slope(bottom, near).min(slope(bottom, far));
    let high = slope(top, near).max(slope(top, far));
    (low, high)
}

/// Whether a ray within `half_rad` of a direction can meet the circle around a footprint.
fn near(solid: &Solid, from: [f64; 2], azimuth_rad: f64, half_rad: f64) -> bool {
    let (dx, dy) = (solid.center[0] - from[0], solid.center[1] - from[1]);
    let (distance, radius) = (dx.hypot(dy), 0.5 * solid.size[0].hypot(solid.size[1]));
    if distance <= radius {
        return true;
    }
    let turn =
        (dy.atan2(dx) - azimuth_rad + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
    turn.abs() <= (radius / distance).asin() + half_rad
}

/// Where a ray on the ground enters and leaves a footprint, metres.
fn crossing(solid: &Solid, from: [f64; 2], azimuth_rad: f64) -> Option<(f64, f64)> {
    let start = solid.local(from);
    let (s, c) = (azimuth_rad - solid.yaw_rad).sin_cos();
    let ends = clipped(start, [c, s], [solid.size[0] / 2.0, solid.size[1] / 2.0], [0.0, f64::INFINITY]);
    ends.filter(|(enter, leave)| enter < leave)
}

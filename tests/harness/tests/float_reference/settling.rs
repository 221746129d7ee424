//! What was not looked along for long enough since a start or a gap is unknown.

use viewshed::grid::settling::{LEAST_HEIGHT_CM, SettlingConfig};

use crate::grid::{Axes, Grid};
use crate::raycast::Map;
use crate::shadow;

/// Evidence from which on something stands.
const STANDS: f64 = 0.5;
/// How long something has to stand before it is held, and to be gone before it no longer is, seconds.
const LASTS: f64 = 1.0;
/// Steps in which the distance grows.
const STEPS: f64 = 4.0;
/// How much more a gap takes off the time for what stands than its length.
const GAP_COUNTS: f64 = 10.0;
/// How far from where something stood it is the same thing, range cells.
const SAME: usize = 2;

#[derive(Debug, Default)]
pub struct Settling {
    moving: f64,
    standing: f64,
    stood: Vec<Option<usize>>,
    held: Vec<(Option<usize>, f64)>,
}

impl Settling {
    pub fn gap(&mut self, gap: f64, config: &SettlingConfig, axes: &Axes, grid: &Grid) {
        if self.standing >= f64::from(config.standing_s) {
            self.stood = (0..axes.azimuths).map(|a| nearest(grid, axes, a)).collect();
            self.held.clear();
        }
        self.moving = (self.moving - gap).max(0.0);
        self.standing = (self.standing - GAP_COUNTS * gap).max(0.0);
    }

    pub fn settle(&mut self, dt: f64, config: &SettlingConfig, axes: &Axes, grid: &Grid, map: &mut Map) {
        let [near, far, standing] = [config.near_s, config.far_s, config.standing_s].map(f64::from);
        self.moving = (self.moving + dt).min(far);
        self.standing = (self.standing + dt).min(standing);
        let share = if self.moving >= far { 1.0 } else { ((self.moving - near) / (far - near)).max(0.0) };
        let reach = (axes.ranges as f64 * (share * STEPS).floor() / STEPS) as usize;
        if reach >= axes.ranges && self.standing >= standing {
            return;
        }
        self.held.resize(axes.azimuths, (None, 0.0));
        for a in 0..axes.azimuths {
            if self.standing < standing {
                let stood = self.stood.get(a).copied().flatten();
                self.held[a] = watch(self.held[a], nearest(grid, axes, a), stood, dt);
            } else {
                self.held[a] = (None, 0.0);
            }
            let end = match self.held[a] {
                (Some(r), seen) if seen >= LASTS => reach.min(hide_behind(r, a, axes, map)),
                _ => reach,
            };
            for r in end..axes.ranges {
                let (grade, occupancy) = map.cell_mut(a, r);
                (*grade, *occupancy) = (None, 0.0);
            }
        }
    }
}

/// What is held and for how long it was seen, a step later, of a column in which something stands `nearest`.
fn watch(
    (held, seen): (Option<usize>, f64),
    nearest: Option<usize>,
    stood: Option<usize>,
    dt: f64,
) -> (Option<usize>, f64) {
    let now = nearest.filter(|r| stood.is_none_or(|stood| r + SAME < stood));
    let counted = seen >= LASTS;
    let nearer = now.is_some_and(|now| held.is_none_or(|held| now + SAME < held));
    let held = if !counted && nearer { now } else { held };
    if held.zip(nearest).is_some_and(|(held, nearest)| nearest.abs_diff(held) <= SAME) {
        return (held, (seen + dt).min(2.0 * LASTS));
    }
    let left = (seen - dt).max(0.0);
    if counted && left < LASTS {
        (now, if now.is_some() { LASTS } else { 0.0 })
    } else {
        (if left > 0.0 { held } else { now }, left)
    }
}

fn nearest(grid: &Grid, axes: &Axes, azimuth: usize) -> Option<usize> {
    (0..axes.ranges).find(|r| grid.stack(azimuth, *r).iter().any(|cell| *cell >= STANDS))
}

/// Hides what a vehicle in a cell hides at least; the cell in which that ends.
fn hide_behind(r: usize, azimuth: usize, axes: &Axes, map: &mut Map) -> usize {
    let (enter, leave) = (r as f64 * axes.cell_m, (r + 1) as f64 * axes.cell_m);
    let (from, to) = shadow::hidden(axes, f64::from(LEAST_HEIGHT_CM) / 100.0, enter, leave);
    shadow::shade(map, axes, azimuth, r + 1, (from, to), 1.0);
    if from < to { ((to / axes.cell_m) as usize).max(r + 1) } else { r + 1 }
}

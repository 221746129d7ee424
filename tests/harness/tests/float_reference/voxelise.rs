//! Boxes into the grid: the share of a column's window they cover, and how high they reach.

use viewshed_harness::geometry::solid::Solid;

use crate::geometry::Ground;
use crate::grid::{Axes, Grid};

/// Half the window a column's coverage is taken over, columns.
const WINDOW: f64 = 0.25;

/// Puts a box that stands on the ground of the levelled frame into the grid.
pub fn voxelise(solid: &Solid, axes: &Axes, grid: &mut Grid) {
    let (low, high) = outline(solid, axes);
    for a in 0..axes.azimuths {
        let centre = a as f64 + 0.5;
        let (from, to) = (low.max(centre - WINDOW), high.min(centre + WINDOW));
        if from >= to {
            continue;
        }
        let share = (to - from) / (2.0 * WINDOW);
        let Some((enter, leave)) = crossing(solid, axes.azimuth_of((from + to) / 2.0)) else { continue };
        let nearest = (enter / axes.cell_m) as usize;
        // the last cell counts where the box reaches its middle
        let end = (leave / axes.cell_m).round() as usize;
        for r in nearest..end.max(nearest + 1).min(axes.ranges) {
            let (near, far) = (r as f64 * axes.cell_m, (r + 1) as f64 * axes.cell_m);
            // the steepest slope the top is seen under: at the far end from above, at the near from below
            let steepest = axes.slope(solid.top(), far.min(leave)).max(axes.slope(solid.top(), near.max(enter)));
            grid.fill(a, r, axes.row_place(steepest), share);
        }
    }
}

/// Right and left edge of a box on the column axis; everything for a box beside or under the sensor.
fn outline(solid: &Solid, axes: &Axes) -> (f64, f64) {
    let corners = solid.footprint();
    if corners.iter().any(|c| c[0] <= 0.0) {
        return (0.0, axes.azimuths as f64);
    }
    let places = corners.map(|c| axes.column_place(c[1].atan2(c[0])));
    (places.into_iter().fold(f64::INFINITY, f64::min), places.into_iter().fold(f64::NEG_INFINITY, f64::max))
}

/// Where a ray from the origin enters and leaves the footprint, metres.
pub fn crossing(solid: &Solid, bearing_rad: f64) -> Option<(f64, f64)> {
    let start: Ground = solid.local([0.0, 0.0]);
    let (sin, cos) = (bearing_rad - solid.yaw_rad).sin_cos();
    let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
    for (start, step, side) in [(start[0], cos, solid.size[0]), (start[1], sin, solid.size[1])] {
        let (a, b) = ((-side / 2.0 - start) / step, (side / 2.0 - start) / step);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (enter < leave).then_some((enter, leave))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{self, AZIMUTHS, IntegerGrid, RANGES, Random, mounts, within};
    use viewshed::fixed::angle::Angle;
    use viewshed::fixed::trig;

    /// A box in both scales, somewhere on the road.
    fn any_box(random: &mut Random) -> (viewshed::obstacles::solid::Solid, Solid) {
        let [half_length_cm, half_width_cm, height_cm] =
            [random.whole(190, 830), random.whole(40, 128), random.whole(60, 400)];
        let (distance, bearing) = (random.between(15.0, 195.0), random.between(-1.0, 1.0));
        let [x_cm, y_cm] = [bearing.cos(), bearing.sin()].map(|v| (v * distance * 100.0).round() as i32);
        let heading = Angle::from_radians(random.between(-3.1, 3.1) as f32);
        let cm = |v: i32| f64::from(v) / 100.0;
        let exact = Solid {
            center: [cm(x_cm), cm(y_cm), cm(height_cm) / 2.0],
            yaw_rad: f64::from(heading.radians()),
            size: [2.0 * cm(half_length_cm), 2.0 * cm(half_width_cm), cm(height_cm)],
        };
        let heading = trig::direction(heading);
        (viewshed::obstacles::solid::Solid { x_cm, y_cm, heading, half_length_cm, half_width_cm, height_cm }, exact)
    }

    #[test]
    fn a_box_fills_the_same_cells_to_the_same_share() {
        let mut random = Random::new(7);
        let [mut cells, mut far_off, mut sum] = [0.0; 3];
        for mount in mounts() {
            let (axes, exact_axes) = scene::axes(&mount);
            let (mut grid, mut exact_grid) = (Box::<IntegerGrid>::default(), Grid::new(&exact_axes));
            for _ in 0..300 {
                let (solid, exact) = any_box(&mut random);
                grid.clear();
                exact_grid.clear();
                viewshed::grid::voxelise::voxelise(&solid, &axes, &mut grid);
                voxelise(&exact, &exact_axes, &mut exact_grid);
                for (off, _) in scene::differences(&grid, &exact_grid) {
                    cells += 1.0;
                    sum += off.abs();
                    far_off += f64::from(u8::from(off.abs() > 8.0));
                }
            }
        }
        within("mean difference, steps of 255", sum / cells, 3.0);
        // a hundredth of a column is 5 steps; cells at either end that only one of the two fills
        within("more than 8 steps off, % of cells", 100.0 * far_off / cells, 2.0);
    }

    #[test]
    fn a_share_is_the_part_of_the_window_whose_rays_the_box_stops() {
        let mut random = Random::new(8);
        let (_, axes) = scene::axes(&mounts()[0]);
        let mut grid = Grid::new(&axes);
        for _ in 0..20 {
            let (_, solid) = any_box(&mut random);
            grid.clear();
            voxelise(&solid, &axes, &mut grid);
            for a in 0..AZIMUTHS {
                let share = (0..RANGES).map(|r| grid.stack(a, r)[0]).fold(0.0, f64::max);
                let place = |k: i32| a as f64 + 0.5 + WINDOW * (f64::from(k) / 500.0 - 1.0);
                let stopped = (0..=1000).filter(|k| crossing(&solid, axes.azimuth_of(place(*k))).is_some()).count();
                assert!((share - stopped as f64 / 1001.0).abs() < 0.002, "{share} {stopped}");
            }
        }
    }
}

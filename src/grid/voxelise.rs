//! Boxes into the grid: every ray that a box stops meets a filled stack.
//!
//! # Model
//! A column is covered by the share of a window around its centre, half a column wide, that the
//! box's outline spans. At the half way mark this is "the centre is covered" exactly, and the
//! result is graded towards the edges. Within a column the box reaches from where the ray enters to
//! where it leaves; each of its stacks is filled up to the steepest slope its top is seen under.

use crate::fixed::trig;
use crate::grid::axes::Axes;
use crate::grid::spherical::SphericalGrid;
use crate::obstacles::solid::Solid;

/// Half the window a column's coverage is taken over, 2^-8 columns.
const WINDOW: i32 = 64;

/// Puts a box into the grid.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // column and range indices are checked
pub fn voxelise<const R: usize, const A: usize, const E: usize, const W: usize>(
    solid: &Solid,
    axes: &Axes<R, A, E>,
    grid: &mut SphericalGrid<R, A, E, W>,
) {
    let origin = solid.origin();
    let (low, high) = outline(solid, axes);
    let first = (low >> 8).clamp(0, A as i32);
    let last = (high >> 8).clamp(-1, A as i32 - 1);
    let mut rows = axes.row_places();
    for a in first..=last {
        let centre = a * 256 + 128;
        let (from, to) = (low.max(centre - WINDOW), high.min(centre + WINDOW));
        if from >= to {
            continue;
        }
        let share = ((to - from) * 255 / (2 * WINDOW)) as u8;
        let ray = trig::direction(axes.azimuth_of((from + to) / 2));
        let Some((enter, leave)) = solid.crossing(origin, ray) else { continue };
        let Some(column) = grid.column_mut(a as usize) else { continue };
        let nearest = (enter / axes.cell_cm.max(1)) as usize;
        // the last cell counts where the box reaches its middle
        let end = ((leave + axes.cell_cm / 2) / axes.cell_cm.max(1)) as usize;
        for r in nearest..end.max(nearest + 1).min(R) {
            let (near, far) = (r as i32 * axes.cell_cm, (r as i32 + 1) * axes.cell_cm);
            let place = if solid.height_cm < axes.sensor_height_cm() { far.min(leave) } else { near.max(enter) };
            column.fill(r, rows.of(axes.slope(solid.height_cm, place)), share);
        }
    }
}

/// Right and left edge of a box on the column axis, 2^-8 columns.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // at most 512 columns
fn outline<const R: usize, const A: usize, const E: usize>(solid: &Solid, axes: &Axes<R, A, E>) -> (i32, i32) {
    let corners = solid.corners();
    if corners.iter().any(|c| c.0 <= 0) {
        // beside or under the sensor: let the rays decide
        return (0, A as i32 * 256);
    }
    corners
        .iter()
        .map(|c| axes.column_place(trig::bearing(c.0, c.1)))
        .fold((i32::MAX, i32::MIN), |(lo, hi), p| (lo.min(p), hi.max(p)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::trig::Direction;
    use crate::sensor::field_of_view::FieldOfView;
    use crate::sensor::mount::Mount;
    use std::vec::Vec;

    /// Rows (2^-8) up to which a box 25 to 35 m ahead fills the second column, by range cell; and up to which its
    /// top is seen over the near and over the far edge of the part of it within the cell.
    fn filled(sensor_m: f32, height_cm: i32) -> Vec<(i32, i32, i32)> {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: sensor_m, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
        let view = FieldOfView {
            azimuth_min_deg: -30.0,
            azimuth_max_deg: 30.0,
            elevation_min_deg: -30.0,
            elevation_max_deg: 30.0,
            range_min_m: 1.0,
            range_max_m: 60.0,
        };
        let axes = Axes::<20, 4, 16>::new(&mount.levelling().unwrap(), &view, 1.0).unwrap();
        let mut grid = SphericalGrid::<20, 4, 16>::new();
        let heading = Direction::AHEAD;
        let solid = Solid { x_cm: 3000, y_cm: 0, heading, half_length_cm: 500, half_width_cm: 900, height_cm };
        voxelise(&solid, &axes, &mut grid);
        let (enter, leave) = solid.crossing(solid.origin(), axes.column_direction(1)).unwrap();
        let place = |edge_cm: i32| axes.row_place(axes.slope(height_cm, edge_cm));
        let part = |(r, stack): (usize, &[u8; 16])| {
            let rows = stack.iter().map(|cell| i32::from(*cell) * 256 / 255).sum();
            let (near, far) = (r as i32 * axes.cell_cm, (r as i32 + 1) * axes.cell_cm);
            (rows, place(near.max(enter)), place(far.min(leave)))
        };
        grid.column_mut(1).unwrap().stacks().map(part).collect()
    }

    #[test]
    fn a_box_lower_than_the_sensor_is_seen_over_its_far_edge() {
        let cells = filled(6.0, 250);
        assert!(cells.len() >= 3, "{cells:?}");
        for (rows, near, far) in cells {
            assert!((rows - far).abs() <= 2 && far > near + 20, "{rows}, near {near}, far {far}");
        }
    }

    #[test]
    fn a_box_higher_than_the_sensor_is_seen_over_its_near_edge() {
        let cells = filled(0.5, 150);
        assert!(cells.len() >= 3, "{cells:?}");
        for (rows, near, far) in cells {
            assert!((rows - near).abs() <= 2 && near > far + 20, "{rows}, near {near}, far {far}");
        }
    }

    #[test]
    fn the_last_cell_counts_where_the_box_reaches_its_middle() {
        // cells of 3 m, and a box that begins at 25 m
        for (length_cm, last) in [(800, 10), (960, 11)] {
            let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
            let view = FieldOfView {
                azimuth_min_deg: -3.0,
                azimuth_max_deg: 3.0,
                elevation_min_deg: -30.0,
                elevation_max_deg: 30.0,
                range_min_m: 1.0,
                range_max_m: 60.0,
            };
            let axes = Axes::<20, 4, 4>::new(&mount.levelling().unwrap(), &view, 1.0).unwrap();
            let mut grid = SphericalGrid::<20, 4, 4>::new();
            let (half_length_cm, half_width_cm) = (length_cm / 2, 900);
            let (x_cm, heading) = (2500 + half_length_cm, Direction::AHEAD);
            voxelise(
                &Solid { x_cm, y_cm: 0, heading, half_length_cm, half_width_cm, height_cm: 200 },
                &axes,
                &mut grid,
            );
            let cells: Vec<usize> = grid.column_mut(2).unwrap().stacks().map(|(r, _)| r).collect();
            assert_eq!(cells, (8..=last).collect::<Vec<_>>(), "ends at {} cm", 2500 + length_cm);
        }
    }

    #[test]
    fn a_box_beside_the_sensor_fills_the_columns_its_rays_cross() {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
        let view = FieldOfView {
            azimuth_min_deg: -60.0,
            azimuth_max_deg: 60.0,
            elevation_min_deg: -60.0,
            elevation_max_deg: 10.0,
            range_min_m: 1.0,
            range_max_m: 20.0,
        };
        let axes = Axes::<20, 4, 4>::new(&mount.levelling().unwrap(), &view, 1.0).unwrap();
        let mut grid = SphericalGrid::<20, 4, 4>::new();
        let heading = Direction::AHEAD;
        // from 4 m behind to 12 m ahead of the sensor, 4 m to its left
        let solid = Solid { x_cm: 400, y_cm: 500, heading, half_length_cm: 800, half_width_cm: 100, height_cm: 400 };
        voxelise(&solid, &axes, &mut grid);
        let filled: Vec<bool> = grid.columns().map(|c| c.stacks().next().is_some()).collect();
        assert_eq!(filled, [false, false, false, true]);
    }
}

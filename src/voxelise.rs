//! Boxes into the grid: every ray that a box stops meets a filled stack.
//!
//! # Model
//! A column is covered by the share of a window around its centre, half a column wide, that the
//! box's outline spans. At the half way mark this is "the centre is covered" exactly, and the
//! result is graded towards the edges. Within a column the box reaches from where the ray enters to
//! where it leaves; each of its stacks is filled up to the steepest slope its top is seen under.

use crate::axes::Axes;
use crate::solid::Solid;
use crate::spherical::SphericalGrid;
use crate::trig;

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

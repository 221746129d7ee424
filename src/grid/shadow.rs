//! The shadows of boxes on the slice plane, with exact ends: boxes in, grades and occupancy changed.
//!
//! # Model
//! A column is covered by the share of a window around its centre, half a column wide, that the
//! box's outline spans. At the half way mark this is "the centre is covered" exactly, and the
//! result is graded towards the edges. Within a column the box reaches from where the ray enters to
//! where it leaves. From a sensor at height `H`, a box of height `T` that a ray leaves at the distance
//! `d` hides the slice plane at `h` as far as `d (H - h) / (H - T)`, and without end if it is as high
//! as the sensor. Only a grid of much finer rows would show that end as well: in a queue one cell in
//! twenty-five that is blocked lies between the two.
//!
//! A box never hides the place it fills itself. What evidence there is of it is taken out of the grid:
//! the place was swept.

use crate::fixed::trig;
use crate::grid::axes::Axes;
use crate::grid::raycast::BLOCKED;
use crate::grid::spherical::SphericalGrid;
use crate::map::polar::PolarMap;
use crate::obstacles::solid::Solid;

/// Half the window a column's coverage is taken over, 2^-8 columns.
const WINDOW: i32 = 64;

/// Takes what a box fills out of the grid and, given a map cast from that, puts the box and its shadow there.
///
/// Costs a step for each column and for each range cell in shadow.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // column and range indices are checked
pub fn cast<const R: usize, const A: usize, const E: usize, const W: usize>(
    solid: &Solid,
    axes: &Axes<R, A, E>,
    grid: &mut SphericalGrid<R, A, E, W>,
    map: &mut PolarMap<R, A>,
) {
    let origin = solid.origin();
    let (low, high) = outline(solid, axes);
    let first = (low >> 8).clamp(0, A as i32);
    let last = (high >> 8).clamp(-1, A as i32 - 1);
    let cell_cm = axes.cell_cm.max(1);
    let farthest = R as i32 * cell_cm;
    for a in first..=last {
        let centre = a * 256 + 128;
        let (from, to) = (low.max(centre - WINDOW), high.min(centre + WINDOW));
        if from >= to {
            continue;
        }
        let share = ((to - from) * 255 / (2 * WINDOW)) as u8;
        let ray = trig::direction(axes.azimuth_of((from + to) / 2));
        let Some((enter, leave)) = solid.crossing(origin, ray) else { continue };
        let (enter, leave) = (enter.min(farthest), leave.min(farthest));
        // the last cell counts where the box reaches its middle
        let nearest = (enter / cell_cm) as usize;
        let end = (((leave + cell_cm / 2) / cell_cm) as usize).max(nearest + 1).min(R);
        if let Some(column) = grid.column_mut(a as usize) {
            column.empty(nearest..end);
        }
        let Some((grades, occupancy)) = map.rows_mut(a as usize) else { continue };
        if solid.height_cm > axes.slice_cm() {
            for o in occupancy.get_mut(nearest..end).unwrap_or(&mut []) {
                *o = (*o).max(share);
            }
        }
        if let Some((from, to)) = axes.hidden_behind(solid.height_cm, enter, leave) {
            shade(grades, end, from, to.min(farthest), cell_cm, share);
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

/// Lowers what is known of the cells from `first` on between two distances, by the part that lies there.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // range indices and bytes
fn shade<const R: usize>(grades: &mut [u8; R], first: usize, from: i32, to: i32, cell_cm: i32, share: u8) {
    let lower = |g: &mut u8, by: u8| {
        if *g > BLOCKED {
            *g = (*g).min((255 - by).max(BLOCKED));
        }
    };
    let part = |r: usize| {
        let near = r as i32 * cell_cm;
        let covered = (to.min(near + cell_cm) - from.max(near)).clamp(0, cell_cm);
        (i32::from(share) * covered / cell_cm.max(1)) as u8
    };
    // the first cell of the shadow begins behind the box, not where the box ends within it
    let begin = first.max((from / cell_cm.max(1)) as usize);
    let last = (to / cell_cm.max(1)) as usize;
    for g in grades.get_mut(begin..last.min(R)).unwrap_or(&mut []) {
        lower(g, share);
    }
    if let Some(g) = grades.get_mut(last).filter(|_| last >= begin) {
        lower(g, part(last));
    }
}

pub fn show<const R: usize, const A: usize, const E: usize>(
    solid: &Solid,
    axes: &Axes<R, A, E>,
    map: &mut PolarMap<R, A>, to: u8,
) {
    let origin = solid.origin();
    let (low, high) = outline(solid, axes);
    let first = (low >> 8).clamp(0, A as i32);
    let last = (high >> 8).clamp(-1, A as i32 - 1);
    let cell_cm = axes.cell_cm.max(1);
    let farthest = R as i32 * cell_cm;
    for a in first..=last {
        let centre = a * 256 + 128;
        if low > centre || high < centre { continue; }
        let ray = trig::direction(axes.azimuth_of(centre));
        let Some((enter, leave)) = solid.crossing(origin, ray) else { continue };
        let (enter, leave) = (enter.min(farthest), leave.min(farthest));
        let nearest = (enter / cell_cm) as usize;
        let end = (((leave + cell_cm / 2) / cell_cm) as usize).max(nearest + 1).min(R);
        let Some((grades, _)) = map.rows_mut(a as usize) else { continue };
        for g in grades.get_mut(nearest..end).unwrap_or(&mut []) { if *g > 0 { *g = to; } }
    }
}

pub fn spot<const R: usize, const A: usize, const E: usize>(r: &crate::frame::reflection::Reflection, axes: &Axes<R, A, E>, map: &mut PolarMap<R, A>) {
    let Some(a) = axes.column(r.bearing()) else { return };
    let Some(c) = axes.range_cell(i32::from(r.ground_cm)) else { return };
    let Some((grades, _)) = map.rows_mut(a) else { return };
    for g in grades.get_mut(c.saturating_sub(1)..(c + 2).min(R)).unwrap_or(&mut []) { if *g > 0 { *g = 255; } }
}

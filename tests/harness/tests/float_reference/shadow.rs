//! Boxes and their shadows on the map.

use std::ops::Range;

use viewshed_harness::geometry::solid::Solid;

use crate::geometry::Ground;
use crate::grid::{Axes, Grid};
use crate::raycast::Map;

/// Half the window a column's coverage is taken over, columns.
const WINDOW: f64 = 0.25;

/// By so much a box's edges count as nearer to its middle in the columns its middle does not lie in.
const BESIDE: f64 = 5.0 / 256.0;

/// What a box covers of a column: a share of the window, all of it in the column its middle lies in, from where to where along the ray, and the
/// range cells it fills.
struct Covered {
    column: usize,
    share: f64,
    enter: f64,
    leave: f64,
    cells: Range<usize>,
}

/// Puts a box and its shadow on a map, and takes evidence in its place out of the grid.
pub fn cast(solid: &Solid, axes: &Axes, grid: &mut Grid, map: &mut Map) {
    for covered in columns(solid, axes) {
        let Covered { column, share, enter, leave, cells } = covered;
        for r in cells.clone() {
            grid.stack_mut(column, r).fill(0.0);
            if solid.top() > axes.slice_m {
                let (_, occupancy) = map.cell_mut(column, r);
                *occupancy = occupancy.max(share);
            }
        }
        shade(map, axes, column, cells.end, hidden(axes, solid.top(), enter, leave), share);
    }
}

/// Lowers the grades of a column from a cell on, between two distances.
pub fn shade(map: &mut Map, axes: &Axes, column: usize, first: usize, (from, to): (f64, f64), share: f64) {
    for r in first..axes.ranges {
        let (near, far) = (r as f64 * axes.cell_m, (r + 1) as f64 * axes.cell_m);
        // the cell a shadow begins in is all of it in shadow
        let part = if from < far { ((to.min(far) - near) / axes.cell_m).clamp(0.0, 1.0) } else { 0.0 };
        let (grade, _) = map.cell_mut(column, r);
        *grade = grade.map(|g| g.min(1.0 - share * part));
    }
}

/// Between which distances the slice plane is hidden behind a box of this height.
pub fn hidden(axes: &Axes, top: f64, enter: f64, leave: f64) -> (f64, f64) {
    let nothing = (f64::INFINITY, 0.0);
    let (sensor, slice) = (axes.height_m, axes.slice_m);
    match (sensor > slice, top) {
        (true, top) if top <= slice => nothing,
        (true, top) if top >= sensor => (leave, f64::INFINITY),
        (true, top) => (leave, leave * (sensor - slice) / (sensor - top)),
        (false, top) if top <= sensor => nothing,
        (false, top) if top >= slice => (leave, f64::INFINITY),
        (false, top) => (leave.max(enter * (slice - sensor) / (top - sensor)), f64::INFINITY),
    }
}

fn columns(solid: &Solid, axes: &Axes) -> impl Iterator<Item = Covered> {
    let (low, high) = outline(solid, axes);
    (0..axes.azimuths).filter_map(move |column| {
        let centre = column as f64 + 0.5;
        let middle = f64::midpoint(low, high);
        let holds_most = middle.floor() == column as f64;
        let less = if holds_most { 0.0 } else { BESIDE };
        let (from, to) = ((low + less).max(centre - WINDOW), (high - less).min(centre + WINDOW));
        let (share, ray) = match (holds_most, from < to) {
            (true, true) => (1.0, f64::midpoint(from, to)),
            (true, false) => (1.0, middle),
            (false, true) => ((to - from) / (2.0 * WINDOW), f64::midpoint(from, to)),
            (false, false) => return None,
        };
        let (enter, leave) = crossing(solid, axes.azimuth_of(ray))?;
        let nearest = (enter / axes.cell_m) as usize;
        // the last cell counts where the box reaches its middle
        let end = ((leave / axes.cell_m).round() as usize).max(nearest + 1).min(axes.ranges);
        Some(Covered { column, share, enter, leave, cells: nearest..end })
    })
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
    use viewshed::map::polar::PolarMap;

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
    fn a_box_changes_the_same_cells_to_the_same_grade() {
        let mut random = Random::new(7);
        let [mut cells, mut far_off, mut sum, mut occupied, mut differ] = [0.0; 5];
        for mount in mounts() {
            let (axes, exact_axes) = scene::axes(&mount);
            let (mut grid, mut exact_grid) = (Box::<IntegerGrid>::default(), Grid::new(&exact_axes));
            let mut map = Box::new(PolarMap::unknown(axes.polar(&mount.levelling().unwrap()), 128, 128));
            let mut exact_map = Map::unknown(&exact_axes);
            for _ in 0..300 {
                let (solid, exact) = any_box(&mut random);
                viewshed::grid::raycast::cast(&grid, &axes, &mut map);
                crate::raycast::cast(&exact_grid, &exact_axes, &mut exact_map);
                viewshed::grid::shadow::cast(&solid, &axes, &mut grid, &mut map);
                cast(&exact, &exact_axes, &mut exact_grid, &mut exact_map);
                for (a, r) in (0..AZIMUTHS).flat_map(|a| (0..RANGES).map(move |r| (a, r))) {
                    let got = map.cell(a, r);
                    let Some(grade) = exact_map.grade(a, r).filter(|_| got.grade > 0) else { continue };
                    let occupancy = exact_map.occupancy(a, r);
                    occupied += f64::from(u8::from(occupancy > 0.0));
                    differ += f64::from(u8::from((f64::from(got.occupancy) - 255.0 * occupancy).abs() > 8.0));
                    if got.grade == 255 && grade > 254.5 / 255.0 {
                        continue;
                    }
                    let off = (f64::from(got.grade) - (grade * 255.0).max(1.0)).abs();
                    cells += 1.0;
                    sum += off;
                    far_off += f64::from(u8::from(off > 8.0));
                }
            }
        }
        within("mean difference of grades, steps of 255", sum / cells, 3.0);
        // a hundredth of a column is 5 steps; cells at either end of a shadow
        within("grades more than 8 steps off, % of cells", 100.0 * far_off / cells, 4.0);
        within("occupancy more than 8 steps off, % of cells", 100.0 * differ / occupied, 2.5);
    }

    #[test]
    fn a_share_is_the_part_of_the_window_whose_rays_the_box_stops_and_all_where_its_middle_is() {
        let mut random = Random::new(8);
        let (_, axes) = scene::axes(&mounts()[0]);
        for _ in 0..20 {
            let (_, solid) = any_box(&mut random);
            let mut shares = [0.0; AZIMUTHS];
            columns(&solid, &axes).for_each(|c| shares[c.column] = c.share);
            let (low, high) = outline(&solid, &axes);
            for (a, share) in shares.into_iter().enumerate() {
                if f64::midpoint(low, high).floor() == a as f64 {
                    assert_eq!(share, 1.0, "from {low} to {high}");
                    continue;
                }
                let place = |k: i32| a as f64 + 0.5 + WINDOW * (f64::from(k) / 500.0 - 1.0);
                let stopped = (0..=1000).filter(|k| crossing(&solid, axes.azimuth_of(place(*k))).is_some()).count();
                // less what an edge counts as nearer
                let more = stopped as f64 / 1001.0 - share;
                assert!((-0.002..=BESIDE / (2.0 * WINDOW) + 0.002).contains(&more), "{share} {stopped}");
            }
        }
    }
}

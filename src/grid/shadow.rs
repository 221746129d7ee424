//! Boxes and their shadows on the map, with exact ends.
//!
//! # Model
//! A column is covered by the share of a window around its centre, half a column wide, that the
//! box's outline spans: half where its edge reaches the centre, graded from there to both sides. The column that the box's
//! middle lies in is covered whole. It holds most of a box narrower than a column, and where such a box lies on an edge it
//! covers no centre, and its shadow would be lost. What is hidden more by this, the columns beside are hidden less, so that
//! in sum little changes. Where several boxes cover a column the largest share counts.
//!
//! Within a column the box reaches from where the ray enters to
//! where it leaves. Seen from the height `H`, a box of height `T` that a ray leaves at the distance
//! `d` hides the slice plane at `h` as far as `d (H - h) / (H - T)`; one as high as the sensor without
//! end. Through the rows of the grid such an end is right to a tenth of a row, which is a metre 60 m
//! away.
//!
//! Over a road that is not flat the same holds piece by piece: between two points of its profile the ground is straight,
//! and the slice is hidden where it is seen under a lower slope than the box's top. A box stands upright, on the height
//! of the road at its middle. It may hide what lies beyond, the road being seen again in between.
//!
//! A box never hides the place it fills itself. Evidence in a box's place leaves the grid: the place was
//! swept. A vehicle that is detected in another's shadow stays in it: showing its place would be right of
//! every detected object by construction, and say nothing of the lines of sight there.

use core::ops::Range;

use crate::fixed::trig;
use crate::grid::axes::{Axes, column_centre};
use crate::grid::raycast::shade;
use crate::grid::spherical::SphericalGrid;
use crate::map::polar::PolarMap;
use crate::obstacles::solid::Solid;

/// Half the window a column's coverage is taken over, 2^-8 columns.
const WINDOW: i32 = 64;

/// By so much a box's edges count as nearer to its middle in the columns beside, 2^-8 columns: what the column of its middle
/// gains of the others' place, they lose.
const BESIDE: i32 = 5;

/// What a box covers of a column.
struct Covered {
    column: usize,
    /// Of the window, up to 255.
    share: u8,
    /// Where the ray enters and leaves, centimetres.
    enter_cm: i32,
    leave_cm: i32,
    /// Range cells it fills; the last counts where the box reaches its middle.
    cells: Range<usize>,
}

/// Puts a box and its shadow on a map that was cast from the grid, and takes evidence in its place out of that.
///
/// Costs a step for each column, and for each range cell in shadow.
pub fn cast<const R: usize, const A: usize, const E: usize, const W: usize>(
    solid: &Solid,
    axes: &Axes<R, A, E>,
    grid: &mut SphericalGrid<R, A, E, W>,
    map: &mut PolarMap<R, A>,
) {
    for covered in columns(solid, axes) {
        let Covered { column: number, share, enter_cm, leave_cm, cells } = covered;
        if let Some(column) = grid.column_mut(number) {
            column.empty(cells.clone());
        }
        let Some((grades, occupancy)) = map.rows_mut(number) else { continue };
        if solid.height_cm > axes.slice_cm() {
            for o in occupancy.get_mut(cells.clone()).unwrap_or(&mut []) {
                *o = (*o).max(share);
            }
        }
        if !axes.ground().is_level() {
            let top_cm = axes.ground().height_cm(solid.x_cm, solid.y_cm) + solid.height_cm;
            for hidden in axes.hidden_over_ground(number, top_cm, enter_cm, leave_cm) {
                shade(grades, cells.end, hidden, axes.cell_cm, share);
            }
        } else if let Some(hidden) = axes.hidden_behind(solid.height_cm, enter_cm, leave_cm) {
            shade(grades, cells.end, hidden, axes.cell_cm, share);
        }
    }
}

/// The columns a box covers, and what of them.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // column and range indices are checked
fn columns<const R: usize, const A: usize, const E: usize>(
    solid: &Solid,
    axes: &Axes<R, A, E>,
) -> impl Iterator<Item = Covered> {
    let origin = solid.origin();
    let (low, high) = outline(solid, axes);
    let middle = (low + high) >> 1;
    let first = (low >> 8).clamp(0, A as i32);
    let last = (high >> 8).clamp(-1, A as i32 - 1);
    let farthest = R as i32 * axes.cell_cm;
    (first..=last).filter_map(move |a| {
        // here, where the divisions below show that they cannot be by nothing
        let cell_cm = axes.cell_cm.max(1);
        let centre = column_centre(a as usize);
        let holds_most = middle >> 8 == a;
        let less = if holds_most { 0 } else { BESIDE };
        let (mut from, mut to) = ((low + less).max(centre - WINDOW), (high - less).min(centre + WINDOW));
        if from >= to {
            if !holds_most {
                return None;
            }
            (from, to) = (middle, middle);
        }
        let (enter, leave) = solid.crossing(origin, axes.direction_of((from + to) / 2))?;
        let (enter_cm, leave_cm) = (enter.min(farthest), leave.min(farthest));
        let nearest = (enter_cm / cell_cm) as usize;
        let end = (((leave_cm + cell_cm / 2) / cell_cm) as usize).max(nearest + 1).min(R);
        let share = if holds_most { u8::MAX } else { ((to - from) * 255 / (2 * WINDOW)) as u8 };
        Some(Covered { column: a as usize, share, enter_cm, leave_cm, cells: nearest..end })
    })
}

/// Right and left edge of a box on the column axis, 2^-8 columns.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // at most 255 columns
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
    use crate::map::Visibility;
    use crate::sensor::field_of_view::FieldOfView;
    use crate::sensor::ground::Ground;
    use crate::sensor::mount::Mount;
    use crate::sensor::site::Points;
    use std::string::String;
    use std::vec::Vec;

    type World = (Axes<60, 4, 16>, SphericalGrid<60, 4, 16>, PolarMap<60, 4>);

    /// 60 m in cells of 1 m, four columns from 30 degrees to the right to 30 to the left, and a map that is clear.
    fn world(sensor_m: f32) -> World {
        over(sensor_m, 0.0, &[])
    }

    /// The same over a road that is not flat.
    fn over(sensor_m: f32, yaw_deg: f32, points: &[[f32; 2]]) -> World {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: sensor_m, yaw_deg, pitch_deg: 0.0, roll_deg: 0.0 };
        let view = FieldOfView {
            azimuth_min_deg: -30.0,
            azimuth_max_deg: 30.0,
            elevation_min_deg: -80.0,
            elevation_max_deg: 30.0,
            range_min_m: 1.0,
            range_max_m: 60.0,
        };
        let levelling = mount.levelling().unwrap();
        let ground = Ground::new(&levelling, Points::Metres(points)).unwrap();
        let axes = Axes::on(ground, &levelling, &view, 1.0, None).unwrap();
        let (grid, mut map) = (SphericalGrid::new(), PolarMap::unknown(axes.polar(&levelling), 128, 128));
        crate::grid::raycast::cast(&grid, &axes, &mut map);
        (axes, grid, map)
    }

    /// A box across the two middle columns, which begins and ends so many centimetres ahead.
    fn wall(from_cm: i32, to_cm: i32, height_cm: i32) -> Solid {
        let (x_cm, half_length_cm) = ((from_cm + to_cm) / 2, (to_cm - from_cm) / 2);
        Solid { x_cm, y_cm: 0, heading: Direction::AHEAD, half_length_cm, half_width_cm: 900, height_cm }
    }

    /// Invisible cells of the second column behind a box.
    fn hidden(sensor_m: f32, solid: Solid) -> Vec<usize> {
        hidden_in(world(sensor_m), solid)
    }

    fn hidden_in((axes, mut grid, mut map): World, solid: Solid) -> Vec<usize> {
        cast(&solid, &axes, &mut grid, &mut map);
        (0..60).filter(|r| map.cell(1, *r).visibility == Visibility::Invisible).collect()
    }

    #[test]
    fn a_shadow_ends_where_similar_triangles_say() {
        // the column's centre runs 7.5 degrees aside: what is 30 m ahead is 30.3 m along the ray
        for (height_cm, ends_m) in [(150, 30.3 * 5.0 / 4.5), (250, 30.3 * 5.0 / 3.5), (300, 30.3 * 5.0 / 3.0)] {
            let cells = hidden(6.0, wall(2500, 3000, height_cm));
            assert_eq!(cells.first(), Some(&30), "the box does not hide itself");
            let last = *cells.last().unwrap() as f64 + 0.5;
            assert!((last - (ends_m - 0.5)).abs() <= 0.5, "{height_cm} cm: last {last} m, ends {ends_m} m");
        }
        assert_eq!(hidden(6.0, wall(2500, 3000, 600)), (30..60).collect::<Vec<_>>(), "as high as the sensor");
        assert_eq!(hidden(6.0, wall(2500, 3000, 100)), [0_usize; 0], "no higher than the slice plane");
    }

    #[cfg(feature = "ground")]
    #[test]
    fn where_the_road_begins_to_climb_a_shadow_is_shorter_and_where_it_begins_to_fall_longer() {
        // level below sensor and box, then a grade from 30 m on, ahead on the road or behind
        let ends = |yaw_deg: f32, grade: f32| {
            let points = [[-90.0, 60.0 * grade], [-30.0, 0.0], [30.0, 0.0]];
            let points = if yaw_deg == 0.0 { points.map(|[x, height]| [-x, height]) } else { points };
            let mut points = points;
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let cells = hidden_in(over(6.0, yaw_deg, &points), wall(2500, 3000, 300));
            assert_eq!(cells.first(), Some(&30));
            cells.last().map_or(0, |last| last + 1) as f64
        };
        // the column runs 7.5 degrees aside; the ray over the far edge falls 3 m on its way there
        let exact = |grade: f64| {
            let along = 7.5_f64.to_radians().cos();
            (5.0 + 30.0 * grade) / (grade * along + 3.0 * along / 30.0)
        };
        for grade in [0.04, 0.0, -0.02] {
            for yaw_deg in [0.0, 180.0] {
                let got = ends(yaw_deg, grade as f32);
                assert!((got - exact(grade)).abs() <= 1.0, "{yaw_deg} {grade}: {got} m, {} m", exact(grade));
            }
        }
        assert!(exact(0.04) < exact(0.0) - 4.0 && exact(-0.02) > exact(0.0) + 4.0);
    }

    #[cfg(feature = "ground")]
    #[test]
    fn a_grade_that_begins_before_the_sensor_leaves_shadows_nearly_as_they_are() {
        // all is sheared alike, and lines stay lines; but a box stands upright on the height of its middle
        let level = hidden(6.0, wall(2500, 3000, 300));
        for (yaw_deg, grade) in [(0.0, 0.04), (0.0, -0.04), (90.0, 0.04)] {
            let points = [[-90.0, -90.0 * grade], [90.0, 90.0 * grade]];
            let cells = hidden_in(over(6.0, yaw_deg, &points), wall(2500, 3000, 300));
            assert!(cells.len().abs_diff(level.len()) <= 2, "{yaw_deg} {grade}: {cells:?}");
        }
    }

    #[cfg(feature = "ground")]
    #[test]
    fn behind_a_crest_the_road_hides_itself_and_comes_into_sight_again_where_it_climbs() {
        // from 3 m: the crest 1.2 m high at 20 m, 10 % down to 40 m, and up again
        let (_, _, map) = over(3.0, 0.0, &[[0.0, 0.0], [20.0, 1.2], [40.0, -0.8], [60.0, 1.2]]);
        let cells: Vec<usize> = (0..60).filter(|r| map.cell(1, *r).visibility == Visibility::Invisible).collect();
        // the line over the crest falls 0.09 m a metre: 1.2 - 0.09 s against 1.2 - 0.1 s + 1, never below; from 2 m it is
        assert_eq!(cells, [0_usize; 0]);
        let (_, _, map) = over(2.0, 0.0, &[[0.0, 0.0], [20.0, 1.2], [40.0, -0.8], [60.0, 1.2]]);
        let cells: Vec<usize> = (0..60).filter(|r| map.cell(1, *r).visibility == Visibility::Invisible).collect();
        // 1.2 - 0.04 s against 2.2 - 0.1 s: hidden from 16.7 m behind the crest, seen where 0.2 + 0.1 t is above 0.4 - 0.04 t
        let along = 7.5_f64.to_radians().cos();
        let (from, to) = ((20.0 + 1.0 / 0.06) / along, (40.0 + 0.2 / 0.14) / along);
        assert!((cells[0] as f64 + 0.5 - from).abs() <= 1.0, "{cells:?} from {from}");
        assert!((*cells.last().unwrap() as f64 + 0.5 - to).abs() <= 1.0, "{cells:?} to {to}");
        assert!(cells.windows(2).all(|w| w[1] == w[0] + 1));
    }

    #[test]
    fn from_below_the_near_edge_hides_and_nothing_is_seen_again() {
        // a sensor at 0.5 m, the plane at 1 m: a box of 0.75 m hides it from twice its near edge on
        assert_eq!(hidden(0.5, wall(1000, 1500, 75)).first(), Some(&20));
        assert_eq!(hidden(0.5, wall(1000, 1500, 150)), (15..60).collect::<Vec<_>>());
        assert_eq!(hidden(0.5, wall(1000, 1500, 50)), [0_usize; 0]);
    }

    #[test]
    fn the_last_cell_of_a_box_counts_where_it_reaches_its_middle() {
        for (ends_cm, occupied) in [(2900, 25..29), (2960, 25..30)] {
            let (axes, mut grid, mut map) = world(6.0);
            cast(&wall(2500, ends_cm, 300), &axes, &mut grid, &mut map);
            let cells: Vec<usize> = (0..60).filter(|r| map.cell(1, *r).occupied).collect();
            assert_eq!(cells, occupied.collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_box_beside_the_sensor_covers_the_columns_its_rays_cross() {
        let (axes, mut grid, mut map) = world(6.0);
        let heading = Direction::AHEAD;
        // from 4 m behind to 12 m ahead of the sensor, 4 m to its left
        let solid = Solid { x_cm: 400, y_cm: 500, heading, half_length_cm: 800, half_width_cm: 100, height_cm: 400 };
        cast(&solid, &axes, &mut grid, &mut map);
        let covered: Vec<bool> = (0..4).map(|a| (0..60).any(|r| map.cell(a, r).occupied)).collect();
        assert_eq!(covered, [false, false, false, true]);
    }

    /// Columns from left to right, a line each: `#` invisible, `O` occupied, `.` the rest; from 16 to 34 m.
    fn picture(solids: &[Solid]) -> String {
        let (axes, mut grid, mut map) = world(6.0);
        solids.iter().for_each(|solid| cast(solid, &axes, &mut grid, &mut map));
        let mut picture = String::from("\n");
        for a in (0..4).rev() {
            picture.extend((16..34).map(|r| match map.cell(a, r) {
                cell if cell.visibility == Visibility::Invisible => '#',
                cell if cell.occupied => 'O',
                _ => '.',
            }));
            picture.push('\n');
        }
        picture
    }

    #[test]
    fn a_box_narrower_than_a_column_hides_the_one_that_holds_most_of_it() {
        // a column is 5 m wide there; rays leave at 22 m, and the shadow ends at 22 * 5 / 3
        let car = |y_cm: i32| Solid { half_width_cm: 90, y_cm, ..wall(1800, 2200, 300) };
        let left = "
..................
..OOOO############
..................
..................
";
        let right = "
..................
..................
..OOOO############
..................
";
        // on the edge between both, and beside it, where no centre is covered
        assert!([left, right].contains(&&*picture(&[car(0)])));
        assert_eq!(picture(&[car(20)]), left);
        assert_eq!(picture(&[car(-20)]), right);
        assert_eq!(picture(&[car(100)]), left);
    }

    #[test]
    fn boxes_that_share_a_column_hide_it_once() {
        let car = |y_cm: i32| Solid { half_width_cm: 90, y_cm, ..wall(1800, 2200, 300) };
        let grades = |solids: &[Solid]| {
            let (axes, mut grid, mut map) = world(6.0);
            solids.iter().for_each(|solid| cast(solid, &axes, &mut grid, &mut map));
            (0..4).map(|a| map.cell(a, 30).grade).collect::<Vec<_>>()
        };
        let one = grades(&[car(20)]);
        // both lie on the edge: the column beside is not hidden by the two of them either
        assert_eq!(grades(&[car(20), car(30)]), one);
        assert_eq!(one, [255, 255, 1, 255]);
        // a lane to the left a third one covers some of the next column, more than none and less than half
        let with = grades(&[car(20), car(420)]);
        assert_eq!((with[1], with[2]), (255, 1));
    }

    #[test]
    fn evidence_in_a_boxs_place_is_swept_and_beside_it_stays() {
        let (axes, mut grid, mut map) = world(6.0);
        for r in [10, 26] {
            *grid.column_mut(1).unwrap().evidence(r).unwrap() = [200; 16];
        }
        cast(&wall(2500, 3000, 150), &axes, &mut grid, &mut map);
        let left: Vec<usize> = grid.column_mut(1).unwrap().stacks().map(|(r, _)| r).collect();
        assert_eq!(left, [10]);
    }

    #[test]
    fn what_is_unknown_stays_so() {
        let (axes, mut grid, mut map) = world(6.0);
        map.forget();
        let solid = wall(1000, 1500, 400);
        cast(&solid, &axes, &mut grid, &mut map);
        assert!((0..60).all(|r| map.cell(1, r).visibility == Visibility::Unknown));
    }
}

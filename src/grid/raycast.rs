//! Lines of sight through the grid, and the slice at h: occupancy in, graded visibility out.
//!
//! # Model
//! A line of sight is one azimuth and one elevation, so what blocks a cell is the largest occupancy
//! among the nearer cells of its row: `blocked(r) = max over r' < r of Occ(r')`, and the grade is
//! what is left of 255. The point at slice height lies between the centres of two rows; its value
//! is interpolated, which finds the top of an obstacle within a row to 8 % of the row's height.
//!
//! An object never hides itself: the cells of an occupied run count as blocking only once the ray
//! has left the run. What stands on the far side of the run is hidden.
//!
//! A road that is not flat hides what lies behind a crest of it; its shadows have exact ends, as those of boxes do.

use crate::grid::axes::{Axes, SliceRow};
use crate::grid::spherical::{Column, SphericalGrid};
use crate::grid::stack;
use crate::map::polar::PolarMap;

/// Occupancy from which a cell belongs to an object of its own.
const OCCUPIED: u8 = 128;

/// Grade of a cell that is known and blocked.
pub(crate) const BLOCKED: u8 = 1;
/// Grade of a cell with nothing in the way.
pub(crate) const CLEAR: u8 = 255;

/// Casts all rays and writes the visibility and occupancy at slice height. Cells out of view stay
/// unknown.
///
/// Costs a pass over the stacks that hold something and, behind the first of them, one step for
/// each range cell in half-shadow.
pub fn cast<const R: usize, const A: usize, const E: usize, const W: usize>(
    grid: &SphericalGrid<R, A, E, W>,
    axes: &Axes<R, A, E>,
    map: &mut PolarMap<R, A>,
) {
    for (a, column) in grid.columns().enumerate() {
        let Some((grades, occupancy)) = map.rows_mut(a) else { return };
        *occupancy = [0; R];
        if axes.ground().is_level() {
            cast_column(column, &mut Plane { axes, rows: axes.slice_rows() }, grades, occupancy);
        } else {
            cast_column(column, &mut OverGround { axes, column: a }, grades, occupancy);
            for hidden in axes.hidden_by_ground(a) {
                shade(grades, 0, hidden, axes.cell_cm, CLEAR);
            }
        }
        let view = axes.view(a);
        if let Some(near) = grades.get_mut(..view.start) {
            near.fill(0);
        }
        if let Some(far) = grades.get_mut(view.end..) {
            far.fill(0);
        }
    }
}

/// Where the slice runs through the rows of a column.
trait Slice<const R: usize, const E: usize> {
    /// The lower of the two rows it runs between at a range cell, and its share of the upper; cells come in their order.
    fn place(&mut self, r: usize) -> (usize, u8);

    /// Grades of cells that hold nothing, behind what blocks so much of each row.
    fn shade(&mut self, blocked: &[u8; E], grades: &mut [u8; R], from: usize, to: usize);
}

/// A plane, of which all is known from the start.
struct Plane<'a, const R: usize, const A: usize, const E: usize> {
    axes: &'a Axes<R, A, E>,
    rows: &'a [SliceRow],
}

/// Above ground that is not level.
struct OverGround<'a, const R: usize, const A: usize, const E: usize> {
    axes: &'a Axes<R, A, E>,
    column: usize,
}

impl<const R: usize, const A: usize, const E: usize> Slice<R, E> for Plane<'_, R, A, E> {
    #[inline]
    fn place(&mut self, r: usize) -> (usize, u8) {
        (rows_at(&mut self.rows, r), self.axes.slice_share().get(r).copied().unwrap_or(0))
    }

    fn shade(&mut self, blocked: &[u8; E], grades: &mut [u8; R], from: usize, to: usize) {
        let mut start = from;
        while start < to {
            let lower = rows_at(&mut self.rows, start);
            let end = self.rows.first().map_or(to, |s| usize::from(s.end)).clamp(start + 1, to);
            let pair = pair(blocked, lower);
            let (Some(cells), Some(shares)) = (grades.get_mut(start..end), self.axes.slice_share().get(start..end))
            else {
                return;
            };
            if pair.low == pair.high {
                cells.fill((CLEAR - pair.low).max(BLOCKED));
            } else {
                for (g, &share) in cells.iter_mut().zip(shares) {
                    *g = (CLEAR - pair.at(share)).max(BLOCKED);
                }
            }
            start = end;
        }
    }
}

impl<const R: usize, const A: usize, const E: usize> Slice<R, E> for OverGround<'_, R, A, E> {
    fn place(&mut self, r: usize) -> (usize, u8) {
        self.axes.slice_place(self.column, r)
    }

    fn shade(&mut self, blocked: &[u8; E], grades: &mut [u8; R], from: usize, to: usize) {
        for (r, g) in grades.iter_mut().enumerate().take(to).skip(from) {
            let (lower, share) = self.place(r);
            *g = (CLEAR - pair(blocked, lower).at(share)).max(BLOCKED);
        }
    }
}

fn cast_column<const R: usize, const E: usize, const W: usize>(
    column: &Column<R, E, W>,
    slice: &mut impl Slice<R, E>,
    grades: &mut [u8; R],
    occupancy: &mut [u8; R],
) {
    let mut shadow = Shadow { blocked: [0; E], run: [0; E], in_run: false };
    let mut next = 0;
    for (r, stack) in column.stacks() {
        if next < r {
            shadow.leave_run();
            shadow.shade(slice, grades, next, r);
        }
        let (row, share) = slice.place(r);
        let here = pair(stack, row).at(share);
        if here < OCCUPIED {
            shadow.leave_run();
        }
        if let (Some(g), Some(o)) = (grades.get_mut(r), occupancy.get_mut(r)) {
            *g = (CLEAR - pair(&shadow.blocked, row).at(share)).max(BLOCKED);
            *o = here;
        }
        shadow.pass(stack, here >= OCCUPIED);
        next = r + 1;
    }
    shadow.leave_run();
    shadow.shade(slice, grades, next, R);
}

/// The lower of the two rows the slice plane runs between at a range cell; drops the stretches
/// before it.
fn rows_at(rows: &mut &[SliceRow], r: usize) -> usize {
    while let Some((first, rest)) = rows.split_first() {
        if usize::from(first.end) > r || rest.is_empty() {
            return usize::from(first.lower);
        }
        *rows = rest;
    }
    0
}

/// What the ray bundle of one azimuth has met so far.
struct Shadow<const E: usize> {
    /// Largest occupancy on each row before the present run.
    blocked: [u8; E],
    /// Largest occupancy on each row within it.
    run: [u8; E],
    in_run: bool,
}

impl<const E: usize> Shadow<E> {
    fn pass(&mut self, cells: &[u8; E], occupied: bool) {
        self.in_run |= occupied;
        stack::raise(if occupied { &mut self.run } else { &mut self.blocked }, cells);
    }

    fn leave_run(&mut self) {
        if self.in_run {
            stack::raise(&mut self.blocked, &self.run);
            self.run = [0; E];
            self.in_run = false;
        }
    }

    /// Grades of empty cells.
    fn shade<const R: usize>(&self, slice: &mut impl Slice<R, E>, grades: &mut [u8; R], from: usize, to: usize) {
        if stack::is_empty(&self.blocked) {
            if let Some(clear) = grades.get_mut(from..to) {
                clear.fill(CLEAR);
            }
            return;
        }
        slice.shade(&self.blocked, grades, from, to);
    }
}

/// Values on two neighbouring rows.
#[derive(Clone, Copy)]
struct Pair {
    low: u8,
    high: u8,
}

fn pair<const E: usize>(rows: &[u8; E], lower: usize) -> Pair {
    match rows.get(lower..lower + 2) {
        Some(&[low, high]) => Pair { low, high },
        _ => Pair { low: 0, high: 0 },
    }
}

impl Pair {
    /// Value between the rows, `share` / 256 of the way up.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a mean of bytes
    fn at(self, share: u8) -> u8 {
        let (low, high) = (i32::from(self.low), i32::from(self.high));
        ((low * 256 + (high - low) * i32::from(share)) >> 8) as u8
    }
}

/// Lowers the grades of cells between two distances, from cell `first` on, by the part of them that is hidden.
/// What is unknown stays unknown.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // range indices and bytes
pub(super) fn shade<const R: usize>(
    grades: &mut [u8; R],
    first: usize,
    (from, to): (i32, i32),
    cell_cm: i32,
    share: u8,
) {
    let cell_cm = cell_cm.max(1);
    let to = to.min(R as i32 * cell_cm);
    let (first, last) = (first.max((from / cell_cm) as usize), (to / cell_cm) as usize);
    let lower = |g: &mut u8, by: u8| {
        if *g > BLOCKED {
            *g = (*g).min((CLEAR - by).max(BLOCKED));
        }
    };
    for g in grades.get_mut(first..last).unwrap_or(&mut []) {
        lower(g, share);
    }
    if let Some(g) = grades.get_mut(last).filter(|_| last >= first) {
        lower(g, (i32::from(share) * (to - last as i32 * cell_cm) / cell_cm) as u8);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::trig::Direction;
    use crate::grid::shadow;
    use crate::map::{Visibility, VisibilityMap};
    use crate::obstacles::solid::Solid;
    use crate::sensor::field_of_view::FieldOfView;
    use crate::sensor::mount::Mount;
    use crate::sensor::road::RoadPoint;
    use std::format;
    use std::string::String;

    const VIEW: FieldOfView = FieldOfView {
        azimuth_min_deg: -30.0,
        azimuth_max_deg: 30.0,
        elevation_min_deg: -30.0,
        elevation_max_deg: 16.0,
        range_min_m: 1.0,
        range_max_m: 100.0,
    };

    /// Draws a map over the road: rows from left (top) to right, x ahead to the right; a character
    /// is 5 m along by 2.5 m across. `.` visible, `#` invisible, `?` unknown, `O` visible and occupied.
    fn draw(height_m: f32, yaw_deg: f32, solids: &[Solid]) -> String {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m, yaw_deg, pitch_deg: 0.0, roll_deg: 0.0 };
        let levelling = mount.levelling().unwrap();
        let axes = Axes::<100, 120, 16>::new(&levelling, &VIEW, 1.0).unwrap();
        let mut grid = SphericalGrid::<100, 120, 16>::new();
        let mut map = PolarMap::unknown(axes.polar(&levelling), 128, 128);
        cast(&grid, &axes, &mut map);
        for s in solids {
            shadow::cast(s, &axes, &mut grid, &mut map);
        }
        let mut picture = String::new();
        for j in (-4..=4).rev() {
            for i in 0..20 {
                let s = map.at(RoadPoint::new(i * 500 + 250, j * 250));
                picture.push(match (s.visibility, s.occupied) {
                    (Visibility::Unknown, _) => '?',
                    (Visibility::Invisible, _) => '#',
                    (Visibility::Visible, false) => '.',
                    (Visibility::Visible, true) => 'O',
                });
            }
            picture.push('\n');
        }
        format!("\n{picture}")
    }

    fn car(x_cm: i32, y_cm: i32, height_cm: i32) -> Solid {
        Solid { x_cm, y_cm, heading: Direction::AHEAD, half_length_cm: 260, half_width_cm: 140, height_cm }
    }

    #[test]
    fn a_truck_to_the_left_hides_the_left() {
        // rear edge at 22.6 m, 4 m high, seen from 6 m: hidden as far as 22.6 * 5 / 2 = 56 m
        let expected = "
???.....###.........
???...#####.........
??..#######.........
??.OO##.............
??..................
??..................
??..................
???.................
???.................
";
        assert_eq!(draw(6.0, 0.0, &[car(2000, 300, 400)]), expected);
    }

    #[test]
    fn a_truck_to_the_right_hides_the_right_and_a_car_only_a_little() {
        let expected = "
???.................
???.................
??..................
??..................
??..................
??.OO...............
??..................
???.................
???.................
";
        // 1.5 m high: hidden as far as 22.6 * 5 / 4.5 = 25 m
        assert_eq!(draw(6.0, 0.0, &[car(2000, -300, 150)]), expected);
    }

    #[test]
    fn a_low_sensor_sees_nothing_behind_what_is_higher() {
        let expected = "
???.................
???................#
??...........#######
?.....##############
?..OO###############
?.....##############
??...........#######
???................#
???.................
";
        assert_eq!(draw(3.5, 0.0, &[car(2000, 0, 400)]), expected);
    }

    #[test]
    fn something_below_the_slice_plane_hides_nothing_on_it() {
        let picture = draw(6.0, 0.0, &[car(2000, 300, 70)]);
        assert!(!picture.contains('#') && !picture.contains('O'), "{picture}");
    }

    #[test]
    fn a_gap_between_two_trucks_is_hidden_and_both_rears_are_not_one() {
        // the second stands in the first one's shadow: neither it nor what is behind it is visible
        let picture = draw(3.5, 0.0, &[car(2000, 0, 400), car(4000, 0, 400)]);
        let middle = picture.lines().nth(5);
        assert_eq!(middle, Some("?..OO###############"));
    }

    #[test]
    fn a_turned_sensor_looks_to_its_side() {
        let left = draw(6.0, 20.0, &[]);
        let (top, bottom) = (left.lines().nth(1).unwrap(), left.lines().nth(9).unwrap());
        assert!(top.matches('?').count() < bottom.matches('?').count(), "yaw is to the left:{left}");
    }
}

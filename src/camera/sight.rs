//! Lines of sight from the camera through the voxels, and what of each column they reach.
//!
//! # Model
//! Rows are walked away from the camera. What is occupied stands on the road, so in one direction the voxels that
//! are hidden are those below one line, and all lines of a direction are cast together: the highest slope that an
//! occupied column met so far has blocked, a running maximum, as in the grid of the radar. Directions are fine steps of
//! y / x, for which a line in space is straight in (x, height); a column that lies below the camera blocks up to
//! the line over its far upper edge, a higher one up to that over its near upper edge.
//!
//! A thing never hides itself, as in the grid of the radar: an occupied run blocks behind its end only, so that the
//! columns of a vehicle, and the trail of what fades before it, keep what is seen of its front. The mean visibility
//! of a column's voxels, 0 to 4 m above the road, is the part of that height which is above the line and in the
//! image.
//!
//! # Limits
//! One step of direction is 1/1024 of the view: 0.24 m at 200 m and 60 degrees.

use crate::camera::projection::Projection;
use crate::camera::voxels::{CELL_CM, FULL, LEVELS, TOPS, VOXEL_CM, Voxels, middle_of, top_of};
use crate::fixed::math;

/// Steps of direction.
const STEPS: usize = 1024;

/// Slope of a direction in which nothing is blocked.
const OPEN: i32 = i32::MIN;

/// Height that is judged above each cell, centimetres.
const JUDGED_CM: i32 = LEVELS * VOXEL_CM;

/// Nearest distance that is computed with, centimetres.
const NEAREST_CM: i32 = CELL_CM / 2;

/// Where the image ends above a place: height = camera + x slope + y slope; 2^-16.
#[derive(Debug, Clone, Copy)]
struct Border {
    x: i32,
    y: i32,
}

/// The view over a grid of `NX` by `NY` cells.
#[derive(Debug, Clone)]
pub(crate) struct View<const NX: usize> {
    height_cm: i32,
    /// Columns in view of each row, first and end.
    rows: [(u16, u16); NX],
    /// Greatest y / x of the cells in view, to the right and to the left.
    pub(crate) tangents: [f32; 2],
    /// Steps of direction in one of y / x, and the step straight ahead, 2^-8.
    steps: i32,
    ahead: i32,
    upper: Option<Border>,
    lower: Option<Border>,
}

/// The highest slope blocked in each direction.
#[derive(Debug, Clone)]
pub(crate) struct Skyline {
    directions: [Blocked; STEPS],
}

/// What is blocked in a direction, slopes in 2^-16.
#[derive(Debug, Clone, Copy)]
struct Blocked {
    /// By all runs but the last.
    before: i32,
    /// By the last run of occupied columns.
    last: i32,
    /// The row behind the last run's end.
    end: u16,
}

impl Skyline {
    /// Before the first frame: zeros, so that a static of it takes no flash.
    pub(crate) const NEW: Self = Self { directions: [Blocked { before: 0, last: 0, end: 0 }; STEPS] };

    /// Nothing is blocked.
    fn open(&mut self) {
        self.directions.fill(Blocked { before: OPEN, last: OPEN, end: 0 });
    }
}

impl Blocked {
    /// The slope below which a column of this row is hidden; where it is occupied and the last run reaches it, it
    /// is a part of that.
    #[inline] // once a cell
    fn slope(&self, row: u16, occupied: bool) -> i32 {
        if occupied && self.end == row { self.before } else { self.before.max(self.last) }
    }

    /// Adds an occupied column of this row.
    #[inline] // once a direction
    fn add(&mut self, row: u16, slope: i32) {
        if self.end < row {
            self.before = self.before.max(self.last);
            self.last = slope;
        }
        self.last = self.last.max(slope);
        self.end = row + 1;
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)] // cell indices
impl<const NX: usize> View<NX> {
    /// Cells whose middle is in the image at this height, and within this range; `None` if there are none.
    pub(crate) fn new<const NY: usize>(p: &Projection, slice_cm: i32, range_cm: i32) -> Option<Self> {
        let mut rows = [(0, 0); NX];
        let mut tangents = [0.0_f32; 2];
        let mut any = false;
        for (i, row) in rows.iter_mut().enumerate() {
            let x = i as i32 * CELL_CM + CELL_CM / 2;
            let seen = |j: &usize| {
                let y = middle_of(*j, NY);
                math::length(x, y) <= range_cm && p.in_image([x, y, slice_cm])
            };
            // the image is convex, and so is what is seen of a row
            let (Some(first), Some(last)) = ((0..NY).find(seen), (0..NY).rev().find(seen)) else { continue };
            let of = |j: usize, side: i32| (middle_of(j, NY) + side) as f32 / x as f32;
            let (right, left) = (of(first, -CELL_CM / 2), of(last, CELL_CM / 2));
            tangents = if any { [tangents[0].min(right), tangents[1].max(left)] } else { [right, left] };
            any = true;
            *row = (first as u16, last as u16 + 1);
        }
        let steps = STEPS as f32 / (tangents[1] - tangents[0]) * 256.0;
        let [_, top, _, bottom] = p.border.map(|t| t as f32 / 65_536.0);
        any.then(|| Self {
            height_cm: p.height_cm,
            rows,
            tangents,
            steps: math::round_i32(steps),
            ahead: math::round_i32(-tangents[0] * steps),
            // inside: up <= top * ahead, up >= bottom * ahead
            upper: Border::of(p.level([top, 0.0, -1.0])),
            lower: Border::of(p.level([-bottom, 0.0, 1.0])),
        })
    }

    /// Rows of the view straight ahead, from and to.
    pub(crate) fn ahead<const NY: usize>(&self) -> [usize; 2] {
        let seen = |(first, end): &(u16, u16)| (usize::from(*first)..usize::from(*end)).contains(&(NY / 2));
        let from = self.rows.iter().position(seen).unwrap_or(0);
        [from, self.rows.iter().rposition(seen).map_or(from, |last| last + 1)]
    }

    /// Writes how much of each column in view is seen, 1 to 255, and its evidence at the road.
    pub(crate) fn cast<const NY: usize>(
        &self,
        voxels: &Voxels<NX, NY>,
        skyline: &mut Skyline,
        grades: &mut [[u8; NY]; NX],
        occupancy: &mut [[u8; NY]; NX],
    ) {
        skyline.open();
        let mut open = true;
        for (i, ((&(first, end), grades), occupancy)) in self.rows.iter().zip(grades).zip(occupancy).enumerate() {
            let near = (i as i32 * CELL_CM).max(NEAREST_CM);
            let (x, far) = (i as i32 * CELL_CM + CELL_CM / 2, (i as i32 + 1) * CELL_CM);
            let (row, columns) = (i as u16, voxels.row(i));
            let view = usize::from(first)..usize::from(end);
            let (y, last) = (middle_of(view.start, NY), middle_of(view.end, NY) - CELL_CM);
            let upper = Limit::of(self.upper, x, y, self.height_cm, JUDGED_CM);
            let lower = Limit::of(self.lower, x, y, self.height_cm, 0);
            // a border is straight: where it is beyond the column at both ends of the row it is so between
            let whole = upper.at(last - y).min(upper.at(0)) >= JUDGED_CM && lower.at(last - y).max(lower.at(0)) <= 0;
            if let (Some(grades), Some(occupancy)) = (grades.get_mut(view.clone()), occupancy.get_mut(view.clone())) {
                if whole && open && columns.is_none() {
                    grades.fill(u8::MAX);
                    occupancy.fill(0);
                } else {
                    let columns = columns.and_then(|c| c.get(view)).unwrap_or(&[]);
                    let columns = columns.iter().copied().chain(core::iter::repeat(0));
                    let per_cell = self.per_cm(x) * i64::from(CELL_CM);
                    let mut at = (i64::from(self.ahead) << 12) + self.per_cm(x) * i64::from(y);
                    let mut aside = 0;
                    for ((grade, occupied), column) in grades.iter_mut().zip(occupancy).zip(columns) {
                        let blocked = skyline.directions.get((at >> 20) as usize);
                        let slope = blocked.map_or(OPEN, |b| b.slope(row, column & TOPS != 0));
                        let (mut low, mut high) = (0, JUDGED_CM);
                        if !whole {
                            (low, high) = (lower.at(aside).max(0), upper.at(aside).min(JUDGED_CM));
                        }
                        if slope != OPEN {
                            low = low.max(self.height_cm + math::mul_shift(slope, x, 16));
                        }
                        // 254 / 400, 2^-8 rounded up
                        *grade = (((high - low).max(0) * 163) >> 8) as u8 + 1;
                        *occupied = (column & u32::from(FULL)) as u8 * (u8::MAX / FULL);
                        at += per_cell;
                        aside += CELL_CM;
                    }
                }
            }
            let Some(columns) = columns else { continue };
            let (at_near, at_far) = (self.per_cm(near), self.per_cm(far));
            for (j, column) in columns.iter().enumerate() {
                let top = top_of(*column);
                if top == 0 {
                    continue;
                }
                open = false;
                let above = top - self.height_cm;
                let slope = (above << 16) / if above < 0 { far.max(NEAREST_CM) } else { near };
                let (right, left) = (middle_of(j, NY) - CELL_CM / 2, middle_of(j, NY) + CELL_CM / 2);
                // the widest that it is seen
                let from = self.edge(right, if right > 0 { at_far } else { at_near });
                let to = self.edge(left, if left > 0 { at_near } else { at_far });
                for blocked in skyline.directions.get_mut(from..to.max(from)).into_iter().flatten() {
                    blocked.add(row, slope);
                }
            }
        }
    }

    /// Steps of direction a centimetre makes at a distance, 2^-20.
    fn per_cm(&self, x: i32) -> i64 {
        (i64::from(self.steps) << 12) / i64::from(x.max(1))
    }

    /// The first step of direction whose middle lies to the left of a place.
    fn edge(&self, y: i32, per_cm: i64) -> usize {
        let at = (i64::from(self.ahead) + ((i64::from(y) * per_cm) >> 12) + 127) >> 8;
        at.clamp(0, STEPS as i64) as usize
    }
}

impl Border {
    /// Of the plane through the camera with this normal; `None` where it does not end above or below any place.
    fn of([x, y, z]: [f32; 3]) -> Option<Self> {
        /// A plane nearer to upright than this is none.
        const UPRIGHT: f32 = 0.05;
        let slope = |v: f32| math::round_i32(-v / z * 65_536.0);
        (z.abs() > UPRIGHT).then(|| Self { x: slope(x), y: slope(y) })
    }
}

/// A border along a row: its height above the road.
#[derive(Debug, Clone, Copy)]
struct Limit {
    base: i32,
    /// Where the row's first column lies, 2^-16, and what a centimetre across adds.
    start: i64,
    slope: i32,
}

impl Limit {
    /// Of a row at `x` whose first column is at `y`; without a border, one that is everywhere at `none`.
    fn of(border: Option<Border>, x: i32, y: i32, height_cm: i32, none: i32) -> Self {
        let Some(Border { x: along, y: across }) = border else { return Self { base: none, start: 0, slope: 0 } };
        let base = height_cm + math::mul_shift(along, x, 16);
        Self { base, start: i64::from(across) * i64::from(y), slope: across }
    }

    /// So far to the left of the first column.
    #[allow(clippy::cast_possible_truncation)] // a slope below 20 over at most 100 m
    fn at(&self, aside: i32) -> i32 {
        self.base + ((self.start + i64::from(self.slope) * i64::from(aside)) >> 16) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::calibration::{Calibration, Intrinsics};
    use crate::camera::voxels::Standing;
    use crate::fixed::trig::Direction;
    use crate::sensor::mount::Mount;
    use std::boxed::Box;
    use std::vec::Vec;

    fn projection(height_m: f32, pitch_deg: f32) -> Projection {
        Projection::new(&Calibration {
            intrinsics: Intrinsics { size_px: [1920, 1080], focal_px: [1600.0, 1600.0], center_px: [960.0, 540.0] },
            mount: Mount { x_m: 0.0, y_m: 0.0, height_m, yaw_deg: 0.0, pitch_deg, roll_deg: 0.0 },
        })
        .unwrap()
    }

    type Grid = Voxels<150, 40>;

    /// Shares of every cell in view, 0 to 254, of boxes (near, far, right, left, height), metres.
    fn shares(p: &Projection, boxes: &[[f64; 5]]) -> Vec<[Option<u8>; 40]> {
        let mut grid = Box::new(Grid::EMPTY);
        for [near, far, right, left, height] in boxes {
            let cm = |v: f64| (v * 100.0) as i32;
            grid.fill(&Standing {
                at: (cm((near + far) / 2.0), cm((right + left) / 2.0)),
                heading: Direction::AHEAD,
                half_length: cm((far - near) / 2.0),
                half_width: cm((left - right) / 2.0),
                height: cm(*height),
            });
        }
        let view = View::<150>::new::<40>(p, 100, 20_000).unwrap();
        let (mut skyline, mut grades, mut occupancy) = (Skyline::NEW, [[0_u8; 40]; 150], [[0; 40]; 150]);
        view.cast(&grid, &mut skyline, &mut grades, &mut occupancy);
        grades.iter().map(|row| row.map(|grade| grade.checked_sub(1))).collect()
    }

    const TRUCK: [f64; 5] = [40.0, 52.0, -1.0, 2.0, 4.0];

    #[test]
    fn a_truck_hides_what_is_behind_it_and_not_what_is_before() {
        let shares = shares(&projection(6.0, 4.0), &[TRUCK]);
        // column 20 lies from 0 to 1 m to the left
        assert_eq!(shares[30][20], Some(254), "before it");
        assert_eq!((shares[40][20], shares[51][20]), (Some(254), Some(254)), "all of it is seen as its front is");
        // behind its far end at 52 m the line over the top falls 2 m in 52
        for x in [55, 70, 100, 140] {
            let line: f64 = 6.0 - 2.0 * (f64::from(x) + 0.5) / 52.0;
            let expected = 254.0 * (4.0 - line.max(0.0)) / 4.0;
            let got = f64::from(shares[x as usize][20].unwrap());
            assert!((got - expected).abs() < 3.0, "{x} m: {got} for {expected}");
        }
        assert_eq!(shares[70][27], Some(254), "beside its shadow");
    }

    #[test]
    fn a_shadow_lies_on_the_side_of_what_casts_it() {
        let p = projection(6.0, 4.0);
        let left = shares(&p, &[[30.0, 40.0, 4.0, 7.0, 4.0]]);
        let right = shares(&p, &[[30.0, 40.0, -7.0, -4.0, 4.0]]);
        // 5.5 m at 35 m is 9.4 m at 60 m
        assert!(left[60][29].unwrap() < 150 && left[60][10] == Some(254), "{:?}", left[60]);
        for (a, b) in left.iter().zip(&right) {
            let mirrored: Vec<_> = b.iter().rev().copied().collect();
            let off = a.iter().zip(&mirrored).filter(|(a, b)| a != b).count();
            assert!(off <= 1, "{a:?}\n{mirrored:?}");
        }
    }

    #[test]
    fn over_a_car_a_part_is_seen_and_over_one_higher_than_the_camera_nothing() {
        let low = shares(&projection(6.0, 4.0), &[[30.0, 34.0, -1.0, 1.0, 1.5]]);
        let behind = low[36][20].unwrap();
        // the line over 1.5 m falls 4.5 m in 34: at 36.5 m it is at 1.17 m
        assert!((i32::from(behind) - 180).abs() < 5, "{behind}");
        assert_eq!(low[60][20], Some(254), "seen over");
        let bumper = shares(&projection(2.0, 0.0), &[[30.0, 40.0, -2.0, 2.0, 4.0]]);
        assert_eq!((bumper[45][20], bumper[149][20]), (Some(0), Some(0)), "no line passes over it");
    }

    #[test]
    fn what_stands_behind_a_gap_is_hidden_by_what_stands_before_it() {
        let car = [56.0, 60.0, 0.0, 2.0, 1.5];
        let both = shares(&projection(6.0, 4.0), &[TRUCK, car]);
        let line = 6.0 - 2.0 * 58.5 / 52.0;
        let expected = (254.0 * (4.0 - line) / 4.0) as i32;
        let got = i32::from(both[58][20].unwrap());
        assert!((got - expected).abs() < 4, "{got} for {expected}: no lower than the truck leaves it, and no higher");
        // the run that began again blocks no less than the first
        let alone = shares(&projection(6.0, 4.0), &[TRUCK]);
        assert!((60..150).all(|x| both[x][20] <= alone[x][20]));
    }

    #[test]
    fn cells_outside_of_the_image_are_not_told() {
        let shares = shares(&projection(6.0, 4.0), &[]);
        // 540 px of 1600 below the axis, 4 degrees down: 22.6 degrees; 5 m below after 12 m
        assert_eq!((shares[10][20], shares[13][20].is_some()), (None, true));
        // 0.6 to each side
        let to = |x: usize| shares[x].iter().filter(|s| s.is_some()).count();
        assert!((to(20) as i32 - 24).abs() <= 2, "{}", to(20));
        assert_eq!(to(60), 40);
    }

    #[test]
    fn what_of_a_column_is_outside_of_the_image_is_not_seen() {
        // level at 2 m: the upper border rises 0.3375 a metre; at 3 m it is at 3 m
        let shares = shares(&projection(2.0, 0.0), &[]);
        let share = f64::from(shares[3][20].unwrap());
        // at 3.5 m from 0.82 to 3.18 m
        assert!((share - 254.0 * 2.36 / 4.0).abs() < 4.0, "{share}");
        assert_eq!(shares[10][20], Some(254));
    }

    #[test]
    fn a_camera_at_the_sky_sees_no_cell() {
        assert!(View::<150>::new::<40>(&projection(6.0, -30.0), 100, 20_000).is_none());
    }
}

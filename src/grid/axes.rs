//! The axes of the sensor-centred grid: azimuth columns, range cells, elevation rows.
//!
//! # Model
//! All three are taken in the levelled frame, so that a line of sight is one column and one row.
//! Range runs along the ground. Elevation is given as *slope*, height over ground range, which is
//! what similar triangles need. Rows are laid where the slice plane needs them: their edges are the
//! slopes under which the plane at slice height is seen at ground distances
//! `(sqrt(near) + k (sqrt(far) - sqrt(near)) / E)^2`. Uniform rows would spend most of their number
//! on sky: from 6 m, one of 2 degrees covers the road from 71 to 143 m.
//!
//! Over a road that is not flat the slice is no plane, and farther is no longer higher: rows are laid where slopes to
//! the slice gather, and a cell's place between them is found when it is asked for, one division each. A table of them
//! would take 48 kB.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::trig::{self, Direction};
use crate::map::azimuths::{Columns, Narrow};
use crate::map::polar::PolarGeometry;
use crate::sensor::config::{ConfigError, Problem, within};
use crate::sensor::field_of_view::FieldOfView;
use crate::sensor::ground::{Ground, SLOPE_BITS};
use crate::sensor::mount::Levelling;

/// Height above or below the sensor up to which slopes fit, centimetres.
const FARTHEST_RISE_CM: i32 = 4000;

/// The steepest edge a row can have: 89.8 degrees.
const STEEPEST: i32 = 1 << (SLOPE_BITS + 8);

/// What lies this close to an angular limit of the field of view lies on it.
const ON_THE_LIMIT_DEG: f32 = 0.01;

/// The view of a column the slice plane never enters.
const NOTHING: (u8, u8) = (1, 0);

/// A sensor closer to the slice plane than this has no slopes to measure distances by, centimetres.
const LEAST_DROP_CM: i32 = 10;

/// Least height of a row over ground that is not level, a slope: 5 cm at 200 m.
const LEAST_ROW: i32 = 64;

/// Geometry of a grid of `R` range cells, `A` azimuth columns and `E` elevation rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Axes<const R: usize, const A: usize, const E: usize> {
    /// Length of a range cell, centimetres.
    pub cell_cm: i32,
    /// Levelled azimuth of the first column's right edge.
    pub azimuth_origin: Angle,
    /// Width of all columns together, 2^-16 turn.
    pub azimuth_span: u16,
    /// Columns that are narrower than the others.
    pub narrow: Narrow,
    /// Height of the sensor, centimetres.
    height_cm: i32,
    /// Height of the slice plane, centimetres.
    slice_cm: i32,
    /// Lower edges of the rows, ascending slopes, 2^-18.
    row_edges: [i32; E],
    /// Upper edge of the last row.
    row_top: i32,
    /// For every range cell: the slice point's weight of the upper of its two rows, 2^-8.
    slice_share: [u8; R],
    /// Stretches of range cells whose slice points lie above the same row's centre.
    slice_rows: [SliceRow; E],
    /// For every column: the first and the last range cell in view on the slice plane.
    view: [(u8, u8); A],
    /// Directions of the columns' centres, which every box asks for in every frame.
    directions: [Direction; A],
    /// Heights of the road; where it is flat, `slice_share` and `slice_rows` hold.
    ground: Ground,
}

/// A stretch of range cells on which the slice plane runs between the same two rows' centres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SliceRow {
    /// The lower row.
    pub lower: u8,
    /// First range cell behind the stretch; stretches follow one another from the first cell on.
    pub end: u16,
}

/// Place of a column's centre on the column axis, 2^-8 columns.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // below 2^8 columns
pub(super) const fn column_centre(column: usize) -> i32 {
    column as i32 * 256 + 128
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // indices below 2^8
impl<const R: usize, const A: usize, const E: usize> Axes<R, A, E> {
    /// Lays the axes for a mount and a field of view.
    ///
    /// # Errors
    /// A field of view that the slice plane never enters.
    pub fn new(levelling: &Levelling, view: &FieldOfView, slice_height_m: f32) -> Result<Self, ConfigError> {
        Self::on(Ground::LEVEL, levelling, view, slice_height_m, None)
    }

    /// Lays the axes over a road that need not be flat, columns narrower around where the far road lies, if that is
    /// said in degrees from the boresight's heading.
    ///
    /// # Errors
    /// A field of view that the slice never enters; a far road outside of it.
    pub fn on(
        ground: Ground,
        levelling: &Levelling,
        view: &FieldOfView,
        slice_height_m: f32,
        far_road_deg: Option<i8>,
    ) -> Result<Self, ConfigError> {
        const { assert!(R <= crate::fixed::bits::RangeBits::CAPACITY && R >= 2 && A >= 2 && E >= 2 && A <= 255 && E <= 64) }
        let limits = view.limits()?;
        within("visibility.slice_height_m", slice_height_m, 0.0, 10.0)?;
        let cell_cm = (limits.range_cm[1] + R as i32 - 1) / R as i32;
        let slice_cm = math::round_i32(slice_height_m * 100.0);
        let drop = levelling.height_cm - slice_cm;
        let drop = if drop.abs() < LEAST_DROP_CM { LEAST_DROP_CM } else { drop };
        let mut axes = Self {
            cell_cm,
            azimuth_origin: Angle::ZERO,
            azimuth_span: 0,
            narrow: Narrow::NONE,
            height_cm: slice_cm + drop,
            slice_cm,
            row_edges: [0; E],
            row_top: 0,
            slice_share: [0; R],
            slice_rows: [SliceRow { lower: 0, end: 0 }; E],
            view: [NOTHING; A],
            directions: [Direction::AHEAD; A],
            ground,
        };
        // a limit itself is in view, whatever a float makes of it
        let wide = FieldOfView {
            azimuth_min_deg: view.azimuth_min_deg - ON_THE_LIMIT_DEG,
            azimuth_max_deg: view.azimuth_max_deg + ON_THE_LIMIT_DEG,
            elevation_min_deg: view.elevation_min_deg - ON_THE_LIMIT_DEG,
            elevation_max_deg: view.elevation_max_deg + ON_THE_LIMIT_DEG,
            ..*view
        };
        let ground = axes.ground.clone();
        let in_view = |bearing: f32, ground_cm: f32| {
            let (x, y) = (math::cos(bearing) * ground_cm, math::sin(bearing) * ground_cm);
            let foot_cm = ground.height_cm(math::round_i32(x), math::round_i32(y));
            wide.contains(levelling.unlevel_exact([x, y, (foot_cm - drop) as f32]).map(|v| v / 100.0))
        };
        axes.lay_columns(&in_view).ok_or(ConfigError {
            parameter: "field_of_view.elevation_min_deg",
            value: view.elevation_min_deg,
            problem: Problem::NothingInView,
        })?;
        if let Some(far_road) = far_road_deg {
            let (least, most) = (view.azimuth_min_deg, view.azimuth_max_deg);
            let far_road = Angle::from_degrees(within("visibility.far_road_deg", f32::from(far_road), least, most)?);
            axes.narrow = Narrow::towards(far_road - axes.azimuth_origin, axes.azimuth_span, A);
        }
        axes.directions = core::array::from_fn(|a| trig::direction(axes.azimuth_of(column_centre(a))));
        axes.find_view(&in_view);
        if axes.ground.is_level() {
            axes.lay_rows(drop);
        } else {
            axes.lay_rows_over_ground();
        }
        Ok(axes)
    }

    /// Widest azimuths at which the slice plane is in view, with a quarter of a degree to spare.
    fn lay_columns(&mut self, in_view: &impl Fn(f32, f32) -> bool) -> Option<()> {
        const STEPS: i32 = 720;
        let far = (self.cell_cm * R as i32) as f32;
        let bearing = |i: i32| (i as f32 / STEPS as f32 - 0.5) * core::f32::consts::PI;
        let any = |i: &i32| (1..=24).any(|k| in_view(bearing(*i), far * (k as f32 - 0.5) / 24.0));
        let first = (0..=STEPS).find(any)?;
        let last = (0..=STEPS).rev().find(any)?;
        self.azimuth_origin = Angle::from_radians(bearing(first - 1));
        let right = self.azimuth_origin;
        self.azimuth_span = (Angle::from_radians(bearing(last + 1)) - right).raw() as u16;
        Some(())
    }

    /// The longest stretch of cells in view: a ray across a turned field of view can leave and enter
    /// it again, and what lies between must stay unknown.
    fn find_view(&mut self, in_view: &impl Fn(f32, f32) -> bool) {
        for a in 0..A {
            let bearing = self.azimuth_of(column_centre(a)).radians();
            let mut stretch = 0..0;
            let mut longest = 0..0;
            for r in 0..R {
                if !in_view(bearing, (r as f32 + 0.5) * self.cell_cm as f32) {
                    continue;
                }
                let start = if stretch.end == r { stretch.start } else { r };
                stretch = start..r + 1;
                if stretch.len() > longest.len() {
                    longest = stretch.clone();
                }
            }
            if let (Some(v), false) = (self.view.get_mut(a), longest.is_empty()) {
                *v = (longest.start as u8, (longest.end - 1) as u8);
            }
        }
    }

    fn lay_rows(&mut self, drop: i32) {
        let near_cell = self.view.iter().filter(|v| **v != NOTHING).map(|v| v.0).min().unwrap_or(0);
        let near = math::sqrt((f32::from(near_cell) + 0.5) * self.cell_cm as f32);
        let far = math::sqrt((self.cell_cm * R as i32) as f32);
        let slope = |k: usize| {
            // ascending slopes: from near to far if the sensor looks down on the plane, else back
            let k = if drop > 0 { k } else { E - k };
            let root = near + (far - near) * k as f32 / E as f32;
            math::round_i32(-(drop as f32) / (root * root) * (1 << SLOPE_BITS) as f32).clamp(-STEEPEST, STEEPEST)
        };
        for (k, edge) in self.row_edges.iter_mut().enumerate() {
            *edge = slope(k);
        }
        self.row_top = slope(E);
        let mut stretch = 0;
        for r in 0..R {
            let ground = r as i32 * self.cell_cm + self.cell_cm / 2;
            let place = self.row_place(self.slope(self.height_cm - drop, ground)) - 128;
            let place = place.clamp(0, (E as i32 - 1) * 256);
            let lower = (place >> 8).min(E as i32 - 2);
            if let Some(share) = self.slice_share.get_mut(r) {
                *share = (place - lower * 256).min(255) as u8;
            }
            if r > 0 && self.slice_rows.get(stretch).is_some_and(|s| i32::from(s.lower) != lower) {
                stretch += 1;
            }
            // places are monotonic in range, so there are at most as many stretches as rows
            for s in self.slice_rows.iter_mut().skip(stretch) {
                *s = SliceRow { lower: lower as u8, end: r as u16 + 1 };
            }
        }
    }

    /// Rows for a slice that follows the ground: edges are quantiles of the slopes under which it is seen at distances
    /// that are dense near the sensor, along the road and along both edges of the view.
    fn lay_rows_over_ground(&mut self) {
        let near_cell = self.view.iter().filter(|v| **v != NOTHING).map(|v| v.0).min().unwrap_or(0);
        let near = math::sqrt((f32::from(near_cell) + 0.5) * self.cell_cm as f32);
        let far = math::sqrt((self.cell_cm * R as i32) as f32);
        let seen = |a: &usize| !self.view(*a).is_empty();
        let (right, left) = ((0..A).find(seen).unwrap_or(0), (0..A).rev().find(seen).unwrap_or(0));
        let on_road = |a: &usize| self.ground.along_road(self.column_direction(*a)).abs();
        let road = (right..=left).max_by_key(on_road).unwrap_or(right);
        let mut slopes = [[0; 4]; E];
        for (k, part) in slopes.iter_mut().enumerate() {
            for (quarter, (slope, column)) in part.iter_mut().zip([road, right, road, left]).enumerate() {
                let root = near + (far - near) * (k as f32 + quarter as f32 / 4.0) / E as f32;
                *slope = self.slice_slope(column, math::round_i32(root * root));
            }
        }
        let slopes = slopes.as_flattened_mut();
        sort(slopes);
        let mut lowest = i32::MIN;
        for (edge, slope) in self.row_edges.iter_mut().zip(slopes.iter().step_by(4)) {
            *edge = (*slope).clamp(-STEEPEST, STEEPEST).max(lowest);
            lowest = *edge + LEAST_ROW;
        }
        self.row_top = slopes.last().copied().unwrap_or(0).clamp(lowest, STEEPEST.max(lowest));
    }

    /// Slope under which the slice is seen in a column, at a distance along the ground.
    fn slice_slope(&self, column: usize, ground_cm: i32) -> i32 {
        let towards = self.column_direction(column);
        let along = |part: i16| (i32::from(part) * ground_cm) >> 14;
        self.slope(self.ground.height_cm(along(towards.x), along(towards.y)) + self.slice_cm, ground_cm)
    }

    /// The lower of the two rows between whose centres the slice lies in a cell, over ground that is not level, and its
    /// share of the upper.
    pub fn slice_place(&self, column: usize, cell: usize) -> (usize, u8) {
        let place = self.row_place(self.slice_slope(column, cell as i32 * self.cell_cm + self.cell_cm / 2)) - 128;
        let place = place.clamp(0, (E as i32 - 1) * 256);
        let lower = (place >> 8).min(E as i32 - 2);
        (lower as usize, (place - lower * 256).min(255) as u8)
    }

    /// Heights of the road.
    pub fn ground(&self) -> &Ground {
        &self.ground
    }

    /// Where the road itself hides the slice above it in a column, centimetres: behind a crest.
    pub fn hidden_by_ground(&self, column: usize) -> impl Iterator<Item = (i32, i32)> {
        let mut horizon = None;
        self.ground.stretches(self.column_direction(column)).filter_map(move |stretch| {
            let hidden = horizon.and_then(|slope| stretch.below(slope, self.height_cm, self.slice_cm));
            let end = stretch.end_slope(self.height_cm);
            horizon = Some(horizon.map_or(end, |slope: i32| slope.max(end)));
            hidden
        })
    }

    /// Where a box hides the slice over ground that is not level, centimetres, if its top lies this high above the
    /// ground below the sensor and rays enter and leave it at these distances.
    pub fn hidden_over_ground(
        &self,
        column: usize,
        top_cm: i32,
        enter_cm: i32,
        leave_cm: i32,
    ) -> impl Iterator<Item = (i32, i32)> {
        let slope = self.slope(top_cm, enter_cm).max(self.slope(top_cm, leave_cm));
        let behind = self.ground.stretches(self.column_direction(column));
        let below = behind.filter_map(move |stretch| stretch.below(slope, self.height_cm, self.slice_cm));
        below.filter_map(move |(from, to)| (to > leave_cm).then_some((from.max(leave_cm), to)))
    }

    /// The geometry of the maps cast on these axes.
    pub fn polar(&self, levelling: &Levelling) -> PolarGeometry {
        PolarGeometry {
            levelling: *levelling,
            cell_cm: self.cell_cm,
            azimuth_origin: self.azimuth_origin,
            azimuth_span: self.azimuth_span,
            narrow: self.narrow,
        }
    }

    /// Height the slopes are taken from, centimetres.
    pub fn sensor_height_cm(&self) -> i32 {
        self.height_cm
    }

    /// Height of the slice plane, centimetres.
    pub fn slice_cm(&self) -> i32 {
        self.slice_cm
    }

    /// Between which distances a box of this height hides the slice plane, centimetres, if rays enter and
    /// leave it at these (up to 655 m); `None` where it hides nothing of it.
    pub fn hidden_behind(&self, height_cm: i32, enter_cm: i32, leave_cm: i32) -> Option<(i32, i32)> {
        let drop = self.height_cm - self.slice_cm;
        let stretched = |cm: i32, by: i32, over: i32| cm.clamp(0, 0xFFFF) * by / over.max(1);
        if drop > 0 {
            // seen from above: over the far edge
            let left = self.height_cm - height_cm;
            let end = if left > 0 { stretched(leave_cm, drop, left) } else { i32::MAX };
            (height_cm > self.slice_cm).then_some((leave_cm, end))
        } else {
            // from below: over the near edge, and never again
            let over = height_cm - self.height_cm;
            let begin = if height_cm < self.slice_cm { stretched(enter_cm, -drop, over) } else { 0 };
            (over > 0).then_some((leave_cm.max(begin), i32::MAX))
        }
    }

    /// Slope under which a point of this height and ground distance is seen; more than 40 m above or
    /// below the sensor counts as 40 m.
    pub fn slope(&self, height_cm: i32, ground_cm: i32) -> i32 {
        ((height_cm - self.height_cm).clamp(-FARTHEST_RISE_CM, FARTHEST_RISE_CM) << SLOPE_BITS) / ground_cm.max(1)
    }

    /// Height at which a slope passes a ground distance, centimetres.
    pub fn height_at(&self, slope: i32, ground_cm: i32) -> i32 {
        self.height_cm + math::mul_shift(slope, ground_cm, SLOPE_BITS)
    }

    /// Place of a slope on the row axis, 2^-8 rows from the first row's lower edge.
    pub fn row_place(&self, slope: i32) -> i32 {
        let edge = |row: usize| self.row_edges.get(row).copied().unwrap_or(self.row_top);
        let row = self.row_edges.partition_point(|e| *e <= slope).saturating_sub(1);
        let lower = edge(row);
        if slope < lower { 0 } else { row as i32 * 256 + part_of(slope - lower, edge(row + 1) - lower) }
    }

    /// Slope of a row's centre.
    pub fn row_centre(&self, row: usize) -> i32 {
        let low = self.row_edges.get(row).copied().unwrap_or(self.row_top);
        let high = self.row_edges.get(row + 1).copied().unwrap_or(self.row_top);
        (low + high) / 2
    }

    /// Lower and upper slope of a row, for tables and reports.
    pub fn row_slopes(&self, row: usize) -> (f64, f64) {
        let edge = |row: usize| self.row_edges.get(row).copied().unwrap_or(self.row_top);
        let slope = |edge: i32| f64::from(edge) / f64::from(1 << SLOPE_BITS);
        (slope(edge(row)), slope(edge(row + 1)))
    }

    /// Weight of the upper row at every slice point, 2^-8.
    pub fn slice_share(&self) -> &[u8; R] {
        &self.slice_share
    }

    /// The two rows the slice plane runs between, by stretches of range.
    pub fn slice_rows(&self) -> &[SliceRow; E] {
        &self.slice_rows
    }

    /// Place of a bearing on the column axis, 2^-8 columns from the first one's right edge; negative
    /// or beyond `A` columns outside.
    pub fn column_place(&self, bearing: Angle) -> i32 {
        self.columns().place(bearing - self.azimuth_origin)
    }

    /// The same in 2^-8 units of [`Narrow`], in which angles keep their proportions.
    pub fn column_unit(&self, bearing: Angle) -> i32 {
        self.columns().unit(bearing - self.azimuth_origin)
    }

    /// Column of a bearing.
    pub fn column(&self, bearing: Angle) -> Option<usize> {
        self.columns().column(bearing - self.azimuth_origin)
    }

    /// Bearing of a place on the column axis.
    pub fn azimuth_of(&self, place: i32) -> Angle {
        self.azimuth_origin + self.columns().bearing(place)
    }

    fn columns(&self) -> Columns {
        Columns { span: self.azimuth_span, number: A, narrow: self.narrow }
    }

    /// Direction of a place on the column axis.
    pub fn direction_of(&self, place: i32) -> Direction {
        let column = (place >> 8) as usize;
        let central = self.directions.get(column).filter(|_| place == column_centre(column));
        central.map_or_else(|| trig::direction(self.azimuth_of(place)), |d| *d)
    }

    /// Direction of a column's centre; ahead where there is none of this number.
    pub fn column_direction(&self, column: usize) -> Direction {
        self.directions.get(column).copied().unwrap_or(Direction::AHEAD)
    }

    /// Range cell of a ground distance.
    pub fn range_cell(&self, ground_cm: i32) -> Option<usize> {
        usize::try_from(ground_cm / self.cell_cm.max(1)).ok().filter(|r| *r < R)
    }

    /// Range cells of a column that are in view on the slice plane.
    pub fn view(&self, column: usize) -> core::ops::Range<usize> {
        match self.view.get(column) {
            Some(&(first, last)) if first <= last => usize::from(first)..usize::from(last) + 1,
            _ => 0..0,
        }
    }
}

/// Sorts few numbers; `sort_unstable` has a path that panics.
fn sort(numbers: &mut [i32]) {
    for _ in 0..numbers.len() {
        let mut before: Option<&mut i32> = None;
        for number in numbers.iter_mut() {
            if let Some(before) = before.filter(|before| **before > *number) {
                core::mem::swap(before, number);
            }
            before = Some(number);
        }
    }
}

/// What part of a row's height lies below a slope, 2^-8; both from its lower edge.
fn part_of(slope: i32, height: i32) -> i32 {
    if slope >= height {
        256
    } else if slope < 1 << 23 {
        (slope << 8) / height.max(1)
    } else {
        // rows this high lie at the sensor's feet
        slope / (height >> 8).max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::field_of_view::tests::VIEW;
    use crate::sensor::mount::Mount;

    fn axes(height_m: f32, pitch_deg: f32) -> Axes<200, 120, 16> {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m, yaw_deg: 0.0, pitch_deg, roll_deg: 0.0 };
        Axes::new(&mount.levelling().unwrap(), &VIEW, 1.0).unwrap()
    }

    #[test]
    fn left_is_the_higher_column() {
        let a = axes(6.0, 0.0);
        let column = |deg: f32| a.column(Angle::from_degrees(deg));
        assert!(column(30.0) > column(-30.0));
        assert!((a.azimuth_of(60 * 256).radians()).abs() < 0.005, "the middle is straight ahead");
        assert_eq!(column(62.0), None);
        assert_eq!(column(-62.0), None);
        for c in 0..120 {
            assert_eq!(a.column(a.azimuth_of(c * 256 + 128)), Some(c as usize), "centres stay in their column");
        }
    }

    #[test]
    fn near_range_below_the_lower_limit_is_outside_the_view() {
        // 5 m above the plane at 16 degrees: 17.4 m; pitched down 4 degrees: 20 degrees, 13.7 m
        assert_eq!(axes(6.0, 0.0).view(60), 17..200);
        assert_eq!(axes(6.0, 4.0).view(60).start, 14);
        assert!(axes(6.0, 0.0).view(60).end == 200);
    }

    #[test]
    fn rows_ascend_and_the_slice_runs_through_them() {
        for height in [6.0, 3.5, 0.6] {
            let a = axes(height, 0.0);
            assert!(a.row_edges.windows(2).all(|w| w[0] < w[1]), "{height}: {:?}", a.row_edges);
            assert!(*a.row_edges.last().unwrap() < a.row_top);
            let rows: std::vec::Vec<u8> = a.slice_rows.iter().map(|s| s.lower).collect();
            let (near, far) = (rows[0], rows[15]);
            assert_eq!(far > near, height > 1.0, "seen from above, farther is higher; from below, lower");
            assert_eq!(a.slice_rows[15].end, 200, "every range cell lies between two rows");
        }
    }

    #[test]
    fn row_places_interpolate_slopes() {
        let a = axes(6.0, 0.0);
        let (low, high) = (a.row_edges[3], a.row_edges[4]);
        assert_eq!(a.row_place(low), 3 * 256);
        assert!((a.row_place((low + high) / 2) - (3 * 256 + 128)).abs() <= 1);
        assert_eq!(a.row_place(i32::MIN / 2), 0);
        assert_eq!(a.row_place(1 << 18), 16 * 256);
        assert!((a.row_place(a.row_centre(5)) - (5 * 256 + 128)).abs() <= 1);
    }

    #[test]
    fn slopes_fall_towards_the_road_and_give_heights_back() {
        let a = axes(6.0, 0.0);
        let s = a.slope(100, 10_000);
        assert!(s < 0);
        assert!((a.height_at(s, 10_000) - 100).abs() <= 1);
        assert!((a.height_at(s, 5_000) - 350).abs() <= 1, "half way it is half way down");
    }

    #[test]
    fn a_plane_never_in_view_is_an_error() {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: -45.0, roll_deg: 0.0 };
        let view = FieldOfView {
            azimuth_min_deg: -10.0,
            azimuth_max_deg: 10.0,
            elevation_min_deg: -5.0,
            elevation_max_deg: 5.0,
            range_min_m: 3.0,
            range_max_m: 100.0,
        };
        let e = Axes::<100, 64, 8>::new(&mount.levelling().unwrap(), &view, 1.0).unwrap_err();
        let said = "field_of_view.elevation_min_deg is -5: with this mount no point at slice height is in view, check height and pitch";
        assert_eq!(std::format!("{e}"), said);
    }
}

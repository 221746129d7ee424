//! The axes in real numbers, and the grid: one share of occupancy a cell.

use std::ops::Range;

use viewshed::map::azimuths::Narrow;
use viewshed::sensor::field_of_view::FieldOfView;

use crate::geometry::Levelled;

/// Steps to half a turn in which the outermost columns are looked for: a quarter of a degree.
const STEPS: i32 = 720;
/// Distances tried for each.
const DISTANCES: i32 = 24;
/// Nearest the sensor may be to the slice plane, metres.
const LEAST_DROP_M: f64 = 0.1;
/// What lies this close to an angular limit lies on it.
const ON_THE_LIMIT_DEG: f64 = 0.01;

/// Range cells, azimuth columns and elevation rows.
#[derive(Debug, Clone)]
pub struct Axes {
    pub ranges: usize,
    pub azimuths: usize,
    pub rows: usize,
    pub cell_m: f64,
    /// Right edge of the first column, and the width of all.
    pub right_rad: f64,
    pub span_rad: f64,
    /// The first column that is narrower than the others, the first behind them, how many times.
    pub narrow: [f64; 3],
    /// Height the slopes are taken from.
    pub height_m: f64,
    /// Height of the slice plane.
    pub slice_m: f64,
    /// Slopes between the rows, from below the first to above the last.
    edges: Vec<f64>,
    /// For every range cell: the lower of the two rows whose centres the slice point lies between,
    /// and the weight of the upper.
    pub slice: Vec<(usize, f64)>,
    /// For every column: range cells in view on the slice plane.
    pub view: Vec<Range<usize>>,
}

impl Axes {
    /// `shape` counts ranges, azimuths and rows; `narrow` is the library's choice of columns.
    pub fn new(
        shape: [usize; 3],
        levelled: &Levelled,
        view: &FieldOfView,
        slice_height_m: f64,
        narrow: Narrow,
    ) -> Self {
        let [ranges, azimuths, rows] = shape;
        let drop = levelled.height_m - slice_height_m;
        let drop = if drop.abs() < LEAST_DROP_M { LEAST_DROP_M } else { drop };
        // whole centimetres, rounded up
        let cell_m = (f64::from(view.range_max_m) * 100.0 / ranges as f64).ceil() / 100.0;
        let far = cell_m * ranges as f64;
        let in_view = |bearing: f64, ground: f64| {
            let point = [bearing.cos() * ground, bearing.sin() * ground, levelled.height_m - drop];
            contains(view, levelled, point)
        };
        let bearing = |i: i32| (f64::from(i) / f64::from(STEPS) - 0.5) * std::f64::consts::PI;
        let any = |i: &i32| (0..DISTANCES).any(|k| in_view(bearing(*i), far * (f64::from(k) + 0.5) / 24.0));
        let first = (0..=STEPS).find(any).expect("the slice plane is in view");
        let last = (0..=STEPS).rev().find(any).unwrap_or(first);
        let (right_rad, span_rad) = (bearing(first - 1), bearing(last + 1) - bearing(first - 1));
        let centre = |r: usize| (r as f64 + 0.5) * cell_m;
        let narrow = narrow.to_bytes().map(f64::from);
        let view: Vec<Range<usize>> = (0..azimuths)
            .map(|a| {
                let middle = units(narrow, a as f64 + 0.5) / units(narrow, azimuths as f64);
                let bearing = right_rad + span_rad * middle;
                let mut seen = (0..ranges).filter(|r| in_view(bearing, centre(*r)));
                seen.next().map_or(0..0, |first| first..seen.next_back().unwrap_or(first) + 1)
            })
            .collect();
        let near = view.iter().filter(|v| !v.is_empty()).map(|v| v.start).min().map_or(centre(0), centre);
        let slope = |k: usize| {
            // ascending slopes: from far to near where the plane lies above the sensor
            let k = if drop > 0.0 { k } else { rows - k };
            -drop / (near.sqrt() + k as f64 * (far.sqrt() - near.sqrt()) / rows as f64).powi(2)
        };
        let edges = (0..=rows).map(slope).collect();
        let height_m = slice_height_m + drop;
        let mut axes = Self {
            ranges,
            azimuths,
            rows,
            cell_m,
            right_rad,
            span_rad,
            narrow,
            height_m,
            slice_m: slice_height_m,
            edges,
            slice: Vec::new(),
            view,
        };
        axes.slice = (0..ranges)
            .map(|r| {
                let place = axes.row_place(axes.slope(slice_height_m, centre(r))) - 0.5;
                let place = place.clamp(0.0, rows as f64 - 1.0);
                let lower = (place as usize).min(rows - 2);
                (lower, place - lower as f64)
            })
            .collect();
        axes
    }

    /// Slope under which a point of this height and ground distance is seen.
    pub fn slope(&self, height_m: f64, ground_m: f64) -> f64 {
        (height_m - self.height_m) / ground_m.max(0.01)
    }

    /// Place of a slope on the row axis, rows from the first one's lower edge.
    pub fn row_place(&self, slope: f64) -> f64 {
        let above = self.edges.partition_point(|e| *e <= slope);
        if above == 0 {
            return 0.0;
        }
        match self.edges.get(above) {
            Some(&high) => {
                let low = self.edges[above - 1];
                (above - 1) as f64 + (slope - low) / (high - low)
            }
            None => self.rows as f64,
        }
    }

    pub fn row_slopes(&self, row: usize) -> (f64, f64) {
        (self.edges[row], self.edges[row + 1])
    }

    /// Slope of a row's centre.
    pub fn row_centre(&self, row: usize) -> f64 {
        (self.edges[row] + self.edges[row + 1]) / 2.0
    }

    /// Place of a bearing on the column axis, columns from the first one's right edge.
    pub fn column_place(&self, bearing_rad: f64) -> f64 {
        let half = std::f64::consts::PI;
        let from_right = (bearing_rad - self.right_rad + half).rem_euclid(2.0 * half) - half;
        let unit = from_right / self.span_rad * self.units(self.azimuths as f64);
        let [first, end, times] = self.narrow;
        let within = (unit - first * times).clamp(0.0, end - first);
        (unit - within) / times + within
    }

    /// Widths of a narrow column from the first one's right edge to a place.
    pub fn units(&self, place: f64) -> f64 {
        units(self.narrow, place)
    }

    /// Bearing of a place on the column axis.
    pub fn azimuth_of(&self, place: f64) -> f64 {
        self.right_rad + self.span_rad * self.units(place) / self.units(self.azimuths as f64)
    }

    /// The column and range cell a place lies in.
    pub fn locate(&self, [x, y]: [f64; 2]) -> Option<(usize, usize)> {
        let (a, r) = (self.column_place(y.atan2(x)).floor(), (x.hypot(y) / self.cell_m).floor());
        (a >= 0.0 && a < self.azimuths as f64 && r < self.ranges as f64).then_some((a as usize, r as usize))
    }
}

fn units([first, end, times]: [f64; 3], place: f64) -> f64 {
    let within = place.clamp(first, end) - first;
    (place - within) * times + within
}

fn contains(view: &FieldOfView, levelled: &Levelled, point: [f64; 3]) -> bool {
    let s = levelled.seen(point);
    let within = |v: f64, low: f32, high: f32, spare| v >= f64::from(low) - spare && v <= f64::from(high) + spare;
    within(s.range_m, view.range_min_m, view.range_max_m, 0.0)
        && within(s.azimuth_rad.to_degrees(), view.azimuth_min_deg, view.azimuth_max_deg, ON_THE_LIMIT_DEG)
        && within(s.elevation_rad.to_degrees(), view.elevation_min_deg, view.elevation_max_deg, ON_THE_LIMIT_DEG)
}

/// Occupied share of every cell. The cells of one azimuth and range lie together, a *stack*.
#[derive(Debug, Clone)]
pub struct Grid {
    ranges: usize,
    rows: usize,
    cells: Vec<f64>,
}

impl Grid {
    pub fn new(axes: &Axes) -> Self {
        let stacks = axes.ranges * axes.azimuths;
        Self { ranges: axes.ranges, rows: axes.rows, cells: vec![0.0; stacks * axes.rows] }
    }

    pub fn stack(&self, azimuth: usize, range: usize) -> &[f64] {
        let first = (azimuth * self.ranges + range) * self.rows;
        &self.cells[first..first + self.rows]
    }

    pub fn stack_mut(&mut self, azimuth: usize, range: usize) -> &mut [f64] {
        let first = (azimuth * self.ranges + range) * self.rows;
        &mut self.cells[first..first + self.rows]
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.cells.fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::{self, AZIMUTHS, ELEVATIONS, RANGES, Random, mounts, raise, within};
    use viewshed::fixed::angle::Angle;

    #[test]
    fn columns_rows_and_slice_lie_where_the_formulas_put_them() {
        let [mut edge_deg, mut row, mut slice] = [0.0; 3];
        let mut view_differs = 0.0;
        for mount in mounts() {
            let (integer, exact) = scene::axes(&mount);
            raise(&mut edge_deg, (f64::from(integer.azimuth_origin.radians()) - exact.right_rad).to_degrees());
            raise(&mut edge_deg, f64::from(integer.azimuth_span) / 65536.0 * 360.0 - exact.span_rad.to_degrees());
            assert_eq!(f64::from(integer.cell_cm) / 100.0, exact.cell_m);
            assert!((f64::from(integer.sensor_height_cm()) / 100.0 - exact.height_m).abs() < 1e-6);
            for k in 0..ELEVATIONS {
                let (got, exact) = (integer.row_slopes(k), exact.row_slopes(k));
                raise(&mut row, (got.0 - exact.0) / (exact.1 - exact.0));
                raise(&mut row, (got.1 - exact.1) / (exact.1 - exact.0));
            }
            let mut random = Random::new(5);
            for _ in 0..4000 {
                let (height, ground) = (random.whole(-50, 450), random.whole(100, 20_000));
                let got = f64::from(integer.row_place(integer.slope(height, ground))) / 256.0;
                raise(
                    &mut row,
                    got - exact.row_place(exact.slope(f64::from(height) / 100.0, f64::from(ground) / 100.0)),
                );
            }
            for r in 0..RANGES {
                let stretch = integer.slice_rows().iter().find(|s| usize::from(s.end) > r).unwrap();
                let got = f64::from(stretch.lower) + f64::from(integer.slice_share()[r]) / 256.0;
                raise(&mut slice, got - exact.slice[r].0 as f64 - exact.slice[r].1);
            }
            for a in 0..AZIMUTHS {
                let (got, exact) = (integer.view(a), &exact.view[a]);
                // at a limit of elevation the view may end anywhere between two azimuths
                assert!(got.start.abs_diff(exact.start) <= 1 && got.end.abs_diff(exact.end) <= 2, "{got:?} {exact:?}");
                view_differs += f64::from(u8::from(got != *exact));
            }
        }
        within("outer edges, degrees", edge_deg, 0.004);
        within("edges and places of slopes, rows", row, 0.021);
        within("slice points, rows", slice, 0.017);
        // whole centimetres at the near end: 3 of 384 columns
        within("columns with another cell in view", view_differs, 4.0);
    }

    #[test]
    fn bearings_fall_into_the_same_place_of_the_same_column() {
        let (mut place, mut azimuth_deg, mut random) = (0.0, 0.0, Random::new(6));
        for mount in mounts() {
            let (integer, exact) = scene::axes(&mount);
            for _ in 0..4000 {
                let bearing = random.between(-1.6, 1.6);
                let got = f64::from(integer.column_place(Angle::from_radians(bearing as f32))) / 256.0;
                raise(&mut place, got - exact.column_place(bearing));
                let whole = random.whole(0, AZIMUTHS as i32 * 256 - 1);
                let got = f64::from(integer.azimuth_of(whole).radians());
                raise(&mut azimuth_deg, (got - exact.azimuth_of(f64::from(whole) / 256.0)).to_degrees());
            }
        }
        // columns of 0.37 degrees, four times narrower than those beside them
        within("column places, columns", place, 0.05);
        within("azimuth of places, degrees", azimuth_deg, 0.025);
    }
}

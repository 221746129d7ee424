//! The shadow of a single box, however narrow its columns are to it: it is never lost, and nowhere else.

use proptest::prelude::*;
use viewshed::fixed::angle::Angle;
use viewshed::fixed::trig;
use viewshed::grid::axes::Axes;
use viewshed::grid::raycast::cast;
use viewshed::grid::shadow;
use viewshed::grid::spherical::SphericalGrid;
use viewshed::map::Visibility;
use viewshed::map::polar::PolarMap;
use viewshed::obstacles::solid::Solid;
use viewshed::sensor::ground::Ground;

use crate::cases;
use crate::setup::Setup;

/// A box wherever the sensor looks: its bearing as a share of the view, distance, heading, size.
#[derive(Debug, Clone, Copy)]
struct Place {
    share: f64,
    ground_m: f64,
    solid: Solid,
}

/// Of a motorcycle's width to a truck's, up to 190 m away.
fn places() -> impl Strategy<Value = Place> {
    (0.0..1.0_f64, 8.0..190.0_f64, any::<i16>(), 80..900_i32, 35..130_i32, 140..450_i32).prop_map(
        |(share, ground_m, heading, half_length_cm, half_width_cm, height_cm)| {
            let heading = trig::direction(Angle::from_raw(heading));
            let solid = Solid { x_cm: 0, y_cm: 0, heading, half_length_cm, half_width_cm, height_cm };
            Place { share, ground_m, solid }
        },
    )
}

/// What exact geometry says of the columns and cells of one grid.
struct Exact {
    origin: f64,
    span: f64,
    columns: f64,
    /// First narrow column, the first behind them, how many times narrower.
    narrow: [f64; 3],
}

impl Exact {
    /// Place of a bearing in columns.
    fn column(&self, bearing: f64) -> f64 {
        let [first, end, times] = self.narrow;
        let units = (self.columns - (end - first)) * times + (end - first);
        let unit = (bearing - self.origin) / self.span * units;
        let within = (unit - first * times).clamp(0.0, end - first);
        (unit - within) / times + within
    }

    /// Right and left edge of a box in columns.
    fn outline(&self, solid: &Solid) -> [f64; 2] {
        let heading = f64::from(solid.heading.y).atan2(f64::from(solid.heading.x));
        let (sin, cos) = heading.sin_cos();
        let [x, y, l, w] = [solid.x_cm, solid.y_cm, solid.half_length_cm, solid.half_width_cm].map(f64::from);
        let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(a, b): (f64, f64)| {
            let (along, across) = (a * l, b * w);
            self.column((y + sin * along + cos * across).atan2(x + cos * along - sin * across))
        });
        corners.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], c| [low.min(*c), high.max(*c)])
    }
}

fn try_box<const R: usize, const A: usize, const E: usize, const W: usize>(
    place: Place,
    sensor_m: f32,
    far_road: Option<i8>,
) -> Result<(), TestCaseError> {
    let mut setup = Setup::default();
    setup.sensor.mount.height_m = sensor_m;
    setup.sensor.field_of_view.elevation_min_deg = -45.0;
    let levelling = setup.sensor.mount.levelling().unwrap();
    let axes = Axes::<R, A, E>::on(Ground::LEVEL, &levelling, &setup.sensor.field_of_view, 1.0, far_road).unwrap();
    let turn = std::f64::consts::TAU / 65536.0;
    let exact = Exact {
        origin: f64::from(axes.azimuth_origin.raw()) * turn,
        span: f64::from(axes.azimuth_span) * turn,
        columns: A as f64,
        narrow: axes.narrow.to_bytes().map(f64::from),
    };
    let bearing = exact.origin + place.share * exact.span;
    let solid = Solid {
        x_cm: (100.0 * place.ground_m * bearing.cos()).round() as i32,
        y_cm: (100.0 * place.ground_m * bearing.sin()).round() as i32,
        ..place.solid
    };
    let [low, high] = exact.outline(&solid);
    prop_assume!(low >= 0.0 && high <= A as f64, "within the view");

    let mut grid = Box::new(SphericalGrid::<R, A, E, W>::new());
    let mut map = Box::new(PolarMap::<R, A>::unknown(axes.polar(&levelling), 128, 128));
    cast(&grid, &axes, &mut map);
    shadow::cast(&solid, &axes, &mut grid, &mut map);

    let invisible = |a: usize, r: usize| map.cell(a, r).visibility == Visibility::Invisible;
    for a in (0..A).filter(|a| (0..R).any(|r| invisible(*a, r))) {
        // a fiftieth of a column is what integers round
        let overlaps = low - 0.02 < a as f64 + 1.0 && a as f64 - 0.02 < high;
        prop_assert!(overlaps, "column {a} is hidden, the box reaches from {low} to {high}");
    }
    let middle = f64::midpoint(low, high);
    // on an edge either may hold most
    let holds_most = [middle - 0.02, middle + 0.02].map(|place| place as usize);
    let mut asked = false;
    let mut hidden = false;
    for a in holds_most {
        // where all rays through box and column agree: right behind it, and not at the very end
        let (from, to) = (low.max(a as f64), high.min(a as f64 + 1.0));
        let rays = (0..=8).map(|k| from + (to - from) * (0.01 + 0.98 * f64::from(k) / 8.0));
        let left = rays.filter_map(|place| {
            let ray = trig::direction(axes.azimuth_of((place * 256.0) as i32));
            solid.crossing(solid.origin(), ray).map(|(_, leave_cm)| f64::from(leave_cm))
        });
        let left: Vec<f64> = left.collect();
        let (nearest, farthest) = left.iter().fold((f64::INFINITY, 0.0_f64), |(n, f), d| (n.min(*d), f.max(*d)));
        let (eye, top, cell) = (f64::from(sensor_m) * 100.0, f64::from(solid.height_cm), f64::from(axes.cell_cm));
        let end = if top >= eye { f64::INFINITY } else { nearest * (eye - 100.0) / (eye - top) };
        let behind = (0..R).filter(|r| {
            let near = *r as f64 * cell;
            near >= farthest && near + cell < 0.99 * end - cell && axes.view(a).contains(r)
        });
        let behind: Vec<usize> = behind.collect();
        asked |= !behind.is_empty();
        hidden |= !behind.is_empty() && behind.iter().all(|r| invisible(a, *r));
    }
    prop_assert!(
        hidden || !asked,
        "the shadow of a box from column {low} to {high}, {} m away, is lost",
        place.ground_m
    );
    Ok(())
}

proptest! {
    #![proptest_config(cases(400))]

    #[test]
    fn the_shadow_of_a_box_is_never_lost_and_nowhere_else(
        place in places(),
        sensor_m in 3.0..9.0_f32,
        far_road in proptest::option::of(-40..40_i8),
        small in any::<bool>(),
    ) {
        if small {
            try_box::<100, 64, 8, 4>(place, sensor_m, far_road)?;
        } else {
            try_box::<200, 120, 16, 7>(place, sensor_m, far_road)?;
        }
    }
}

//! A road that is not flat: shadows against plain double precision, and no profile that breaks anything.

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
use viewshed::radar_3d::{Radar3d, Radar3dParameters};
use viewshed::sensor::ground::Ground;
use viewshed::sensor::mount::Mount;
use viewshed::sensor::site::Points;

use crate::cases;
use crate::setup::{Setup, setups};
use crate::traffic::{Frame, frames};

const R: usize = 80;
const A: usize = 12;
const E: usize = 12;

/// A road within 12 %: where it begins, and lengths and grades of what follows.
fn profiles() -> impl Strategy<Value = Vec<[f32; 2]>> {
    let parts = proptest::collection::vec((2.0..90.0_f32, -0.12..0.12_f32), 1..15);
    (-200.0..50.0_f32, -50.0..50.0_f32, parts).prop_map(|(x, height, parts)| {
        let mut last = [x, height];
        let on = |(length, grade): (f32, f32)| {
            last = [last[0] + length, last[1] + length * grade];
            last
        };
        [[x, height]].into_iter().chain(parts.into_iter().map(on)).collect()
    })
}

/// Height of a profile, metres.
fn height(points: &[[f32; 2]], x: f64) -> f64 {
    let points: Vec<[f64; 2]> = points.iter().map(|p| p.map(f64::from)).collect();
    let behind = points.partition_point(|p| p[0] <= x);
    match (behind.checked_sub(1).map(|k| points[k]), points.get(behind)) {
        (Some(a), Some(b)) => a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0]),
        (Some(a), None) => a[1],
        (None, first) => first.map_or(0.0, |p| p[1]),
    }
}

proptest! {
    #![proptest_config(cases(150))]

    /// Everything is worked out along one line of sight in small steps, without stretches or slopes of rows.
    #[test]
    fn what_the_road_and_a_box_hide_is_what_lines_of_sight_say(
        points in profiles(),
        yaw_deg in -180.0..180.0_f32,
        sensor_m in 3.0..10.0_f32,
        (ahead, left, turned) in (15.0..150.0_f64, -30.0..30.0_f64, any::<i16>()),
        top_cm in 50..500_i32,
        far_road in proptest::option::of(-30..30_i8),
    ) {
        let mount = Mount { x_m: 20.0, y_m: -4.0, height_m: sensor_m, yaw_deg, pitch_deg: 0.0, roll_deg: 0.0 };
        let mut setup = Setup::default();
        setup.sensor.mount = mount;
        setup.sensor.field_of_view.elevation_min_deg = -40.0;
        setup.sensor.field_of_view.elevation_max_deg = 20.0;
        let levelling = mount.levelling().unwrap();
        let ground = Ground::new(&levelling, Points::Metres(&points)).unwrap();
        let Ok(axes) = Axes::<R, A, E>::on(ground, &levelling, &setup.sensor.field_of_view, 1.0, far_road) else { return Ok(()) };
        let mut grid = SphericalGrid::<R, A, E, 3>::new();
        let mut map = PolarMap::unknown(axes.polar(&levelling), 128, 128);
        cast(&grid, &axes, &mut map);
        let solid = Solid {
            x_cm: (ahead * 100.0) as i32,
            y_cm: (left * 100.0) as i32,
            heading: trig::direction(Angle::from_raw(turned)),
            half_length_cm: 600,
            half_width_cm: 125,
            height_cm: top_cm,
        };
        shadow::cast(&solid, &axes, &mut grid, &mut map);

        let (sin, cos) = f64::from(yaw_deg).to_radians().sin_cos();
        let below = height(&points, 20.0);
        // of the levelled frame, above the road below the sensor
        let road = |x: f64, y: f64| height(&points, 20.0 + cos * x - sin * y) - below;
        let eye = f64::from(sensor_m);
        let top = road(ahead, left) + f64::from(top_cm) / 100.0;
        let cell = f64::from(axes.cell_cm) / 100.0;
        for a in 0..A {
            // where the ray enters and leaves the box, as the library has it; columns that are covered in part are graded,
            // which is another property's matter
            let rays = [64, 128, 192].map(|part| trig::direction(axes.azimuth_of(a as i32 * 256 + part)));
            let [right, crossing, left] = rays.map(|ray| solid.crossing(solid.origin(), ray));
            let count = [right, crossing, left].iter().flatten().count();
            // the column its middle lies in is hidden, wherever a narrow box lies in it
            let places = solid.corners().map(|(x, y)| axes.column_place(trig::bearing(x, y)));
            let edges = places.iter().min().zip(places.iter().max());
            let holds_most = edges.is_some_and(|(low, high)| (low + high) >> 9 == a as i32);
            let in_part = count % 3 != 0 || (count == 0 && holds_most);
            let crossing = crossing.map(|(enter, leave)| (f64::from(enter) / 100.0, f64::from(leave) / 100.0));
            let (sy, cx) = f64::from(axes.azimuth_of(a as i32 * 256 + 128).radians()).sin_cos();
            let seen = |d: f64, over: f64| (road(d * cx, d * sy) + over - eye) / d;
            let mut horizon = f64::NEG_INFINITY;
            let mut next = 0.25;
            for r in 0..R {
                let d = (r as f64 + 0.5) * cell;
                while next < d {
                    horizon = horizon.max(seen(next, 0.0));
                    next += 0.25;
                }
                let state = map.cell(a, r);
                let behind = crossing.filter(|(_, leave)| d > leave + 2.0 * cell);
                let by_box = behind.map_or(f64::NEG_INFINITY, |(enter, leave)| {
                    ((top - eye) / enter.max(0.01)).max((top - eye) / leave)
                });
                let near_box = crossing.is_some_and(|(enter, leave)| d > enter - cell && d <= leave + 2.0 * cell);
                if state.visibility == Visibility::Unknown || in_part {
                    continue;
                }
                let limit = horizon.max(by_box);
                let over = [d - cell, d, d + cell].map(|d| seen(d, 1.0) - limit);
                let clear = over.iter().all(|v| *v > 2e-3);
                let hidden = over.iter().all(|v| *v < -2e-3);
                if hidden {
                    prop_assert!(state.visibility == Visibility::Invisible, "column {a}, {d} m: {over:?} {state:?}");
                } else if clear && !near_box {
                    prop_assert!(state.visibility == Visibility::Visible, "column {a}, {d} m: {over:?} {state:?}");
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(cases(100))]

    #[test]
    fn any_frames_over_any_road_leave_a_map_that_holds(
        (setup, frames) in setups().prop_flat_map(|s| (Just(s), frames(&s, 10))),
        points in profiles(),
    ) {
        let mut setup: Setup = setup;
        let x = setup.sensor.mount.x_m;
        let points: Vec<[f32; 2]> = points.iter().map(|p| [p[0] + x, p[1]]).collect();
        // far from the origin floats no longer tell such points apart
        setup.radar_3d.ground = points.leak();
        let Ok(parameters) = Radar3dParameters::<24, 12, 4>::new(&setup.sensor, &setup.radar_3d) else { return Ok(()) };
        let (parameters, mut state) = (Box::new(parameters), Box::new(Radar3d::<24, 12, 4, 1, 6, 24>::new()));
        let mut map = parameters.map();
        for Frame { now, fault, detections } in &frames {
            let report = state.process(&parameters, *now, detections, *fault, &mut map);
            prop_assert_eq!(usize::from(report.used) + report.rejections.total() as usize, detections.len());
            for (a, r) in (0..12).flat_map(|a| (0..24).map(move |r| (a, r))) {
                let known = map.cell(a, r).visibility != Visibility::Unknown;
                prop_assert!(!known || parameters.axes().view(a).contains(&r));
            }
        }
    }
}

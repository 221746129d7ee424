//! Areas are no better than any of their points: of footprints, of cells of the road's grid, and of fused maps.

use proptest::prelude::*;
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::fixed::trig::{self, Direction};
use viewshed::fusion::{Fusion, FusionConfig, fill, polar};
use viewshed::grid::axes::Axes;
use viewshed::map::polar::{PolarGeometry, PolarMap};
use viewshed::map::query::{self, Answer, Footprint};
use viewshed::map::resample::RoadGrid;
use viewshed::map::{CellState, VisibilityMap};
use viewshed::sensor::ground::Ground;
use viewshed::sensor::mount::Mount;
use viewshed::sensor::road::RoadPoint;

use crate::cases;
use crate::setup::{Setup, setups};

const R: usize = 200;
const A: usize = 96;

type Map = PolarMap<R, A>;

/// Where the cells of a map lie: that of any setup, or the usual view on any mount, with or without narrow azimuths.
fn geometries() -> impl Strategy<Value = PolarGeometry> {
    let far_road = proptest::option::of(-55_i8..=55);
    let usual = (-360.0..360.0_f32, 10.0..400.0_f32, far_road).prop_map(|(yaw_deg, range_max_m, far_road)| {
        let mut setup = Setup::default();
        setup.sensor.mount.yaw_deg = yaw_deg;
        setup.sensor.field_of_view.range_max_m = range_max_m;
        setup.radar_3d.visibility.far_road_deg = far_road;
        setup
    });
    prop_oneof![1 => setups(), 3 => usual].prop_filter_map("a grid that cannot be", |setup| {
        let levelling = setup.sensor.mount.levelling().unwrap();
        let far_road = setup.radar_3d.visibility.far_road_deg;
        let view = &setup.sensor.field_of_view;
        Some(Axes::<R, A, 4>::on(Ground::LEVEL, &levelling, view, 1.0, far_road).ok()?.polar(&levelling))
    })
}

/// Visible and free, but for stretches of some cells here and there, down to single ones.
fn maps() -> impl Strategy<Value = Box<Map>> {
    let flaw = (0..A, 0..R, 1..12_usize, 0..3_u8);
    (geometries(), proptest::collection::vec(flaw, 0..300)).prop_map(|(geometry, flaws)| drawn(geometry, &flaws))
}

fn drawn(geometry: PolarGeometry, flaws: &[(usize, usize, usize, u8)]) -> Box<Map> {
    let mut map = Box::new(Map::unknown(geometry, 128, 128));
    (0..A).for_each(|azimuth| map.rows_mut(azimuth).unwrap().0.fill(255));
    for (azimuth, first, length, kind) in flaws {
        let (grades, occupancy) = map.rows_mut(*azimuth).unwrap();
        let stretch = *first..(first + length).min(R);
        match kind {
            0 => grades[stretch].fill(0),
            1 => grades[stretch].fill(1),
            _ => occupancy[stretch].fill(255),
        }
    }
    map
}

/// By a sensor's distance and bearing, heading and half sides in centimetres: the road in view, behind the sensor, at it, and
/// where maps end.
fn footprints() -> impl Strategy<Value = (i32, i16, i16, i32, i32)> {
    let distance = prop_oneof![1 => 0..300_i32, 6 => 300..20_000_i32, 1 => 20_000..60_000_i32];
    let sides = prop_oneof![4 => (20..500_i32, 20..200_i32), 1 => (1..5000_i32, 1..5000_i32), 1 => Just((230, 90))];
    (distance, any::<i16>(), any::<i16>(), sides).prop_map(|(d, b, h, (l, w))| (d, b, h, l, w))
}

fn placed(geometry: &PolarGeometry, (distance, bearing, heading, l, w): (i32, i16, i16, i32, i32)) -> Footprint {
    let ray = Angle::from_raw(bearing).radians();
    let [x, y] = [ray.cos(), ray.sin()].map(|part| (part * distance as f32) as i32);
    Footprint {
        centre: geometry.levelling.unplace(x, y),
        heading: trig::direction(Angle::from_raw(heading)),
        half_length_cm: l,
        half_width_cm: w,
    }
}

/// Points of a footprint, 41 by 41 or a quarter of a metre apart, its edges and corners among them.
fn points(area: &Footprint) -> Vec<RoadPoint> {
    let steps = |half: i32| (half / 12).clamp(10, 40);
    let (along, across) = (steps(area.half_length_cm), steps(area.half_width_cm));
    let (hx, hy) = (f64::from(area.heading.x) / 16384.0, f64::from(area.heading.y) / 16384.0);
    let part = |half: i32, k: i32, steps: i32| f64::from(half) * (2.0 * f64::from(k) / f64::from(steps) - 1.0);
    let at = |k: i32, l: i32| {
        let (a, b) = (part(area.half_length_cm, k, along), part(area.half_width_cm, l, across));
        let (x, y) = (a * hx - b * hy, a * hy + b * hx);
        RoadPoint::new(area.centre.x_cm + x.round() as i32, area.centre.y_cm + y.round() as i32)
    };
    (0..=along).flat_map(|k| (0..=across).map(move |l| (k, l))).map(|(k, l)| at(k, l)).collect()
}

/// Points of a cell of the road of so many centimetres, its corners among them.
fn within(corner: RoadPoint, side_cm: i32) -> impl Iterator<Item = RoadPoint> {
    let at = move |k: i32| (side_cm - 1) * k / 12;
    (0..13 * 13).map(move |k| RoadPoint::new(corner.x_cm + at(k / 13), corner.y_cm + at(k % 13)))
}

/// What a place is if this and that are of it.
fn answer(state: CellState) -> Answer {
    state.into()
}

proptest! {
    #![proptest_config(cases(120))]

    #[test]
    fn an_area_is_no_better_than_any_of_its_points(
        map in maps(),
        places in proptest::collection::vec(footprints(), 20),
    ) {
        for place in places {
            let area = placed(map.geometry(), place);
            let said = query::area(&*map, &area);
            for point in points(&area) {
                let here = query::point(&*map, point);
                prop_assert!(said <= here, "{said:?}, and {here:?} at {point:?} of {area:?}");
            }
        }
    }

    #[test]
    fn a_cell_of_the_roads_grid_is_no_better_than_any_of_its_points(map in maps(), place in footprints()) {
        let at = placed(map.geometry(), place).centre;
        let (x, y) = (at.x_cm.div_euclid(100), at.y_cm.div_euclid(100));
        let mut grid = RoadGrid::<6, 5>::unknown(x, y);
        grid.resample(&*map);
        for (i, j) in (0..6).flat_map(|i| (0..5).map(move |j| (x + i, y + j))) {
            for point in within(RoadPoint::new(100 * i, 100 * j), 100) {
                prop_assert!(answer(grid.cell(i, j)) <= query::point(&*map, point), "({i}, {j}) at {point:?}");
            }
        }
        // nor are areas of the grid
        let area = Footprint { centre: RoadPoint::new(100 * x + 250, 100 * y + 230), ..placed(map.geometry(), place) };
        let said = query::area(&grid, &area);
        for point in points(&area) {
            // half a centimetre is rounded away at the edges
            let here = [(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)].map(|(dx, dy)| {
                query::point(&grid, RoadPoint::new(point.x_cm + dx, point.y_cm + dy))
            });
            prop_assert!(here.iter().any(|here| said <= *here), "{point:?} of {area:?}");
        }
    }

    #[test]
    fn a_fused_cell_is_seen_only_if_one_sensor_sees_all_of_it(
        one in maps(),
        other in (0..3_u8, proptest::collection::vec((0..A, 0..R, 1..12_usize, 0..3_u8), 0..300)),
        place in footprints(),
        cell_cm in 25..=200,
    ) {
        // the other one looks at the same road from a little beside
        let shifted = RoadPoint::new(one.geometry().levelling.origin().x_cm + 700, one.geometry().levelling.origin().y_cm - 400);
        let levelling = viewshed::sensor::mount::Levelling::on_road(shifted, 600, Angle::from_raw(0));
        let two = drawn(PolarGeometry { levelling, ..*one.geometry() }, &other.1);
        let maps = [&*one, &*two];
        let now = Time::from_micros(1_000_000);
        let origin = placed(one.geometry(), place).centre;
        let mut road = Box::new(Fusion::<2, 6, 5>::NOWHERE);
        road.set(origin, cell_cm, FusionConfig::default()).unwrap();
        for (sensor, map) in maps.iter().enumerate() {
            match other.0 {
                0 => road.offer(sensor, now, now, *map).unwrap(),
                _ => road.offer_polar(sensor, now, now, map).unwrap(),
            }
        }
        let fused = road.at(now);
        for (i, j) in (0..6).flat_map(|i| (0..5).map(move |j| (i, j))) {
            let cell = fused.cell(i, j);
            let corner = RoadPoint::new(origin.x_cm + i as i32 * cell_cm, origin.y_cm + j as i32 * cell_cm);
            for (sensor, map) in maps.iter().enumerate() {
                for point in within(corner, cell_cm) {
                    let here = map.at(point);
                    prop_assert!(here.visible() || !cell.seen_by.has(sensor), "{sensor} at {point:?}");
                    let seen_occupied = here.visible() && here.occupied && cell.state.visible();
                    prop_assert!(!seen_occupied || cell.occupied_by.has(sensor), "{sensor} occupied at {point:?}");
                }
            }
            prop_assert_eq!(cell.state.visible(), cell.seen_by.count() > 0);
        }
    }

    #[test]
    fn a_cell_of_ones_own_is_no_better_than_any_of_its_points(
        map in maps(),
        yaw_deg in -180.0..180.0_f32,
        right in -180.0..0.0_f32,
        beside in (-20.0..20.0_f32, -20.0..20.0_f32),
    ) {
        let origin = map.geometry().levelling.origin();
        let [x_m, y_m] = [(origin.x_cm, beside.0), (origin.y_cm, beside.1)].map(|(cm, m)| (cm / 100) as f32 + m);
        prop_assume!(x_m.abs() < 10_000.0 && y_m.abs() < 10_000.0);
        let mount = Mount { x_m, y_m, height_m: 1.0, yaw_deg, pitch_deg: 0.0, roll_deg: 0.0 };
        let mut own = polar::<12, 7>(&mount, [right, right + 90.0], 3.0).unwrap();
        fill(&mut own, &*map);
        let levelling = own.geometry().levelling;
        for k in 0..40_000_u32 {
            // all over it, cells' edges among them
            let (x, y) = ((k % 200) as i32 * 36 - 3600, (k / 200) as i32 * 36 - 3600);
            let point = levelling.unplace(x, y);
            prop_assert!(query::point(&own, point) <= query::point(&*map, point), "{point:?}");
        }
    }
}

/// Numbers that look random.
fn random() -> impl FnMut(i32) -> i32 {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    move |below| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % below as u64) as i32
    }
}

fn usual(yaw_deg: f32, far_road: Option<i8>) -> PolarGeometry {
    let mut setup = Setup::default();
    setup.sensor.mount.yaw_deg = yaw_deg;
    let levelling = setup.sensor.mount.levelling().unwrap();
    let axes = Axes::<R, A, 4>::on(Ground::LEVEL, &levelling, &setup.sensor.field_of_view, 1.0, far_road).unwrap();
    axes.polar(&levelling)
}

#[test]
fn an_area_looks_at_few_cells_that_it_does_not_hold() {
    let mut random = random();
    for far_road in [None, Some(0)] {
        let (mut visited, mut held) = (0, 0);
        let map = drawn(usual(30.0, far_road), &[]);
        for _ in 0..200 {
            let distance = 800 + random(18_000);
            let bearing = (random(20_000) - 10_000) as i16;
            let area = placed(map.geometry(), (distance, bearing, random(65_536) as u16 as i16, 230, 90));
            map.cells_in(&area, &mut |_| visited += 1);
            let mut cells = std::collections::BTreeSet::new();
            for (k, l) in (0..=92).flat_map(|k| (0..=36).map(move |l| (5 * k - 230, 5 * l - 90))) {
                let (h, c) = (area.heading, area.centre);
                let axis = Direction { y: -h.y, ..h };
                let at = RoadPoint::new(c.x_cm + axis.along(k, l), c.y_cm + axis.across(k, l));
                let (x, y) = map.geometry().levelling.place(at);
                cells.extend(map.locate(x, y));
            }
            held += cells.len();
        }
        println!("{far_road:?}: {visited} cells visited, {held} are touched");
        assert!(visited * 100 < held * 125, "{far_road:?}: {visited} cells visited, {held} are touched");
    }
}

#[test]
fn a_rider_who_hides_beside_the_middle_of_a_metre_is_found() {
    // cells 0.4 m wide at 20 m; one of them is hidden, and no middle of a square metre lies in it
    let mut hidden_from_centres = 0;
    for azimuth in 40..56 {
        let mut map = drawn(usual(0.0, None), &[]);
        map.rows_mut(azimuth).unwrap().0[15..25].fill(1);
        let car = Footprint {
            centre: RoadPoint::new(2000, 0),
            heading: Direction::AHEAD,
            half_length_cm: 230,
            half_width_cm: 400,
        };
        let mut centres = Answer::VisibleFree;
        car.each_cell(|cell| centres = centres.min(query::point(&*map, cell)));
        let touched = points(&car).iter().any(|point| !map.at(*point).visible());
        assert_eq!(
            query::area(&*map, &car),
            if touched { Answer::Invisible } else { Answer::VisibleFree },
            "{azimuth}"
        );
        hidden_from_centres += usize::from(touched && centres == Answer::VisibleFree);
    }
    assert!(hidden_from_centres > 3, "{hidden_from_centres} of 16 columns");
}

#[test]
fn where_nobody_looks_an_area_is_unknown() {
    for yaw_deg in [0.0, 77.0, 180.0, -135.0] {
        let map = drawn(usual(yaw_deg, Some(0)), &[]);
        let ahead = |distance, bearing_deg: f32| {
            let place = (distance, Angle::from_degrees(bearing_deg).raw(), Angle::from_degrees(yaw_deg).raw(), 230, 90);
            query::area(&*map, &placed(map.geometry(), place))
        };
        assert_eq!(ahead(3000, 0.0), Answer::VisibleFree, "{yaw_deg}");
        assert_eq!(ahead(3000, -50.0), Answer::VisibleFree, "{yaw_deg}");
        // at the sensor, behind it, across either end of the view, across its far end, and where places end
        for (distance, bearing) in [(0, 0.0), (200, 0.0), (3000, 180.0), (3000, 60.0), (3000, -60.0), (20_000, 0.0)] {
            assert_eq!(ahead(distance, bearing), Answer::Unknown, "{yaw_deg}: {distance} {bearing}");
        }
        for distance in [44_800, 44_950, 45_000, 50_000, 100_000, 100_000_000] {
            assert_eq!(ahead(distance, 0.0), Answer::Unknown, "{yaw_deg}: {distance}");
        }
    }
    let map = drawn(usual(0.0, None), &[]);
    let sound = placed(map.geometry(), (3000, 0, 0, 230, 90));
    for heading in [Direction { x: 0, y: 0 }, Direction { x: i16::MAX, y: i16::MAX }, Direction { x: i16::MIN, y: 0 }] {
        assert_eq!(query::area(&*map, &Footprint { heading, ..sound }), Answer::Unknown, "{heading:?} is no direction");
    }
    let far = Footprint { centre: RoadPoint::new(i32::MIN, i32::MAX), ..sound };
    assert_eq!(query::area(&*map, &far), Answer::Unknown);
}

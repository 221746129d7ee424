//! Maps of several sensors as one: the same whatever the order, and never better than what they say.

use proptest::prelude::*;
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::fusion::{Fusion, FusionConfig, NotTaken, fill, polar};
use viewshed::map::polar::{PolarGeometry, PolarMap};
use viewshed::map::query::Footprint;
use viewshed::map::{CellState, Visibility, VisibilityMap};
use viewshed::sensor::mount::Mount;
use viewshed::sensor::road::RoadPoint;

use crate::cases;

type Map = PolarMap<20, 12>;
type Road = Fusion<3, 30, 24>;

const VISIBLE_FROM: u8 = 128;
const ORIGIN: RoadPoint = RoadPoint::new(-300, -1200);

fn ms(ms: u64) -> Time {
    Time::from_micros(1000 * ms)
}

/// Unknown everywhere: 120 degrees and 20 m, from a corner of its own.
fn blank(sensor: usize) -> Map {
    let [x_m, y_m, yaw_deg] = [[0.0, 0.0, 0.0], [20.0, 9.0, 200.0], [22.0, -8.0, 150.0]][sensor];
    let mount = Mount { x_m, y_m, height_m: 6.0, yaw_deg, pitch_deg: 3.0, roll_deg: 0.0 };
    let geometry = PolarGeometry {
        levelling: mount.levelling().unwrap(),
        cell_cm: 100,
        azimuth_origin: Angle::from_degrees(-60.0),
        azimuth_span: Angle::from_degrees(120.0).raw().unsigned_abs(),
        narrow: viewshed::map::azimuths::Narrow::NONE,
    };
    Map::unknown(geometry, VISIBLE_FROM, 128)
}

/// What the map of a sensor at a time is, from a seed.
fn drawn(sensor: usize, seed: u64) -> Map {
    let mut map = blank(sensor);
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as u8
    };
    for azimuth in 0..12 {
        let (grades, occupancy) = map.rows_mut(azimuth).unwrap();
        for (grade, occupied) in grades.iter_mut().zip(occupancy) {
            (*grade, *occupied) = (if next() < 60 { 0 } else { next() }, next() & next());
        }
    }
    map
}

/// Some azimuths of a map.
fn part(map: &Map, sensor: usize, azimuths: std::ops::Range<usize>) -> Map {
    let mut part = blank(sensor);
    for azimuth in azimuths {
        let (grades, occupancy) = part.rows_mut(azimuth).unwrap();
        (*grades, *occupancy) = (*map.grades(azimuth).unwrap(), *map.occupancy(azimuth).unwrap());
    }
    part
}

fn road() -> Box<Road> {
    let mut road = Box::new(Road::NOWHERE);
    road.set(ORIGIN, 100, FusionConfig::default()).unwrap();
    road
}

/// Everything that is known at a time.
fn all(road: &Road, now: Time) -> Vec<viewshed::fusion::FusedCell> {
    let fused = road.at(now);
    (0..30).flat_map(|i| (0..24).map(move |j| fused.cell(i, j))).collect()
}

/// A sensor, how long ago its map was measured, a seed of what it says.
fn maps() -> impl Strategy<Value = Vec<(usize, u64, u64)>> {
    prop::collection::vec((0..3_usize, 0..4_u64, 0..3_u64), 1..12)
}

/// What all maps of one sensor and time have in common: cut into parts, they are one scan's.
fn seed(sensor: usize, ago: u64, seed: u64) -> u64 {
    1 + seed + 10 * ago + 100 * sensor as u64
}

proptest! {
    #![proptest_config(cases(200))]

    #[test]
    fn neither_order_nor_repetition_makes_a_difference_and_parts_never_a_better_one(
        maps in maps(),
        cut in 0..12_usize,
        shuffle in any::<u64>(),
    ) {
        let now = ms(10_000);
        let [mut plain, mut other, mut cut_up] = [road(), road(), road()];
        let (mut repeated, mut parts) = (Vec::new(), Vec::new());
        for (k, &(sensor, ago, kind)) in maps.iter().enumerate() {
            let (map, at) = (drawn(sensor, seed(sensor, ago, kind)), ms(10_000 - 50 * ago));
            let _ = plain.offer_polar(sensor, at, now, &map);
            for _ in 0..1 + k % 2 {
                repeated.push((sensor, at, map.clone()));
            }
            for range in [0..cut, cut..12] {
                parts.push((sensor, at, part(&map, sensor, range)));
            }
        }
        let mut state = shuffle | 1;
        for list in [&mut repeated, &mut parts] {
            for k in (1..list.len()).rev() {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                list.swap(k, (state >> 33) as usize % (k + 1));
            }
        }
        for (road, list) in [(&mut other, &repeated), (&mut cut_up, &parts)] {
            for (sensor, at, map) in list {
                let _ = road.offer_polar(*sensor, *at, now, map);
            }
        }
        prop_assert_eq!(all(&plain, now), all(&other, now));
        for (plain, cut_up) in all(&plain, now).iter().zip(all(&cut_up, now)) {
            prop_assert!(cut_up.seen_by.numbers().all(|sensor| plain.seen_by.has(sensor)));
            prop_assert!(cut_up.hidden_from.numbers().all(|sensor| plain.hidden_from.has(sensor)));
            prop_assert!(!cut_up.state.visible() || cut_up.occupied_by == plain.occupied_by);
        }
        if cut == 0 {
            prop_assert_eq!(all(&plain, now), all(&cut_up, now), "what no cut goes through");
        }
    }

    #[test]
    fn a_cell_is_visible_where_all_of_it_is_on_a_fresh_map(maps in maps(), later in 0..400_u64) {
        let (now, mut road) = (ms(10_000), road());
        let mut newest: [Option<(Time, Vec<Map>)>; 3] = [const { None }; 3];
        for &(sensor, ago, kind) in &maps {
            let (map, at) = (drawn(sensor, seed(sensor, ago, kind)), ms(10_000 - 50 * ago));
            let _ = road.offer_polar(sensor, at, now, &map);
            match &mut newest[sensor] {
                Some((newest, maps)) if *newest == at => maps.push(map),
                Some((newest, _)) if *newest > at => {}
                held => *held = Some((at, vec![map])),
            }
        }
        let then = ms(10_000 + later);
        let fused = road.at(then);
        for (i, j) in (0..30).flat_map(|i| (0..24).map(move |j| (i, j))) {
            let corner = RoadPoint::new(ORIGIN.x_cm + 100 * i, ORIGIN.y_cm + 100 * j);
            let fresh = newest.iter().flatten().filter(|(t, _)| then.since(*t).unwrap() <= 300_000);
            // whether a sensor sees all points, and whether all of its cells around these are known and visible
            let (mut may, mut must) = (false, false);
            for (_, maps) in fresh {
                // the worst of maps of one time, unknown left out
                let seen = |states: &mut dyn Iterator<Item = CellState>| {
                    states.map(|state| state.visibility).filter(|v| *v != Visibility::Unknown).min() == Some(Visibility::Visible)
                };
                may |= points(corner, 0).all(|point| seen(&mut maps.iter().map(|map| map.at(point))));
                must |= around(&maps[0], corner).is_some_and(|cells| {
                    cells.iter().all(|(a, r)| seen(&mut maps.iter().map(|map| map.cell(*a, *r))))
                        && maps.iter().any(|map| cells.iter().all(|(a, r)| map.cell(*a, *r).visibility != Visibility::Unknown))
                });
            }
            let place = fused.place(RoadPoint::new(corner.x_cm + 50, corner.y_cm + 50));
            prop_assert!(may || !place.state.visible(), "({i}, {j}) is not seen as a whole");
            prop_assert!(place.state.visible() || !must, "({i}, {j}) is seen as a whole");
            prop_assert_eq!(place.state.grade == 0, place.state.visibility == Visibility::Unknown);
            prop_assert_eq!(place.state.visible(), place.seen_by.count() > 0);
        }
    }
}

/// Points all over a cell of a metre, and beyond it.
fn points(corner: RoadPoint, beyond_cm: i32) -> impl Iterator<Item = RoadPoint> {
    let at = move |k: i32| (99 + 2 * beyond_cm) * k / 10 - beyond_cm;
    (0..121).map(move |k| RoadPoint::new(corner.x_cm + at(k / 11), corner.y_cm + at(k % 11)))
}

/// Cells of a map from the first to the last azimuth and range of a cell of the road and a little around; none if a part of
/// it lies on none.
fn around(map: &Map, corner: RoadPoint) -> Option<Vec<(usize, usize)>> {
    let locate = |point| {
        let (x, y) = map.geometry().levelling.place(point);
        map.locate(x, y)
    };
    let cells: Vec<_> = points(corner, 15).map(locate).collect::<Option<_>>()?;
    let ends = |of: fn(&(usize, usize)) -> usize| cells.iter().map(of).min().zip(cells.iter().map(of).max());
    let ((right, left), (near, far)) = (ends(|c| c.0)?, ends(|c| c.1)?);
    Some((right..=left).flat_map(|azimuth| (near..=far).map(move |range| (azimuth, range))).collect())
}

#[test]
fn around_a_place_of_ones_own_cells_lie_where_they_are_read() {
    // 2 m to the left of x = 10 m it is visible, to the right hidden and occupied, behind the place unknown
    struct Sides;
    impl VisibilityMap for Sides {
        fn at(&self, p: RoadPoint) -> CellState {
            let kind = match (p.x_cm > 1000, p.y_cm > 200) {
                (false, _) => NOTHING,
                (true, true) => SEEN_FREE,
                (true, false) => HIDDEN,
            };
            // grades that a threshold of 128 would read the other way round
            let grade = [0, 200, 100][kind.0 as usize];
            CellState { grade, ..kind.at(p) }
        }

        fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }
    let mount = |yaw_deg| Mount { x_m: 10.0, y_m: 2.0, height_m: 1.0, yaw_deg, pitch_deg: 0.0, roll_deg: 0.0 };
    for yaw_deg in [0.0, 30.0, -45.0] {
        let mut map = polar::<30, 35>(&mount(yaw_deg), [-87.5, 87.5], 1.0).unwrap();
        fill(&mut map, &Sides);
        for azimuth in 0..35_u16 {
            let bearing = (yaw_deg - 87.5 + 5.0 * (f32::from(azimuth) + 0.5) + 540.0).rem_euclid(360.0) - 180.0;
            // those that hold an edge are as bad as their worse part
            if [0.0, 90.0].iter().any(|edge| (bearing.abs() - edge).abs() < 2.6) {
                continue;
            }
            for range in [3, 12, 29] {
                let cell = map.cell(azimuth.into(), range);
                let expected = match bearing {
                    b if b.abs() > 90.0 => Visibility::Unknown,
                    b if b > 0.0 => Visibility::Visible,
                    _ => Visibility::Invisible,
                };
                assert_eq!(cell.visibility, expected, "{yaw_deg} {bearing} {range}");
                assert_eq!(cell.occupied, expected == Visibility::Invisible);
            }
        }
    }
    let refused = |azimuth_deg, cell_m| polar::<30, 35>(&mount(0.0), azimuth_deg, cell_m).unwrap_err().parameter;
    assert_eq!(refused([-190.0, 0.0], 1.0), "azimuth_deg[0]");
    assert_eq!(refused([20.0, 10.0], 1.0), "azimuth_deg[1]");
    assert_eq!(refused([-100.0, 100.0], 1.0), "azimuth_deg[1]", "more than half a turn");
    assert_eq!(refused([-20.0, 10.0], 0.0), "cell_m");
    assert_eq!(polar::<100, 4>(&mount(0.0), [-20.0, 20.0], 5.0).unwrap_err().parameter, "cell_m", "beyond 400 m");
}

#[test]
fn a_cell_of_ones_own_is_the_worst_of_what_it_covers() {
    /// Visible, but for a strip of a metre across the view at 25 m, and one along it a little to the left.
    struct Strips;
    impl VisibilityMap for Strips {
        fn at(&self, p: RoadPoint) -> CellState {
            let hidden = (2500..2600).contains(&p.x_cm) || (200..300).contains(&p.y_cm);
            if hidden { HIDDEN.at(p) } else { SEEN_FREE.at(p) }
        }

        fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }
    let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
    let mut map = polar::<10, 2>(&mount, [-15.0, 15.0], 4.0).unwrap();
    fill(&mut map, &Strips);
    let seen = [0, 1].map(|azimuth| (0..10).filter(|range| map.cell(azimuth, *range).visible()).collect::<Vec<_>>());
    // to the right all but 24 to 28 m; to the left what ends before the strip begins
    assert_eq!(seen, [vec![0, 1, 2, 3, 4, 5, 7, 8, 9], vec![0]]);
    assert!(map.cell(0, 6).occupied && !map.cell(0, 4).occupied);
}

/// The same everywhere.
struct Everywhere(Visibility, bool);

impl VisibilityMap for Everywhere {
    fn at(&self, _: RoadPoint) -> CellState {
        let grade = if self.0 == Visibility::Unknown { 0 } else { 200 };
        CellState { visibility: self.0, grade, occupancy: if self.1 { 255 } else { 0 }, occupied: self.1 }
    }

    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        visit(self.at(area.centre));
    }
}

const SEEN_FREE: Everywhere = Everywhere(Visibility::Visible, false);
const SEEN_OCCUPIED: Everywhere = Everywhere(Visibility::Visible, true);
const HIDDEN: Everywhere = Everywhere(Visibility::Invisible, true);
const NOTHING: Everywhere = Everywhere(Visibility::Unknown, false);

#[test]
fn one_who_sees_is_enough_and_unknown_never_overrides() {
    let (mut road, now) = (road(), ms(500));
    let state = |road: &Road| road.at(now).cell(3, 4);
    assert_eq!(state(&road).state, CellState::UNKNOWN);
    road.offer(0, now, now, &HIDDEN).unwrap();
    assert_eq!(state(&road).state.visibility, Visibility::Invisible, "hidden from all who know of it");
    road.offer(1, now, now, &NOTHING).unwrap();
    assert_eq!(state(&road).state.visibility, Visibility::Invisible);
    road.offer(2, now, now, &SEEN_FREE).unwrap();
    let cell = state(&road);
    assert!(cell.state.visible() && cell.hidden_from.has(0) && !cell.hidden_from.has(1) && cell.seen_by.has(2));
    assert!(!cell.state.occupied, "who cannot see it does not say what is there");
    assert_eq!(cell.seen_by.numbers().collect::<Vec<_>>(), [2]);
}

#[test]
fn free_against_occupied_is_occupied_and_a_conflict_with_place_time_and_ages() {
    let mut road = road();
    road.offer(0, ms(900), ms(1000), &SEEN_FREE).unwrap();
    road.offer(2, ms(1000), ms(1000), &SEEN_OCCUPIED).unwrap();
    let fused = road.at(ms(1020));
    let cell = fused.cell(5, 6);
    assert!(cell.state.visible() && cell.state.occupied);
    let conflicts: Vec<_> = fused.conflicts().collect();
    assert_eq!(conflicts.len(), 30 * 24);
    let here = conflicts.iter().find(|c| c.at == RoadPoint::new(ORIGIN.x_cm + 550, ORIGIN.y_cm + 650)).unwrap();
    assert!(here.free.has(0) && !here.free.has(2) && here.occupied.has(2) && here.occupied.count() == 1);
    assert_eq!([fused.age_ms(0), fused.age_ms(1), fused.age_ms(2)], [Some(120), None, Some(20)]);
    // the one is late: nobody contradicts the other
    assert_eq!(road.at(ms(1201)).conflicts().count(), 0);
    assert!(road.at(ms(1201)).cell(5, 6).state.occupied);
    // and who is hidden from it does not contradict
    road.offer(0, ms(1000), ms(1020), &HIDDEN).unwrap();
    assert_eq!(road.at(ms(1020)).conflicts().count(), 0);
}

#[test]
fn what_lies_beside_a_cell_is_no_conflict() {
    /// Occupied in [x, x + 2) m.
    struct Strip(i32);
    impl VisibilityMap for Strip {
        fn at(&self, p: RoadPoint) -> CellState {
            Everywhere(Visibility::Visible, (self.0..self.0 + 2).contains(&p.x_cm.div_euclid(100))).at(p)
        }

        fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }
    let conflicts = |offset| {
        let (mut road, now) = (road(), ms(500));
        road.offer(0, now, now, &Strip(4)).unwrap();
        road.offer(1, now, now, &Strip(4 + offset)).unwrap();
        road.at(now).conflicts().count()
    };
    assert_eq!([0, 1, 2].map(conflicts), [0, 0, 2 * 24]);
}

#[test]
fn late_maps_clocks_apart_and_repeated_ones_are_named_and_never_visible() {
    let (mut road, now) = (road(), ms(5000));
    assert_eq!(road.offer(0, ms(3000), now, &SEEN_FREE), Err(NotTaken::Late), "its clock is 2 s behind");
    assert_eq!(road.offer(1, ms(7000), now, &SEEN_FREE), Err(NotTaken::Early), "or ahead");
    assert_eq!(road.offer(8, now, now, &SEEN_FREE), Err(NotTaken::NoSuchSensor), "the ninth");
    assert_eq!(road.offer(3, now, now, &SEEN_FREE), Err(NotTaken::NoSuchSensor), "there are three");
    assert!(!road.at(now).cell(0, 0).state.visible());
    // the last frame again and again
    for k in 0..10 {
        let _ = road.offer(2, ms(4990), ms(5000 + 50 * k), &SEEN_FREE);
        assert_eq!(road.at(ms(5000 + 50 * k)).cell(0, 0).state.visible(), 50 * k + 10 <= 300, "{k}");
    }
    assert_eq!(road.offer(2, ms(4980), ms(5000), &SEEN_FREE), Err(NotTaken::Older));
    let taken = |sensor| *road.taken(sensor).unwrap();
    assert_eq!((taken(0).late, taken(1).early, taken(0).new, taken(1).new), (1, 1, 0, 0));
    assert_eq!((taken(2).new, taken(2).joined, taken(2).late, taken(2).older), (1, 5, 4, 1));
    // a clock that is set back makes its maps early, not young
    assert_eq!(road.at(ms(4000)).cell(0, 0).state, CellState::UNKNOWN);
}

#[test]
fn a_mount_that_differs_is_named_until_the_sensor_is_forgotten() {
    let (mut road, now) = (road(), ms(500));
    let [mut a, mut b] = [blank(0), blank(1)];
    for map in [&mut a, &mut b] {
        (0..12).for_each(|azimuth| map.rows_mut(azimuth).unwrap().0.fill(255));
    }
    road.offer_polar(0, now, now, &a).unwrap();
    let seen = |road: &Road| all(road, ms(600)).iter().filter(|cell| cell.state.visible()).count();
    let before = seen(&road);
    assert!(before > 200, "{before}");
    assert_eq!(road.offer_polar(0, ms(600), ms(600), &b), Err(NotTaken::OtherGeometry));
    assert_eq!((seen(&road), road.taken(0).unwrap().other_geometry), (before, 1));
    road.forget(0);
    assert_eq!(seen(&road), 0);
    road.offer_polar(0, ms(600), ms(600), &b).unwrap();
    assert!(seen(&road) > 200);
    // nor are the two kinds of maps of one sensor mixed
    assert_eq!(road.offer(0, ms(610), ms(610), &SEEN_FREE), Err(NotTaken::OtherGeometry));
    road.offer(1, ms(610), ms(610), &SEEN_FREE).unwrap();
    assert_eq!(road.offer_polar(1, ms(620), ms(620), &b), Err(NotTaken::OtherGeometry));
    // sites that do not overlap see nothing of each other's road
    let mut far = Box::new(Road::NOWHERE);
    far.set(RoadPoint::new(900_000, 0), 100, FusionConfig::default()).unwrap();
    far.offer_polar(0, now, now, &a).unwrap();
    assert_eq!(seen(&far), 0);
}

#[test]
fn a_grid_that_cannot_be_is_refused_by_name() {
    let mut road = road();
    let usual = FusionConfig::default();
    let mut refused = |cell, config| road.set(ORIGIN, cell, config).unwrap_err().parameter;
    assert_eq!((refused(24, usual), refused(201, usual)), ("fusion.cell_cm", "fusion.cell_cm"));
    assert_eq!(refused(100, FusionConfig { max_age_ms: 0, ..usual }), "fusion.max_age_ms");
    assert_eq!(refused(100, FusionConfig { max_lead_ms: 60_000, ..usual }), "fusion.max_lead_ms");
}

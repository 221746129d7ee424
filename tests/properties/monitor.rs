//! A sensor is blind where others see what it should: not where a shadow explains it, and not for a single miss.

use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::fixed::trig;
use viewshed::fusion::{Monitor, MonitorConfig, Observed};
use viewshed::map::query::{self, Answer, Footprint};
use viewshed::map::{CellState, Visibility, VisibilityMap};
use viewshed::sensor::mount::Mount;
use viewshed::sensor::road::RoadPoint;

const MOUNT: Mount = Mount { x_m: 5.0, y_m: -3.0, height_m: 6.0, yaw_deg: 90.0, pitch_deg: 3.0, roll_deg: 0.0 };
/// 20 m ahead of it, 10 degrees to the left: in the fourth of six sectors of 20 degrees.
const AHEAD: RoadPoint = RoadPoint::new(160, 1670);
const LEFT: RoadPoint = RoadPoint::new(-1100, 900);

fn monitor(config: MonitorConfig) -> Monitor<6> {
    Monitor::new(&MOUNT, [-60.0, 60.0], &config).unwrap()
}

fn says(visibility: Visibility) -> CellState {
    CellState { visibility, grade: 200, occupancy: 0, occupied: false }
}

/// All of it visible.
struct Clear;

impl VisibilityMap for Clear {
    fn at(&self, _: RoadPoint) -> CellState {
        says(Visibility::Visible)
    }

    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        visit(self.at(area.centre));
    }
}

/// So many seconds at 15 Hz, each time the same; when the sector became blind.
fn run(monitor: &mut Monitor<6>, from_ms: u64, seconds: u64, own: Visibility, detected: bool) -> Option<u64> {
    let mut named = None;
    for k in 0..15 * seconds {
        let ms = from_ms + k * 1000 / 15;
        monitor.observe(Time::from_micros(1000 * ms), AHEAD, says(own), detected);
        if monitor.is_blind(3) {
            named.get_or_insert(ms - from_ms);
        }
    }
    named
}

#[test]
fn sectors_run_from_right_to_left() {
    let monitor = monitor(MonitorConfig::default());
    assert_eq!((monitor.sector(AHEAD), monitor.sector(LEFT)), (Some(3), Some(5)));
    assert_eq!(monitor.sector(RoadPoint::new(2200, 700)), Some(0), "to the right");
    assert_eq!(monitor.sector(RoadPoint::new(500, -2300)), None, "behind it");
}

#[test]
fn a_blind_sector_is_named_within_seconds_and_trusted_again_when_it_sees() {
    let mut monitor = monitor(MonitorConfig::default());
    // a second in which both see it
    run(&mut monitor, 0, 1, Visibility::Visible, true);
    let named = run(&mut monitor, 1000, 9, Visibility::Visible, false).expect("blind");
    // 6 windows of ln(0.97 / 0.3) nats, each of half a second and a frame
    assert!((3000..4500).contains(&named), "{named} ms");
    assert!((0..6).all(|k| monitor.is_blind(k) == (k == 3)), "and no other");
    let watched = monitor.watched(&Clear);
    assert_eq!(watched.at(AHEAD), CellState::UNKNOWN);
    assert!(watched.at(LEFT).visible());
    // one that sees again: not at once
    run(&mut monitor, 10_000, 1, Visibility::Visible, true);
    assert!(monitor.is_blind(3));
    run(&mut monitor, 11_000, 5, Visibility::Visible, true);
    assert!(!monitor.is_blind(3));
}

#[test]
fn what_of_the_map_lies_beyond_the_views_edge_is_unknown_with_the_sector_there() {
    let mut monitor = monitor(MonitorConfig::default());
    // 59 and 62 degrees to the left of a sensor that looks along y
    let [inside, outside] = [59.0_f64, 62.0].map(|degrees| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        RoadPoint::from_metres((5.0 - 20.0 * sin) as f32, (-3.0 + 20.0 * cos) as f32).unwrap()
    });
    assert_eq!((monitor.sector(inside), monitor.sector(outside)), (Some(5), None));
    for k in 0..200_u64 {
        monitor.observe(Time::from_micros(66_667 * k), inside, says(Visibility::Visible), k < 15);
    }
    assert!(monitor.is_blind(5));
    let watched = monitor.watched(&Clear);
    assert_eq!([inside, outside].map(|at| watched.at(at)), [CellState::UNKNOWN; 2]);
    assert!(watched.at(AHEAD).visible());
}

#[test]
fn a_shadow_explains_and_what_nobody_knows_does_too() {
    for own in [Visibility::Invisible, Visibility::Unknown] {
        let mut monitor = monitor(MonitorConfig::default());
        run(&mut monitor, 0, 1, Visibility::Visible, true);
        assert_eq!(run(&mut monitor, 1000, 60, own, false), None, "{own:?}");
        let now = Time::from_micros(61_050_000);
        assert_eq!(monitor.observe(now, AHEAD, says(own), false), Observed::Explained);
        assert_eq!(monitor.observe(now, RoadPoint::new(500, -2300), says(own), false), Observed::Outside);
    }
}

#[test]
fn a_ghost_that_only_the_other_sensor_has_ever_seen_names_nobody() {
    let mut monitor = monitor(MonitorConfig::default());
    assert_eq!(run(&mut monitor, 0, 60, Visibility::Visible, false), None);
    let now = Time::from_micros(60_050_000);
    assert_eq!(monitor.observe(now, AHEAD, says(Visibility::Visible), false), Observed::Unconfirmed);
    // seven frames are not enough, eight are
    for k in 1..=8 {
        let at = |ms: u64| Time::from_micros(60_050_000 + 1000 * ms);
        let observed = monitor.observe(at(66 * (2 * k - 1)), AHEAD, says(Visibility::Visible), true);
        assert_eq!(observed, Observed::Hit);
        let observed = monitor.observe(at(66 * 2 * k), AHEAD, says(Visibility::Visible), false);
        assert_eq!(observed, if k < 8 { Observed::Unconfirmed } else { Observed::Miss }, "{k}");
    }
    // unless any miss is to count
    let config = MonitorConfig { confirmed: 0, ..MonitorConfig::default() };
    let mut any = Monitor::<6>::new(&MOUNT, [-60.0, 60.0], &config).unwrap();
    assert!(run(&mut any, 0, 10, Visibility::Visible, false).is_some());
}

#[test]
fn a_sensor_that_repeats_its_last_frame_is_named_by_what_drives_on() {
    let mut monitor = monitor(MonitorConfig::default());
    let mut named = None;
    // vehicles at 10 m/s, 30 m apart, away from the sensor for 60 m; from the tenth second on its last frame is repeated
    let ahead = |k: i32, vehicle: i32| 1500 + (66 * k + 3000 * vehicle) % 6000;
    for k in 0..600 {
        let now = Time::from_micros(66_000 * u64::try_from(k).unwrap());
        for vehicle in 0..2 {
            let at = RoadPoint::new(500, -300 + ahead(k, vehicle));
            let in_its_frame = |v: i32| (ahead(k.min(150), v) - ahead(k, vehicle)).abs() <= 200;
            monitor.observe(now, at, says(Visibility::Visible), (0..2).any(in_its_frame));
        }
        if (0..6).any(|sector| monitor.is_blind(sector)) {
            named.get_or_insert(k);
        }
    }
    let named = named.expect("named");
    assert!((150..300).contains(&named), "{} s after", (named - 150) / 15);
}

#[test]
fn misses_now_and_then_are_usual() {
    let mut monitor = monitor(MonitorConfig::default());
    for second in 0..120 {
        // one window in four is missed
        run(&mut monitor, 2000 * second, 1, Visibility::Visible, true);
        run(&mut monitor, 2000 * second + 1000, 1, Visibility::Visible, second % 2 == 1);
        assert!(!monitor.is_blind(3), "{second}");
    }
    // a clock that steps back loses its window, nothing else
    monitor.observe(Time::from_micros(5), AHEAD, says(Visibility::Visible), false);
    assert!(!monitor.is_blind(3) && !monitor.is_blind(77));
}

#[test]
fn what_a_sector_usually_misses_is_learned_and_its_darkness_named_all_the_same() {
    let usual = MonitorConfig { usual_miss: 0.5, threshold: 8.0, ..MonitorConfig::default() };
    let [mut learned, mut fixed] = [usual, MonitorConfig { learned_windows: 0, ..usual }].map(monitor);
    // 5 s with hits, then 11 s without, for 20 minutes: behind a mast
    let cycle = |monitor: &mut Monitor<6>, k: u64| {
        run(monitor, 16_000 * k, 5, Visibility::Visible, true);
        run(monitor, 16_000 * k + 5000, 11, Visibility::Visible, false)
    };
    let alerts = |monitor: &mut Monitor<6>| (0..75).map(|k| cycle(monitor, k)).collect::<Vec<_>>();
    let (learned_alerts, fixed_alerts) = (alerts(&mut learned), alerts(&mut fixed));
    assert!(fixed_alerts.iter().all(Option::is_some), "{fixed_alerts:?}");
    assert!(learned_alerts[25..].iter().all(Option::is_none), "{learned_alerts:?}");
    run(&mut learned, 1_200_000, 10, Visibility::Visible, true);
    let named = run(&mut learned, 1_210_000, 60, Visibility::Visible, false).expect("dark");
    assert!((8_000..30_000).contains(&named), "{named} ms");
    // darkness is not learned: it lasts until the sensor sees
    run(&mut learned, 1_270_000, 3600, Visibility::Visible, false);
    assert!(learned.is_blind(3));
}

#[test]
fn a_monitor_that_cannot_be_is_refused_by_name() {
    let usual = MonitorConfig::default();
    let refused = |config| Monitor::<6>::new(&MOUNT, [-60.0, 60.0], &config).unwrap_err().parameter;
    assert_eq!(refused(MonitorConfig { usual_miss: 0.0, ..usual }), "monitor.usual_miss");
    assert_eq!(refused(MonitorConfig { blind_miss: 0.2, ..usual }), "monitor.blind_miss");
    assert_eq!(refused(MonitorConfig { threshold: f32::NAN, ..usual }), "monitor.threshold");
    assert_eq!(refused(MonitorConfig { window_ms: 10, ..usual }), "monitor.window_ms");
    let error = Monitor::<6>::new(&MOUNT, [60.0, -60.0], &usual).unwrap_err();
    assert_eq!(error.parameter, "azimuth_deg[1]");
}

#[test]
fn what_watches_a_sensor_is_as_small_as_its_page_says() {
    use viewshed::fusion::{Alignment, Fixtures};
    let bytes = [size_of::<Monitor<6>>(), size_of::<Alignment<3>>(), size_of::<Fixtures<64, 6>>()];
    assert_eq!(bytes, [2240, 312, 1600]);
}

#[test]
fn no_area_is_seen_that_reaches_into_a_blind_sector() {
    let mut monitor = monitor(MonitorConfig::default());
    run(&mut monitor, 0, 1, Visibility::Visible, true);
    run(&mut monitor, 1000, 9, Visibility::Visible, false).expect("the fourth sector becomes blind");
    let map = monitor.watched(&Clear);
    let (mut seen, mut hidden) = (0, 0);
    for k in 0..4000 {
        // all around the sensor, some across all sectors
        let centre = RoadPoint::new(500 + (k % 63 - 31) * 130, -300 + (k / 63 - 31) * 130);
        let heading = trig::direction(Angle::from_raw((k * 7919) as u16 as i16));
        let half_length_cm = if k % 5 == 0 { 2000 } else { 230 };
        let area = Footprint { centre, heading, half_length_cm, half_width_cm: 90 };
        let answer = query::area(&map, &area);
        let points = (-200..=200).flat_map(|a| [-1, 0, 1].map(|b| (a * half_length_cm / 200, b * 90)));
        let worst = points
            .map(|(a, b)| {
                let (x, y) = (heading.along(a, -b), heading.across(-a, b));
                query::point(&map, RoadPoint::new(centre.x_cm + x, centre.y_cm + y))
            })
            .min();
        assert!(Some(answer) <= worst, "{answer:?} and {worst:?} of {area:?}");
        seen += usize::from(answer == Answer::VisibleFree);
        hidden += usize::from(worst != Some(Answer::VisibleFree));
    }
    assert!(seen + hidden > 3600, "{seen} are seen, {hidden} are not");
}

//! A sensor is blind where others see what it should: not where a shadow explains it, and not for a single miss.

use viewshed::fixed::time::Time;
use viewshed::fusion::{Monitor, MonitorConfig, Observed};
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
    let named = run(&mut monitor, 0, 10, Visibility::Visible, false).expect("blind");
    // 14 windows of ln(0.97 / 0.53) nats, each of half a second and a frame
    assert!((7000..8100).contains(&named), "{named} ms");
    assert!((0..6).all(|k| monitor.is_blind(k) == (k == 3)), "and no other");
    /// All of it visible.
    struct Clear;
    impl VisibilityMap for Clear {
        fn at(&self, _: RoadPoint) -> CellState {
            says(Visibility::Visible)
        }
    }
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
fn a_shadow_explains_and_what_nobody_knows_does_too() {
    for own in [Visibility::Invisible, Visibility::Unknown] {
        let mut monitor = monitor(MonitorConfig::default());
        assert_eq!(run(&mut monitor, 0, 60, own, false), None, "{own:?}");
        let now = Time::from_micros(61_000_000);
        assert_eq!(monitor.observe(now, AHEAD, says(own), false), Observed::Explained);
        assert_eq!(monitor.observe(now, RoadPoint::new(500, -2300), says(own), false), Observed::Outside);
    }
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
    let usual = MonitorConfig::default();
    let [mut learned, mut fixed] = [usual, MonitorConfig { learned_windows: 0, ..usual }].map(monitor);
    // 11 s without a hit, then 5 s with hits, for 20 minutes: behind a mast
    let cycle = |monitor: &mut Monitor<6>, k: u64| {
        let named = run(monitor, 16_000 * k, 11, Visibility::Visible, false);
        run(monitor, 16_000 * k + 11_000, 5, Visibility::Visible, true);
        named
    };
    let alerts = |monitor: &mut Monitor<6>| (0..75).map(|k| cycle(monitor, k)).collect::<Vec<_>>();
    let (learned_alerts, fixed_alerts) = (alerts(&mut learned), alerts(&mut fixed));
    assert!(fixed_alerts.iter().all(Option::is_some), "{fixed_alerts:?}");
    assert!(learned_alerts[25..].iter().all(Option::is_none), "{learned_alerts:?}");
    let named = run(&mut learned, 1_200_000, 60, Visibility::Visible, false).expect("dark");
    assert!((8_000..30_000).contains(&named), "{named} ms");
    // darkness is not learned: it lasts until the sensor sees
    run(&mut learned, 1_260_000, 3600, Visibility::Visible, false);
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

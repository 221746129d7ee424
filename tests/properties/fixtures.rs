//! What usually stands: learned, and missed when it is gone, weaker or elsewhere; not when a lorry hides it.

use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::fusion::{Fixtures, FixturesConfig};
use viewshed::sensor::mount::Mount;
use viewshed::sensor::road::RoadPoint;

const MOUNT: Mount = Mount { x_m: 5.0, y_m: -3.0, height_m: 6.0, yaw_deg: 90.0, pitch_deg: 3.0, roll_deg: 0.0 };
type Standing = Fixtures<16, 6>;

fn config() -> FixturesConfig {
    FixturesConfig { learned_windows: 30, ..FixturesConfig::default() }
}

fn new() -> Standing {
    Fixtures::new(&MOUNT, [-60.0, 60.0], &config()).unwrap()
}

fn post(range_m: f32, azimuth_deg: f32, half_dbsm: i16) -> Detection {
    Detection {
        range_cm: (100.0 * range_m) as u16,
        azimuth: Angle::from_degrees(azimuth_deg),
        elevation: Some(Angle::from_degrees(-5.0)),
        radial_velocity_cm_s: 0,
        rcs_half_dbsm: Some(half_dbsm),
        snr_half_db: None,
        marked: false,
    }
}

/// Three posts to the left, in the last sector, and two ahead, in the fourth.
const POSTS: [(f32, f32); 5] = [(20.0, 50.0), (24.0, 50.0), (40.0, 45.0), (30.0, 10.0), (60.0, 5.0)];

/// So many seconds in which the posts are seen as a change makes them.
fn run(
    standing: &mut Standing,
    from_s: u64,
    seconds: u64,
    sees: impl Fn(RoadPoint) -> bool,
    change: impl Fn(Detection) -> Option<Detection>,
) {
    for k in 0..10 * seconds {
        for (n, (range, azimuth)) in (0..).zip(POSTS) {
            // each is seen in four frames of five, with noise
            let noise = (k * 7 + n * 3) % 5;
            if noise == 0 {
                continue;
            }
            let wide = 0.2 * (noise as f32 - 2.5);
            standing_observe(standing, change(post(range, azimuth + wide, noise as i16 - 2)));
        }
        // something drives through, and a moving thing is no fixture
        let passing = Detection { radial_velocity_cm_s: -900, ..post(30.0, 30.0, 20) };
        standing.observe(&passing);
        standing.advance(Time::from_micros(1_000_000 * from_s + 100_000 * k), &sees);
    }
}

fn standing_observe(standing: &mut Standing, detection: Option<Detection>) {
    if let Some(detection) = detection {
        standing.observe(&detection);
    }
}

fn everywhere(_: RoadPoint) -> bool {
    true
}

fn learned() -> Standing {
    let mut standing = new();
    assert_eq!(standing.learned(), None);
    run(&mut standing, 0, 32, everywhere, Some);
    assert_eq!(standing.learned(), Some(5));
    standing
}

fn says_nothing(s: &Standing) -> bool {
    (0..6).all(|k| !s.is_blind(k))
        && s.turned().is_none()
        && s.tilted().is_none()
        && s.weaker_half_db().is_none()
        && s.fewer().is_none()
}

#[test]
fn in_order_nothing_is_said() {
    let mut standing = learned();
    run(&mut standing, 32, 600, everywhere, Some);
    assert!(says_nothing(&standing));
    assert!(standing.expects(5) && standing.expects(3) && !standing.expects(0));
}

#[test]
fn a_sector_without_its_posts_is_blind_within_10_s_and_until_they_are_back() {
    let mut standing = learned();
    let dark = |d: Detection| (d.azimuth.raw() < Angle::from_degrees(30.0).raw()).then_some(d);
    run(&mut standing, 32, 10, everywhere, dark);
    assert!((0..6).all(|k| standing.is_blind(k) == (k == 5)), "the left one");
    run(&mut standing, 42, 2, everywhere, Some);
    assert!(standing.is_blind(5), "not yet");
    run(&mut standing, 44, 10, everywhere, Some);
    assert!(!standing.is_blind(5));
}

#[test]
fn what_the_radars_own_marks_leave_out_teaches_nothing_and_hides_no_fault() {
    let mut standing = new();
    run(&mut standing, 0, 32, everywhere, |d| Some(Detection { marked: true, ..d }));
    assert_eq!(standing.learned(), Some(0));
    let mut standing = learned();
    let marked = |d: Detection| Detection { marked: d.azimuth.raw() > Angle::from_degrees(30.0).raw(), ..d };
    run(&mut standing, 32, 10, everywhere, |d| Some(marked(d)));
    assert!(standing.is_blind(5));
}

#[test]
fn a_lorry_that_waits_before_the_posts_is_no_fault() {
    let mut standing = learned();
    let dark = |d: Detection| (d.azimuth.raw() < Angle::from_degrees(30.0).raw()).then_some(d);
    // the heading is along y: what lies to the left has the smaller x
    run(&mut standing, 32, 120, |at| at.x_cm > -500, dark);
    assert!(says_nothing(&standing));
}

#[test]
fn where_anything_else_is_detected_a_sector_is_not_blind() {
    // what was learned to the left were vehicles that waited: they leave, and others drive through
    let dark = |d: Detection| (d.azimuth.raw() < Angle::from_degrees(30.0).raw()).then_some(d);
    for (moving, blind) in [(Some(-900), false), (Some(0), false), (None, true)] {
        let mut standing = learned();
        for second in 32..44 {
            run(&mut standing, second, 1, everywhere, dark);
            for _ in 0..3 {
                let other =
                    moving.map(|radial_velocity_cm_s| Detection { radial_velocity_cm_s, ..post(70.0, 45.0, 10) });
                standing_observe(&mut standing, other);
            }
        }
        assert_eq!(standing.is_blind(5), blind, "{moving:?}");
    }
}

#[test]
fn a_blind_sector_that_detects_anything_again_is_not_blind_also_while_what_stands_there_is_hidden() {
    let dark = |d: Detection| (d.azimuth.raw() < Angle::from_degrees(30.0).raw()).then_some(d);
    // the heading is along y: what lies to the left has the smaller x
    let hidden = |at: RoadPoint| at.x_cm > -500;
    for (detections, blind) in [(3, false), (2, true)] {
        let mut standing = learned();
        run(&mut standing, 32, 20, everywhere, dark);
        assert!(standing.is_blind(5));
        for second in 52..62 {
            run(&mut standing, second, 1, hidden, dark);
            (0..detections).for_each(|_| standing.observe(&post(70.0, 45.0, 10)));
        }
        assert_eq!((standing.is_blind(5), standing.expects(5)), (blind, false), "{detections} in a second");
    }
}

#[test]
fn a_turned_mount_is_named_with_its_side_and_a_tilted_one_with_its_own() {
    for (left, up) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
        let mut standing = learned();
        // what stands goes the other way
        let shift = |d: Detection| {
            let elevation = d.elevation.map(|e| e - Angle::from_degrees(up));
            Some(Detection { azimuth: d.azimuth - Angle::from_degrees(left), elevation, ..d })
        };
        run(&mut standing, 32, 30, everywhere, shift);
        let degrees = |angle: Option<Angle>| angle.map_or(0.0, |a| a.radians().to_degrees());
        let (turned, tilted) = (degrees(standing.turned()), degrees(standing.tilted()));
        assert!((turned - left).abs() < 0.35 && (tilted - up).abs() < 0.35, "{left} {up}: {turned} {tilted}");
        run(&mut standing, 62, 90, everywhere, Some);
        assert!(says_nothing(&standing), "mended");
    }
}

#[test]
fn dirt_that_grows_over_hours_is_not_taken_for_usual() {
    let mut standing = learned();
    let mut named = None;
    // a decibel in ten minutes
    for step in 0..12 {
        let weaker = |d: Detection| Some(Detection { rcs_half_dbsm: d.rcs_half_dbsm.map(|v| v - step), ..d });
        run(&mut standing, 32 + 300 * u64::from(step.unsigned_abs()), 300, everywhere, weaker);
        if named.is_none() {
            named = standing.weaker_half_db().map(|_| step);
        }
    }
    assert!((5..=8).contains(&named.expect("named")), "{named:?} half dB");
    assert!(standing.weaker_half_db().is_some_and(|by| (9..=12).contains(&by)));
    assert!((0..6).all(|k| !standing.is_blind(k)) && standing.turned().is_none());
}

#[test]
fn posts_that_are_lost_one_by_one_are_missed() {
    let mut standing = learned();
    let few = |d: Detection| (d.range_cm < 2200 || d.range_cm > 5000).then_some(d);
    run(&mut standing, 32, 400, everywhere, few);
    assert!(standing.fewer().is_some_and(|share| (130..180).contains(&share)), "{:?}", standing.fewer());
    assert!(!standing.is_blind(3) && !standing.is_blind(5), "one is left in each");
}

#[test]
fn there_is_room_for_so_many_and_clocks_that_step_back_do_no_harm() {
    let mut standing = new();
    for k in 0..330_u64 {
        for n in 0..40_u16 {
            standing.observe(&post(5.0 + 3.0 * f32::from(n), 0.0, 0));
        }
        standing.advance(Time::from_micros(100_000 * k), everywhere);
    }
    assert_eq!(standing.learned(), Some(16));
    standing.advance(Time::from_micros(5), everywhere);
    assert!(says_nothing(&standing) && !standing.is_blind(99) && !standing.expects(99));
}

#[test]
fn parameters_that_cannot_be_are_refused_by_name() {
    let refused = |config| Standing::new(&MOUNT, [-60.0, 60.0], &config).unwrap_err().parameter;
    assert_eq!(refused(FixturesConfig { window_ms: 10, ..config() }), "fixtures.window_ms");
    assert_eq!(refused(FixturesConfig { learned_windows: 2, ..config() }), "fixtures.learned_windows");
    assert_eq!(refused(FixturesConfig { least_share: f32::NAN, ..config() }), "fixtures.least_share");
    assert_eq!(refused(FixturesConfig { blind_windows: 1, ..config() }), "fixtures.blind_windows");
    assert_eq!(refused(FixturesConfig { weaker_db: 0.0, ..config() }), "fixtures.weaker_db");
    assert_eq!(refused(FixturesConfig { fewer_share: 1.0, ..config() }), "fixtures.fewer_share");
    assert_eq!(refused(FixturesConfig { turned_deg: 3.0, ..config() }), "fixtures.turned_deg");
    let error = Standing::new(&MOUNT, [60.0, -60.0], &config()).unwrap_err();
    assert_eq!(error.parameter, "azimuth_deg[1]");
}

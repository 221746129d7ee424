//! A turned mount: the pair that disagrees, who of three is turned and to which side, and what is not to be named.

use viewshed::fixed::time::Time;
use viewshed::fusion::{Alignment, AlignmentConfig};
use viewshed::sensor::mount::Mount;
use viewshed::sensor::road::RoadPoint;

/// Two that look at each other along a road, and one from its side.
const MOUNTS: [Mount; 3] = [mount(0.0, -10.0, 5.0), mount(150.0, 10.0, 185.0), mount(75.0, -40.0, 90.0)];

const fn mount(x_m: f32, y_m: f32, yaw_deg: f32) -> Mount {
    Mount { x_m, y_m, height_m: 6.0, yaw_deg, pitch_deg: 3.0, roll_deg: 0.0 }
}

fn alignment<const S: usize>(mounts: [Option<Mount>; S]) -> Alignment<S> {
    Alignment::new(&mounts, &AlignmentConfig::default()).unwrap()
}

/// Where a sensor places what is at (x, y), metres, if it hangs so many degrees to the left of its configuration, and sees the
/// side of a vehicle that is nearer to it by so much.
fn placed(by: &Mount, left_deg: f64, near_m: f64, [x, y]: [f64; 2]) -> RoadPoint {
    let (dx, dy) = (x - f64::from(by.x_m), y - f64::from(by.y_m));
    let (range, bearing) = (dx.hypot(dy) - near_m, dy.atan2(dx) - left_deg.to_radians());
    let at = [f64::from(by.x_m) + range * bearing.cos(), f64::from(by.y_m) + range * bearing.sin()];
    RoadPoint::from_metres(at[0] as f32, at[1] as f32).unwrap()
}

/// Traffic of both ways for so many seconds, each sensor turned by its own angle; when the first pair was named, in seconds.
fn run<const S: usize>(alignment: &mut Alignment<S>, sensors: usize, left_deg: [f64; 3], seconds: u64) -> Option<u64> {
    let mut named = None;
    for k in 0..15 * seconds {
        for vehicle in 0..4_u64 {
            let way = ((k * 4 + vehicle * 277) % 1100) as f64 / 10.0;
            // beside the middle of its lane by up to half a metre
            let beside = ((vehicle * 7 + k / 60) % 11) as f64 / 10.0 - 0.5;
            let at = if vehicle % 2 == 0 { [20.0 + way, -2.0 + beside] } else { [130.0 - way, 2.0 + beside] };
            let places: Vec<RoadPoint> = (0..sensors).map(|s| placed(&MOUNTS[s], left_deg[s], 0.4, at)).collect();
            for a in 0..sensors {
                for b in a + 1..sensors {
                    alignment.observe(a, places[a], b, places[b]);
                }
            }
        }
        alignment.advance(Time::from_micros(k * 66_667));
        let any = (0..sensors).any(|a| (0..a).any(|b| alignment.disagree(a, b)));
        if any {
            named.get_or_insert(k / 15);
        }
    }
    named
}

#[test]
fn a_pair_of_which_one_is_turned_by_a_degree_is_named_within_30_s_to_both_sides() {
    for left in [1.0, -1.0] {
        let mut pair = alignment([Some(MOUNTS[0]), Some(MOUNTS[1])]);
        let named = run(&mut pair, 2, [left, 0.0, 0.0], 60).expect("named");
        assert!(named <= 30, "{named} s");
        let median = pair.median(0, 1).unwrap().radians().to_degrees();
        assert!((f64::from(median) - left).abs() < 0.25, "{median} for {left}");
        assert!(pair.turned(0).is_none() && pair.turned(1).is_none(), "nobody tells which");
    }
}

#[test]
fn sensors_in_order_agree_although_they_see_other_sides() {
    let mut pair = alignment(MOUNTS.map(Some));
    assert_eq!(run(&mut pair, 3, [0.0; 3], 300), None);
    assert!((0..3).all(|k| pair.turned(k).is_none()));
}

#[test]
fn a_third_one_tells_who_is_turned_and_to_which_side() {
    for turned in 0..3 {
        for left in [1.5, -1.5] {
            let mut three = alignment(MOUNTS.map(Some));
            let mut by = [0.0; 3];
            by[turned] = left;
            run(&mut three, 3, by, 60);
            for sensor in 0..3 {
                let said = three.turned(sensor).map(|angle| f64::from(angle.radians().to_degrees()));
                assert_eq!(said.is_some(), sensor == turned, "{turned} by {left}: {sensor} {said:?}");
                assert!(said.is_none_or(|said| (said - left).abs() < 0.6), "{said:?} for {left}");
            }
        }
    }
}

#[test]
fn lanes_are_a_third_one_that_is_never_turned() {
    let mut two = alignment([Some(MOUNTS[0]), Some(MOUNTS[1]), None]);
    for k in 0..900_u64 {
        for vehicle in 0..3_u64 {
            let at = [40.0 + ((k * 5 + 300 * vehicle) % 700) as f64 / 10.0, -2.0];
            let [a, b] = [placed(&MOUNTS[0], 0.0, 0.3, at), placed(&MOUNTS[1], 1.2, 0.3, at)];
            two.observe(0, a, 1, b);
            for (sensor, place) in [(0, a), (1, b)] {
                two.observe(sensor, place, 2, RoadPoint::new(place.x_cm, -200));
            }
        }
        two.advance(Time::from_micros(k * 66_667));
    }
    assert!(two.turned(0).is_none() && two.turned(1).is_some_and(|angle| angle.raw() > 0));
    assert!(two.turned(2).is_none(), "the road");
}

#[test]
fn a_mended_mount_is_trusted_again_and_not_for_the_first_good_second() {
    let mut pair = alignment([Some(MOUNTS[0]), Some(MOUNTS[1])]);
    run(&mut pair, 2, [1.2, 0.0, 0.0], 60).expect("named");
    let mut again = pair.clone();
    run(&mut again, 2, [0.0; 3], 2);
    assert!(again.disagree(0, 1));
    run(&mut pair, 2, [0.0; 3], 60);
    assert!(!pair.disagree(0, 1) && !pair.disagree(1, 0));
}

#[test]
fn what_tells_nothing_is_not_counted() {
    let mut pair = alignment([Some(MOUNTS[0]), Some(MOUNTS[1])]);
    let at = RoadPoint::new(5000, 0);
    assert!(pair.observe(0, at, 1, RoadPoint::new(5100, 0)));
    assert!(!pair.observe(0, at, 0, at), "itself");
    assert!(!pair.observe(0, at, 1, RoadPoint::new(5500, 0)), "5 m apart");
    assert!(!pair.observe(0, at, 9, at) && !pair.observe(9, at, 0, at), "the tenth sensor");
    assert!(!pair.observe(0, RoadPoint::new(90_000, 0), 1, RoadPoint::new(90_000, 0)), "out of both views");
    assert!(!pair.observe(0, RoadPoint::new(i32::MAX, 0), 1, RoadPoint::new(i32::MIN, 0)));
    assert!(!pair.disagree(0, 9) && pair.turned(9).is_none() && pair.median(0, 1).is_none());
}

#[test]
fn parameters_that_cannot_be_are_refused_by_name() {
    let usual = AlignmentConfig::default();
    let refused = |config| Alignment::<2>::new(&[None; 2], &config).unwrap_err().parameter;
    assert_eq!(refused(AlignmentConfig { limit_deg: f32::NAN, ..usual }), "alignment.limit_deg");
    assert_eq!(refused(AlignmentConfig { release_deg: 0.8, ..usual }), "alignment.release_deg");
    assert_eq!(refused(AlignmentConfig { step_deg: 0.0, ..usual }), "alignment.step_deg");
    assert_eq!(refused(AlignmentConfig { window_ms: 10, ..usual }), "alignment.window_ms");
    let lying = Mount { height_m: 0.0, ..MOUNTS[0] };
    let error = Alignment::<1>::new(&[Some(lying)], &usual).unwrap_err();
    assert_eq!(error.parameter, "mount.height_m");
}

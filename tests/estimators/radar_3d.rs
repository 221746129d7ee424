//! The radar-3d estimator from detections to map, on small worlds whose answer is known.

use crate::common::{FRAME_US, Rig, Vehicle, detection, gantry};
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::fixed::trig::Direction;
use viewshed::frame::detection::Detection;
use viewshed::frame::gate::Rejection;
use viewshed::frame::health::{Condition, Continuity, FrameStatus};
use viewshed::map::Visibility;
use viewshed::map::query::{self, Answer, Footprint};
use viewshed::obstacles::config::ObstacleConfig;
use viewshed::radar_3d::Radar3dConfig;
use viewshed::sensor::Sensor;

#[test]
fn a_truck_in_the_left_lane_hides_the_left_lane_behind_it() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    // approaching; its middle is at 60 m when the picture is taken
    rig.drive(&[Vehicle::truck(60.0 + 25.0 * 29.0 / 15.0, 6.0, -25.0)], 30, true);
    let expected = "
?.................###########
?..............##############
?..........#############.....
??.......OOOO####............
??...........................
??...........................
??...........................
??...........................
";
    let got = rig.draw(5..150, -5..15);
    assert_eq!(got, expected, "{got}");
}

#[test]
fn the_same_truck_on_the_right_hides_the_right() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    // receding this time
    rig.drive(&[Vehicle::truck(60.0 - 25.0 * 29.0 / 15.0, -6.0, 25.0)], 30, true);
    let t = rig.last();
    assert!(t > 1.0);
    assert_eq!(rig.visibility(100.0, -9.0), Visibility::Invisible);
    assert_eq!(rig.visibility(100.0, 9.0), Visibility::Visible);
    assert_eq!(rig.visibility(40.0, -4.0), Visibility::Visible, "in front of it the road is free");
}

#[test]
fn a_radar_without_elevation_sees_the_same_shadow() {
    let vehicles = [Vehicle::truck(110.0, 6.0, -25.0), Vehicle::car(150.0, -4.0, -30.0)];
    let mut with = Rig::new(gantry(6.0, 0.0));
    with.drive(&vehicles, 30, true);
    let mut without = Rig::new(gantry(6.0, 0.0));
    without.drive(&vehicles, 30, false);
    assert!(with.draw(5..200, -15..15).contains('#'));
    assert_eq!(with.draw(5..200, -15..15), without.draw(5..200, -15..15));
}

#[test]
fn a_car_hides_little_and_a_low_sensor_is_hidden_by_it_longer() {
    let hidden = |height_m: f32| {
        let mut rig = Rig::new(gantry(height_m, 0.0));
        rig.drive(&[Vehicle::car(60.0 + 25.0 * 29.0 / 15.0, 0.0, -25.0)], 30, true);
        (62..190).filter(|x| rig.visibility(f64::from(*x) + 0.5, 0.0) == Visibility::Invisible).count()
    };
    // similar triangles over the roof at 62 m: to 62 * 5 / 4.5 = 69 m, and to 62 * 2.5 / 2 = 78 m
    let (high, low) = (hidden(6.0), hidden(3.5));
    assert!((4..=10).contains(&high) && (11..=20).contains(&low), "{high} m from 6 m, {low} m from 3.5 m");
}

#[test]
fn a_shadow_moves_with_its_truck_and_leaves_nothing_behind() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    let truck = Vehicle::truck(60.0, 0.0, 20.0);
    rig.drive(&[truck], 45, true);
    let x = truck.at(rig.last()).x;
    assert_eq!(rig.visibility(x + 20.0, 0.0), Visibility::Invisible);
    for behind in [15.0, 20.0, 30.0] {
        assert_eq!(rig.visibility(x - behind, 0.0), Visibility::Visible, "where the truck was {behind} m ago");
    }
}

#[test]
fn a_yawed_sensor_puts_the_shadow_at_the_same_place_of_the_road() {
    let truck = Vehicle::truck(110.0, 6.0, -25.0);
    let picture = |yaw: f32| {
        let mut rig = Rig::new(gantry(6.0, yaw));
        rig.drive(&[truck], 30, true);
        rig.draw(40..150, -10..20)
    };
    let (straight, yawed) = (picture(0.0), picture(-10.0));
    let differ = straight.chars().zip(yawed.chars()).filter(|(a, b)| a != b).count();
    assert!(straight.contains('#') && differ <= 8, "{differ} differ{straight}{yawed}");
}

#[test]
fn a_vehicle_that_stops_stays_an_obstacle() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    let mut truck = Vehicle::truck(80.0, 4.0, -10.0);
    for frame in 0..150 {
        let speed = (10.0 - f64::from(frame) / 6.0).max(0.0);
        truck.x -= speed * FRAME_US as f64 * 1e-6;
        truck.speed = -speed;
        let d = truck.detections(&rig.sensor, true);
        rig.frame(&d);
    }
    assert_eq!(rig.visibility(truck.x + 20.0, 5.0), Visibility::Invisible, "standing for five seconds");
}

#[test]
fn around_a_lorry_that_has_stood_for_an_hour_the_map_is_what_it_was_when_it_stopped() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    let mut truck = Vehicle::truck(80.0, 4.0, -10.0);
    let mut frames = |rig: &mut Rig, n: u32| {
        for _ in 0..n {
            let speed = (-truck.speed - FRAME_US as f64 * 1e-6).max(0.0);
            truck.x -= speed * FRAME_US as f64 * 1e-6;
            truck.speed = -speed;
            let d = truck.detections(&rig.sensor, true);
            rig.frame(&d);
        }
    };
    frames(&mut rig, 300);
    let stopped = rig.draw(5..150, -5..15);
    frames(&mut rig, 15 * 3600);
    let after = rig.draw(5..150, -5..15);
    let differ = stopped.chars().zip(after.chars()).filter(|(a, b)| a != b).count();
    assert!(stopped.matches('#').count() > 10, "{stopped}");
    assert!(differ <= 2, "{stopped}{after}");
    // it leaves, and so does its shadow
    for _ in 0..150 {
        rig.frame(&[]);
    }
    assert_eq!(rig.draw(5..150, -5..15).matches('#').count(), 0);
}

#[test]
fn more_vehicles_than_the_list_holds_are_counted() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    // 13 lanes of vehicles 8 m apart, all moving
    let places = |t: f64| {
        (0..17)
            .flat_map(move |i| (-6..7).map(move |lane| [20.0 + 8.0 * f64::from(i) + 10.0 * t, 4.0 * f64::from(lane)]))
    };
    let mut report = rig.frame(&[]);
    assert_eq!((report.obstacles, report.obstacles_dropped), (0, 0));
    for _ in 0..5 {
        let moving = places(rig.seconds());
        let all: Vec<_> = moving.filter_map(|[x, y]| detection(&rig.sensor, [x, y, 0.7], [10.0, 0.0], true)).collect();
        report = rig.frame(&all);
    }
    assert!(report.obstacles_dropped > 50, "{} followed, {} not", report.obstacles, report.obstacles_dropped);
}

#[test]
fn a_guard_rail_hides_nothing() {
    for spacing in [2, 3] {
        let mut rig = Rig::new(gantry(6.0, 0.0));
        for frame in 0..60 {
            let posts = (0..150 / spacing).map(|k| 20.0 + f64::from(k * spacing + frame % spacing));
            let rail = posts.filter_map(|x| detection(&rig.sensor, [x, 8.0, 0.6], [0.0; 2], true));
            let d: Vec<Detection> = rail.collect();
            rig.frame(&d);
        }
        assert!(!rig.draw(30..190, -15..25).contains('#'), "{}", rig.draw(30..190, -15..25));
    }
}

#[test]
fn a_sign_hides_what_is_behind_it_and_a_bollard_does_not() {
    let behind = |reflection_m: f64| {
        let mut rig = Rig::new(gantry(6.0, 0.0));
        for _ in 0..30 {
            let sign = detection(&rig.sensor, [30.0, 0.0, reflection_m], [0.0; 2], true);
            let d: Vec<Detection> = sign.into_iter().collect();
            rig.frame(&d);
        }
        assert_eq!(rig.visibility(50.0, 5.0), Visibility::Visible, "beside it");
        rig.visibility(50.0, 0.0)
    };
    // it reflects half way up: over a top of 4.3 m at 30 m the line of sight is 1 m high at 87 m
    assert_eq!(behind(2.4), Visibility::Invisible);
    assert_eq!(behind(1.4), Visibility::Visible);
}

#[test]
fn a_car_that_was_never_seen_to_move_hides_what_is_close_behind_it() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    let car = Vehicle::car(60.0, 0.0, 0.0);
    // it reflects here and there
    let shifted = |k: u32| Vehicle { x: car.x + 0.5 * f64::from(k % 3) - 0.5, length: 3.4, ..car };
    for frame in 0..30 {
        let d: Vec<Detection> = (0..2).flat_map(|k| shifted(frame + k).detections(&rig.sensor, true)).collect();
        rig.frame(&d);
    }
    assert_eq!(rig.visibility(65.0, 0.5), Visibility::Invisible);
    assert_eq!(rig.visibility(90.0, 0.5), Visibility::Visible);
}

#[test]
fn an_empty_road_is_visible_to_the_limit_and_unknown_beyond() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    let report = rig.frame(&[]);
    assert_eq!((report.condition, report.continuity), (Condition::Healthy, Continuity::First));
    assert_eq!(rig.visibility(150.0, 0.0), Visibility::Visible);
    assert_eq!(rig.visibility(5.0, 0.0), Visibility::Unknown, "below the lower limit");
    assert_eq!(rig.visibility(-50.0, 0.0), Visibility::Unknown, "behind the sensor");
    assert_eq!(rig.visibility(201.0, 0.0), Visibility::Unknown);
    assert_eq!(rig.visibility(50.0, 100.0), Visibility::Unknown, "63 degrees to the left");
}

#[test]
fn before_the_first_frame_after_the_hold_time_and_when_blind_all_is_unknown() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    assert_eq!(rig.visibility(100.0, 0.0), Visibility::Unknown);
    rig.drive(&[Vehicle::car(80.0, 0.0, 5.0)], 5, true);
    assert_eq!(rig.visibility(60.0, 10.0), Visibility::Visible);
    let late = |ms: u64| Time::from_micros(rig.now().micros() - FRAME_US + ms * 1000);
    let (held, stale) = (late(500), late(501));
    assert_eq!(rig.state.expire(&rig.parameters, held, &mut rig.map), Condition::Healthy);
    assert_eq!(rig.visibility(60.0, 10.0), Visibility::Visible);
    assert_eq!(rig.state.expire(&rig.parameters, stale, &mut rig.map), Condition::Stale);
    assert_eq!(rig.visibility(60.0, 10.0), Visibility::Unknown);
    let conditions: Vec<Condition> = (0..20).map(|_| rig.frame(&[]).condition).collect();
    assert_eq!(conditions.first(), Some(&Condition::Healthy));
    assert_eq!(conditions.last(), Some(&Condition::Blind), "empty for a second after traffic");
    assert_eq!(rig.visibility(60.0, 10.0), Visibility::Unknown);
}

/// Conditions over one and a half seconds of frames, 15 a second, and whether anything is on the last map.
fn conditions(rig: &mut Rig, status: FrameStatus, detections: &[Detection]) -> (Vec<Condition>, bool) {
    let conditions = (0..23)
        .map(|_| {
            let now = rig.now();
            rig.frames += 1;
            rig.state.process(&rig.parameters, now, detections, status, &mut rig.map).condition
        })
        .collect();
    (conditions, (20..200).any(|x| rig.visibility(f64::from(x), 0.0) != Visibility::Unknown))
}

#[test]
fn rejected_is_not_empty() {
    let row = |sensor: &Sensor| -> Vec<Detection> {
        (30..190).filter_map(|x| detection(sensor, [f64::from(x), 4.0, 0.6], [-20.0, 0.0], true)).collect()
    };
    let right = gantry(6.0, 0.0);
    // nothing but NaN; degrees taken for radians, of which the few within 3 degrees of the axis are none that
    // the gate takes; a mount that looks 30 degrees farther down, so that the map ends at 20 m
    let degrees: Vec<Detection> = row(&right)
        .iter()
        .filter(|d| d.azimuth.radians().to_degrees().abs() < std::f32::consts::PI)
        .map(|d| Detection { azimuth: Angle::from_radians(d.azimuth.radians().to_degrees()), ..*d })
        .collect();
    let refused = (row(&right).len() - degrees.len()) as u16;
    assert!(refused > 0 && !degrees.is_empty());
    let mut down = right;
    down.mount.pitch_deg = 33.0;
    let cases = [
        ("NaN", right, 160, Vec::new()),
        ("mostly NaN", right, 161, row(&right)),
        ("degrees", right, 160 - degrees.len() as u16, degrees),
        ("outside", right, 0, row(&right).iter().map(|d| Detection { range_cm: d.range_cm + 18_000, ..*d }).collect()),
        ("mount", down, 0, row(&right)),
    ];
    for (what, sensor, refused, detections) in cases {
        let mut rig = Rig::new(sensor);
        let (seen, known) = conditions(&mut rig, FrameStatus { refused, ..FrameStatus::default() }, &detections);
        assert_eq!(seen.first(), Some(&Condition::Healthy), "{what}");
        assert_eq!(seen.last(), Some(&Condition::Unusable), "{what}: unknown within 1.5 s");
        assert!(!known, "{what}");
    }
}

#[test]
fn what_was_left_out_is_neither_empty_nor_evidence() {
    let sensor = gantry(6.0, 0.0);
    let clutter = detection(&sensor, [60.0, 9.0, 0.3], [0.0; 2], true).unwrap();
    let left_out = [Detection { marked: true, ..clutter }; 40];
    let mut rig = Rig::new(sensor);
    let (seen, known) = conditions(&mut rig, FrameStatus::default(), &left_out);
    assert!(!known && seen.iter().all(|c| *c == Condition::Starting), "{seen:?}");
    assert_eq!(rig.state.rejections().count(Rejection::Unwanted), 23 * 40);
    rig.drive(&[Vehicle::truck(110.0, 0.0, -20.0)], 30, true);
    let obstacles = rig.state.obstacles().iter().count();
    let (seen, known) = conditions(&mut rig, FrameStatus::default(), &left_out);
    assert_eq!((seen[6], seen[7]), (Condition::Healthy, Condition::Stale), "half a second after the last frame");
    assert!(!known && !seen.contains(&Condition::Blind), "{seen:?}");
    assert_eq!(rig.state.obstacles().iter().count(), obstacles, "nobody saw that they are gone");
}

#[test]
fn weak_clutter_few_detections_and_what_stands_at_the_sensors_feet_stay_visible() {
    let sensor = gantry(6.0, 0.0);
    let at = |x: f64, y: f64, z: f64| detection(&sensor, [x, y, z], [0.0; 2], true).unwrap();
    let weak = |d: Detection| Detection { snr_half_db: Some(2), ..d };
    let cases = [
        ("an empty road", vec![]),
        ("weak clutter", vec![weak(at(60.0, 9.0, 0.3)), weak(at(90.0, -8.0, 0.3))]),
        ("weak clutter, some of it outside", vec![weak(at(60.0, 9.0, 0.3)), weak(at(60.0, 150.0, 0.3))]),
        ("one detection", vec![at(70.0, 2.0, 0.5)]),
        ("three, two of them outside", vec![at(70.0, 2.0, 0.5), at(20.0, 60.0, 0.5), at(230.0, 0.0, 0.5)]),
        ("the roof of a lorry under the gantry", vec![at(9.0, 1.0, 4.0)]),
    ];
    for (what, detections) in cases {
        let (seen, known) = conditions(&mut Rig::new(sensor), FrameStatus::default(), &detections);
        assert!(known && seen.iter().all(|c| *c == Condition::Healthy), "{what}: {seen:?}");
    }
}

#[test]
fn a_gap_of_more_than_a_minute_or_a_step_back_of_the_clock_forgets_the_obstacles() {
    let truck = Vehicle::truck(110.0, 0.0, -20.0);
    for jump in [61_000_000_i64, -5_000_000] {
        let mut rig = Rig::new(gantry(6.0, 0.0));
        rig.drive(&[truck], 60, true);
        let now = Time::from_micros(rig.now().micros().saturating_add_signed(jump));
        let report = rig.state.process(&rig.parameters, now, &[], false, &mut rig.map);
        assert!(report.continuity.resets(), "{jump}");
        assert_eq!((report.obstacles, report.condition), (0, Condition::Healthy));
        assert!(!rig.draw(20..190, -15..15).contains('#'));
    }
}

/// A car that crosses the road 60 m ahead, in the `frames`-th frame; and the heading of what is followed of it, degrees.
fn crosses(rig: &mut Rig, frames: std::ops::Range<u32>) -> f64 {
    for frame in frames {
        let y = -30.0 + 9.0 * f64::from(frame) * FRAME_US as f64 * 1e-6;
        let places = (0..4).flat_map(|k| [59.2, 60.8].map(|x| [x, y + 1.5 * f64::from(k) - 2.25, 0.8]));
        let seen: Vec<Detection> = places.filter_map(|p| detection(&rig.sensor, p, [0.0, 9.0], true)).collect();
        rig.frame(&seen);
    }
    let followed = rig.state.obstacles().iter().max_by_key(|o| o.hits).map(|o| o.heading);
    followed.map_or(f64::NAN, |h| f64::from(h.y).atan2(f64::from(h.x)).to_degrees())
}

#[test]
fn what_was_learnt_of_lanes_outlasts_gaps_and_steps_of_the_clock_and_is_lost_by_a_reset() {
    let learning = Radar3dConfig {
        obstacles: ObstacleConfig { lane_vehicles: 3.0, ..ObstacleConfig::default() },
        ..Radar3dConfig::default()
    };
    let mut rig = Rig::with(gantry(6.0, 0.0), &learning);
    for _ in 0..5 {
        crosses(&mut rig, 0..90);
        // two seconds without frames
        rig.frames += 30;
    }
    let known = crosses(&mut rig, 25..26);
    assert!((known - 90.0).abs() < 5.0, "{known} degrees in the first frame");
    rig.frames -= 60;
    let known = crosses(&mut rig, 25..26);
    assert!((known - 90.0).abs() < 5.0, "{known} degrees after a step of the clock");
    rig.state.reset();
    let unknown = crosses(&mut rig, 25..26);
    assert!((unknown.abs() - 180.0).abs() < 5.0, "{unknown} degrees after a reset");
}

#[test]
fn of_ten_thousand_detections_256_are_taken_and_the_rest_is_counted() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    let many: Vec<Detection> = (0..10_000_i32)
        .map(|i| Detection {
            range_cm: (500 + i % 19_000) as u16,
            azimuth: Angle::from_raw((i * 37 % 20_000 - 10_000) as i16),
            elevation: Some(Angle::from_raw((i % 2000 - 1000) as i16)),
            radial_velocity_cm_s: (i % 6000 - 3000) as i16,
            rcs_half_dbsm: None,
            snr_half_db: Some((20 + i % 100) as i16),
            marked: false,
        })
        .collect();
    for _ in 0..10 {
        let report = rig.frame(&many);
        assert_eq!(report.used, 256);
        assert_eq!(u32::from(report.used) + report.rejections.total(), 10_000, "nothing is lost silently");
        assert!(report.rejections.count(Rejection::Overflow) > 9_000);
    }
}

#[test]
fn queries_answer_in_the_four_words() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    let truck = Vehicle::truck(60.0 + 25.0 * 29.0 / 15.0, 0.0, -25.0);
    rig.drive(&[truck], 30, true);
    let x = (truck.at(rig.last()).x * 100.0) as i32;
    let place = |x_cm: i32, y_cm: i32| Footprint {
        centre: viewshed::sensor::road::RoadPoint::new(x_cm, y_cm),
        heading: Direction::AHEAD,
        half_length_cm: 220,
        half_width_cm: 90,
    };
    assert_eq!(query::object(&*rig.map, &place(x, 0)), Answer::VisibleOccupied);
    assert_eq!(query::object(&*rig.map, &place(x + 3000, 0)), Answer::Invisible);
    assert_eq!(query::area(&*rig.map, &place(x - 3000, 500)), Answer::VisibleFree);
    assert_eq!(query::area(&*rig.map, &place(300, 0)), Answer::Unknown);
}

/// Detections of a moving thing at points of its own axes: ahead of its middle and to its left.
fn points(rig: &Rig, v: &Vehicle, at: &[(f64, f64)], speed: f64) -> Vec<Detection> {
    at.iter().filter_map(|(x, y)| detection(&rig.sensor, [v.x + x, v.y + y, 0.8], [speed, 0.0], true)).collect()
}

#[test]
fn a_truck_seen_only_at_both_ends_is_one_vehicle() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    let truck = Vehicle::truck(60.0, 4.0, 22.0);
    let mut report = None;
    for frame in 0..30 {
        let now = truck.at(f64::from(frame) * FRAME_US as f64 * 1e-6);
        let d = points(&rig, &now, &[(-8.2, -1.0), (-8.2, 1.0), (-6.0, 0.0), (6.0, 0.0), (8.2, 0.0)], truck.speed);
        report = Some(rig.frame(&d));
    }
    assert_eq!(report.unwrap().obstacles, 1);
    let now = truck.at(29.0 * FRAME_US as f64 * 1e-6);
    assert_eq!(rig.visibility(now.x + 30.0, 5.5), Visibility::Invisible, "a truck is high, two cars are not");
}

#[test]
fn two_cars_at_a_safe_headway_are_two_vehicles() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    // 1 s from bumper to bumper
    let cars = [Vehicle::car(50.0, 0.0, 22.0), Vehicle::car(50.0 + 22.0 + 4.4, 0.0, 22.0)];
    rig.drive(&cars, 30, true);
    let report = rig.frame(&[]);
    assert_eq!(report.obstacles, 2);
}

#[test]
fn spinning_wheels_are_no_vehicles_of_their_own() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    let car = Vehicle::car(40.0, 4.0, 20.0);
    let mut report = None;
    for frame in 0..30 {
        let now = car.at(f64::from(frame) * FRAME_US as f64 * 1e-6);
        let mut d = now.detections(&rig.sensor, true);
        d.extend(points(&rig, &now, &[(-1.3, -0.8), (1.3, -0.8)], car.speed * 1.6));
        report = Some(rig.frame(&d));
    }
    assert_eq!(report.unwrap().obstacles, 1);
}

#[test]
fn both_flanks_of_a_truck_are_one_vehicle() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    rig.drive(&[Vehicle::truck(110.0, 6.0, -25.0)], 30, true);
    assert_eq!(rig.state.obstacles().iter().count(), 1);
}

#[test]
fn two_cars_side_by_side_are_two_vehicles() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    rig.drive(&[Vehicle::car(40.0, 2.0, 20.0), Vehicle::car(40.0, -1.5, 20.0)], 30, true);
    assert_eq!(rig.state.obstacles().iter().count(), 2);
}

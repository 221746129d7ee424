//! What stands for long: crowds, parked lorries, roadworks and jams, with traffic beside them.

use crate::common::{FRAME_US, Rig, Vehicle, detection, gantry};
use viewshed::frame::detection::Detection;
use viewshed::frame::health::{Condition, Continuity};
use viewshed::map::Visibility;
use viewshed::obstacles::config::ObstacleConfig;
use viewshed::obstacles::solid::Solid;
use viewshed::radar_3d::{FrameReport, Radar3dConfig};

/// Of 15 frames a second two in three are left out: as few as the estimator is made for.
const LEFT_OUT: u64 = 2;
const PERIOD_S: f64 = ((LEFT_OUT + 1) * FRAME_US) as f64 * 1e-6;
/// Obstacles that are followed at most.
const ROOM: u16 = 96;

fn frame(rig: &mut Rig, detections: &[Detection]) -> FrameReport {
    let report = rig.frame(detections);
    rig.frames += LEFT_OUT;
    report
}

/// Frames in so many seconds.
fn frames(seconds: f64) -> u32 {
    (seconds / PERIOD_S) as u32
}

/// Height of a car and of what is longer, metres.
fn top(v: &Vehicle) -> f64 {
    if v.length > 5.0 { 4.0 } else { 1.5 }
}

/// Whether a vehicle, so much larger to all sides and above, is in the way between the sensor and a point.
fn hides(rig: &Rig, v: &Vehicle, [larger_m, higher_m]: [f64; 2], [x, y, z]: [f64; 3]) -> bool {
    let height = f64::from(rig.sensor.mount.height_m);
    let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
    for (to, at, half) in [(x, v.x, v.length / 2.0 + larger_m), (y, v.y, v.width / 2.0 + larger_m)] {
        if to.abs() > 1e-6 {
            let [a, b] = [-half, half].map(|side| (at + side) / to);
            (enters, leaves) = (enters.max(a.min(b)), leaves.min(a.max(b)));
        } else if at.abs() > half {
            return false;
        }
    }
    enters < leaves && height + leaves * (z - height) < top(v) + higher_m
}

/// Points of a vehicle that no other one hides. What stands reflects here and there.
fn shown(rig: &Rig, vehicles: &[Vehicle], k: usize) -> Vec<[f64; 3]> {
    let moment = rig.frames / (LEFT_OUT + 1);
    let v = vehicles[k];
    let shifted = |n| Vehicle { x: v.x + 0.5 * ((moment + n) % 3) as f64 - 0.5, length: v.length - 1.0, ..v };
    let seen = if v.speed == 0.0 { vec![shifted(0), shifted(1)] } else { vec![v] };
    let is_hidden = |point| vehicles.iter().enumerate().any(|(n, other)| n != k && hides(rig, other, [0.0; 2], point));
    seen.iter().flat_map(Vehicle::points).filter(|point| !is_hidden(*point)).collect()
}

/// What the radar sees of vehicles that may hide each other, and of points that stand.
fn scan(rig: &Rig, vehicles: &[Vehicle], standing: &[[f64; 3]]) -> Vec<Detection> {
    let stand = standing.iter().map(|point| (*point, 0.0));
    let drive =
        (0..vehicles.len()).flat_map(|k| shown(rig, vehicles, k).into_iter().map(move |p| (p, vehicles[k].speed)));
    stand.chain(drive).filter_map(|(point, speed)| detection(&rig.sensor, point, [speed, 0.0], true)).collect()
}

fn boxes(rig: &Rig) -> Vec<Solid> {
    rig.state.obstacles().solids(rig.parameters.tracking()).collect()
}

/// Whether a box lies where a vehicle is.
fn is_of(solid: &Solid, v: &Vehicle) -> bool {
    let off = |at_cm: i32, at: f64| (f64::from(at_cm) / 100.0 - at).abs();
    off(solid.x_cm, v.x) < v.length / 2.0 + 1.0 && off(solid.y_cm, v.y) < 1.5
}

fn has_box(rig: &Rig, v: &Vehicle) -> bool {
    boxes(rig).iter().any(|solid| is_of(solid, v))
}

/// Places of the road, a metre from each other.
fn road() -> impl Iterator<Item = [f64; 2]> {
    (20..190).flat_map(|x| (-14..15).map(move |y| [f64::from(x), f64::from(y)]))
}

/// Places that are not said to be visible, and that no vehicle hides even were it wider by a column of the map and so much higher.
fn hidden_by_none(rig: &Rig, vehicles: &[Vehicle], higher_m: f64) -> Vec<[f64; 2]> {
    let behind = |[x, y]: [f64; 2]| vehicles.iter().any(|v| hides(rig, v, [1.5, higher_m], [x, y, 1.0]));
    road().filter(|place| rig.visibility(place[0], place[1]) != Visibility::Visible && !behind(*place)).collect()
}

/// Places two metres and more behind a vehicle that are said to be visible, and that it hides even were it narrower.
fn visible_behind(rig: &Rig, v: &Vehicle) -> Vec<[f64; 2]> {
    let behind = |[x, y]: [f64; 2]| x > v.x + v.length / 2.0 + 2.0 && hides(rig, v, [-0.5, 0.0], [x, y, 1.0]);
    road().filter(|place| rig.visibility(place[0], place[1]) == Visibility::Visible && behind(*place)).collect()
}

/// Vehicles that follow each other in a lane and enter the view every so many seconds; each third may be a lorry.
fn stream(seconds: f64, every_s: f64, y: f64, speed: f64, lorries: bool) -> Vec<Vehicle> {
    let last = (seconds / every_s) as u32;
    let of = |number: u32| {
        let on_its_way = speed * (seconds - every_s * f64::from(number));
        let x = if speed > 0.0 { 5.0 + on_its_way } else { 215.0 + on_its_way };
        let kind = if lorries && number % 3 == 2 { Vehicle::truck } else { Vehicle::car };
        (5.0..=215.0).contains(&x).then(|| kind(x, y, speed))
    };
    (last.saturating_sub(9)..=last).filter_map(of).collect()
}

/// Frames of vehicles in the middle of the view, and those of them without a box.
#[derive(Debug, Default, PartialEq)]
struct Passed {
    frames: u32,
    without: u32,
}

impl Passed {
    fn look(&mut self, rig: &Rig, traffic: &[Vehicle]) {
        for v in traffic.iter().filter(|v| (40.0..140.0).contains(&v.x)) {
            self.frames += 1;
            self.without += u32::from(!has_box(rig, v));
        }
    }
}

/// An hour of traffic beside a lorry that is parked: in the lane next to it, where what comes hides it for moments, and in the one
/// beyond. None at the end.
fn an_hour_beside(rig: &mut Rig, lorry: &Vehicle) -> Passed {
    let (mut passed, begin) = (Passed::default(), rig.seconds());
    for _ in 0..frames(3600.0) {
        let seconds = rig.seconds() - begin;
        let coming = stream(seconds, 30.0, 1.5, -20.0, true);
        let leaving = stream(seconds, 20.0, -2.0, 20.0, true);
        let mut vehicles = [coming, leaving].concat();
        vehicles.push(*lorry);
        let report = frame(rig, &scan(rig, &vehicles, &[]));
        assert!(report.obstacles < 16 && report.obstacles_dropped == 0, "{report:?}");
        vehicles.pop();
        passed.look(rig, &vehicles);
    }
    passed
}

#[test]
fn a_lorry_that_stopped_an_hour_ago_hides_what_is_behind_it_and_traffic_beside_it_has_boxes() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    let mut lorry = Vehicle::truck(130.0, 5.0, -10.0);
    for _ in 0..frames(15.0) {
        lorry.speed = (lorry.speed + PERIOD_S).min(0.0);
        lorry = lorry.at(PERIOD_S);
        let seen = lorry.detections(&rig.sensor, true);
        frame(&mut rig, &seen);
    }
    let passed = an_hour_beside(&mut rig, &lorry);
    let (hidden, visible) = (hidden_by_none(&rig, &[lorry], 0.0), visible_behind(&rig, &lorry));
    assert!(passed.frames > 5000 && passed.without == 0, "{passed:?}");
    assert_eq!((boxes(&rig).len(), has_box(&rig, &lorry)), (1, true));
    assert!(hidden.is_empty(), "{hidden:?}{}", rig.draw(5..190, -15..15));
    assert!(visible.is_empty(), "{visible:?}{}", rig.draw(5..190, -15..15));
}

#[test]
fn a_lorry_parked_before_the_unit_started_hides_little_and_traffic_beside_it_has_boxes() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    let lorry = Vehicle::truck(80.0, 5.0, 0.0);
    let passed = an_hour_beside(&mut rig, &lorry);
    let hidden = hidden_by_none(&rig, &[lorry], 0.0);
    assert!(passed.frames > 5000 && passed.without == 0, "{passed:?}");
    assert!(boxes(&rig).is_empty());
    assert!(hidden.is_empty(), "{hidden:?}{}", rig.draw(5..190, -15..15));
    // it shows nothing high
    assert_eq!(rig.visibility(90.0, 5.5), Visibility::Invisible, "close behind it");
}

#[test]
fn in_a_crowd_that_stood_for_a_minute_a_lorry_has_its_box_and_its_shadow_and_the_lane_is_seen() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    // to both sides of a lane; of too many detections those of crowded places go first
    let places = (0..256).map(|i| {
        let aside = 2.5 + f64::from(i / 16 % 8);
        [20.0 + 8.0 * f64::from(i % 16), if i < 128 { aside } else { -aside }, 0.8]
    });
    let crowd: Vec<Detection> = places
        .filter_map(|place| detection(&rig.sensor, place, [0.0; 2], true))
        .map(|d| Detection { snr_half_db: Some(30), ..d })
        .collect();
    assert_eq!(crowd.len(), 256);
    for _ in 0..frames(60.0) {
        let report = frame(&mut rig, &crowd);
        assert_eq!((report.used, report.condition), (256, Condition::Healthy));
        assert_eq!((report.obstacles, report.obstacles_dropped), (0, 0));
    }
    let lane_is_seen = |rig: &Rig| (20..190).all(|x| rig.visibility(f64::from(x), 0.0) == Visibility::Visible);
    let hidden = road().filter(|[x, y]| rig.visibility(*x, *y) != Visibility::Visible).count();
    assert!(lane_is_seen(&rig) && 3 * hidden < road().count(), "{hidden}{}", rig.draw(5..190, -15..15));
    let (mut lorry, mut passed) = (Vehicle::truck(5.0, 0.0, 15.0), Passed::default());
    while lorry.x < 230.0 {
        let mut seen = crowd.clone();
        seen.extend(lorry.detections(&rig.sensor, true));
        let report = frame(&mut rig, &seen);
        assert_eq!(report.used, 256);
        assert_eq!(report.rejections.total() as usize + 256, seen.len(), "what finds no room is counted");
        assert!(report.obstacles < 4, "{report:?}");
        passed.look(&rig, &[lorry]);
        if (40.0..140.0).contains(&lorry.x) {
            assert_eq!(rig.visibility(lorry.x + 20.0, 0.0), Visibility::Invisible, "{lorry:?}");
        }
        lorry = lorry.at(PERIOD_S);
    }
    assert!(passed.frames > 30 && passed.without == 0, "{passed:?}");
    for _ in 0..frames(3.0) {
        frame(&mut rig, &crowd);
    }
    assert!(boxes(&rig).is_empty() && lane_is_seen(&rig), "{}", rig.draw(5..190, -15..15));
    // all leave at once
    let speed = |i: usize| (300 + 97 * (i % 13) as i16) * [1, -1][i % 2];
    let leaving: Vec<Detection> =
        crowd.iter().enumerate().map(|(i, d)| Detection { radial_velocity_cm_s: speed(i), ..*d }).collect();
    let report = (0..10).map(|_| frame(&mut rig, &leaving)).last().unwrap();
    assert!(report.obstacles <= ROOM && report.obstacles_dropped > 100, "{report:?}");
}

#[test]
fn roadworks_of_a_night_are_no_vehicles_and_traffic_that_gives_way_to_them_has_boxes() {
    let obstacles = ObstacleConfig { lane_vehicles: 3.0, ..ObstacleConfig::default() };
    let mut rig = Rig::with(gantry(6.0, 0.0), &Radar3dConfig { obstacles, ..Radar3dConfig::default() });
    // posts beside the road, and one where traffic will be led
    let old = [60.0, -5.5, 0.8];
    let posts: Vec<[f64; 3]> = (0..7).map(|k| [30.0 + 20.0 * f64::from(k), 8.0, 0.8]).collect();
    let drive = |rig: &mut Rig, lanes: [f64; 2], seconds: f64, stand: &[[f64; 3]], parked: &[Vehicle]| {
        let (mut passed, mut strays, begin) = (Passed::default(), 0, rig.seconds());
        for _ in 0..frames(seconds) {
            let now = rig.seconds() - begin;
            let traffic = [stream(now, 6.0, lanes[0], 15.0, false), stream(now, 7.0, lanes[1], -15.0, true)].concat();
            let seen = scan(rig, &[&traffic[..], parked].concat(), stand);
            let report = frame(rig, &seen);
            assert!(report.obstacles < 24 && report.obstacles_dropped == 0, "{report:?}");
            passed.look(rig, &traffic);
            let works = boxes(rig).into_iter().filter(|b| b.y_cm > 0 && (3000..14_500).contains(&b.x_cm));
            strays += works.filter(|b| !traffic.iter().any(|v| is_of(b, v))).count();
            for v in traffic.iter().filter(|v| v.length > 5.0 && (50.0..120.0).contains(&v.x)) {
                assert_eq!(rig.visibility(1.35 * v.x, 1.35 * v.y), Visibility::Invisible, "{v:?}");
            }
        }
        (passed, strays)
    };
    // a car that comes to a stop there, of which the radar sees the face alone: where a fixture is, that is taken for it
    let is_followed_at = |rig: &Rig, place: [f64; 3], stand: &[[f64; 3]]| {
        let (mut rig, mut car) = (rig.clone(), Vehicle::car(place[0] + 24.7, place[1], -10.0));
        for _ in 0..15 * 25 {
            let face = [-0.1, 0.1].map(|side| [car.x, car.y + side, 0.8]);
            let seen = face.iter().filter_map(|point| detection(&rig.sensor, *point, [car.speed, 0.0], true));
            let seen: Vec<Detection> = seen.chain(scan(&rig, &[], stand)).collect();
            rig.frame(&seen);
            let dt = FRAME_US as f64 * 1e-6;
            car.speed = (car.speed + 2.0 * dt).min(0.0);
            car = car.at(dt);
        }
        has_box(&rig, &Vehicle { x: car.x + 2.2, ..car })
    };
    let stand = [&posts[..], &[old]].concat();
    let (passed, _) = drive(&mut rig, [2.0, -2.0], 90.0, &stand, &[]);
    assert!(passed.frames > 500 && passed.without == 0, "{passed:?}");
    assert!(!is_followed_at(&rig, old, &stand), "a fixture");
    // the night
    rig.frames += 8 * 3600 * 15;
    let beacons = (0..31).map(|k| [40.0 + 2.0 * f64::from(k), 3.5 - 0.1 * f64::from(k), 0.9]);
    let stand: Vec<[f64; 3]> = posts.into_iter().chain(beacons).collect();
    let trailer = Vehicle { x: 80.0, y: 6.5, speed: 0.0, length: 6.0, width: 2.0 };
    let parked = [trailer, Vehicle::truck(112.0, 2.0, 0.0)];
    let seen = scan(&rig, &parked, &stand);
    assert_eq!(frame(&mut rig, &seen).continuity, Continuity::Gap);
    drive(&mut rig, [-2.0, -5.5], 40.0, &stand, &parked);
    let (passed, strays) = drive(&mut rig, [-2.0, -5.5], 60.0, &stand, &parked);
    assert!(passed.frames > 300 && passed.without == 0, "{passed:?}");
    assert_eq!(strays, 0, "boxes in the lane that is closed");
    for _ in 0..frames(5.0) {
        let seen = scan(&rig, &parked, &stand);
        frame(&mut rig, &seen);
    }
    let hidden = hidden_by_none(&rig, &parked, 0.0);
    assert!(hidden.is_empty(), "{hidden:?}{}", rig.draw(5..190, -15..15));
    for [x, y] in [[85.0, 6.9], [123.0, 2.2]] {
        assert_eq!(rig.visibility(x, y), Visibility::Invisible, "{x} {y}{}", rig.draw(5..190, -15..15));
    }
    assert!(is_followed_at(&rig, old, &stand), "it has gone");
}

#[test]
fn a_unit_that_starts_in_a_jam_sees_the_road_beside_it_and_boxes_once_it_moves() {
    let mut rig = Rig::new(gantry(6.0, 0.0));
    let line = |y: f64| (0..18).map(move |k| Vehicle::car(15.0 + 7.5 * f64::from(k), y, 0.0));
    let mut jam: Vec<Vehicle> = line(2.0).chain(line(-2.0).filter(|v| (v.x - 60.0).abs() > 8.0)).collect();
    jam.push(Vehicle::truck(60.0, -2.0, 0.0));
    for _ in 0..frames(60.0) {
        let seen = scan(&rig, &jam, &[]);
        let report = frame(&mut rig, &seen);
        assert_eq!((report.obstacles, report.obstacles_dropped, report.condition), (0, 0, Condition::Healthy));
    }
    // what was never seen to move hides what is close behind it, were it half a metre higher than a car
    for k in 0..jam.len() {
        let points = shown(&rig, &jam, k);
        let is_hidden = |[x, y, _]: &[f64; 3]| rig.visibility(x + 2.0, y * (1.0 + 2.0 / x)) != Visibility::Visible;
        assert!(points.len() < 6 || points.iter().any(is_hidden), "{:?}{}", jam[k], rig.draw(5..190, -15..15));
    }
    let hidden = hidden_by_none(&rig, &jam, 0.5);
    assert!(hidden.is_empty(), "{hidden:?}{}", rig.draw(5..190, -15..15));
    // those in front leave first; who shows four points for three seconds has a box
    let (mut plain, mut most) = (vec![0; jam.len()], 0);
    for k in 0..frames(45.0) {
        for v in &mut jam {
            if f64::from(k) * PERIOD_S > (142.5 - v.x) / 7.5 * 1.2 || v.speed > 0.0 {
                *v = Vehicle { speed: (v.speed + 1.5 * PERIOD_S).min(5.0), ..v.at(PERIOD_S) };
            }
        }
        let seen = scan(&rig, &jam, &[]);
        let report = frame(&mut rig, &seen);
        assert!(report.obstacles < 40 && report.obstacles_dropped == 0, "{report:?}");
        for (n, v) in jam.iter().enumerate() {
            let is_plain = v.speed > 2.0 && (15.0..150.0).contains(&v.x) && shown(&rig, &jam, n).len() > 3;
            plain[n] = if is_plain { plain[n] + 1 } else { 0 };
            assert!(plain[n] < 15 || has_box(&rig, v), "{k}: {v:?} {:?}", boxes(&rig));
        }
        most = most.max(plain.iter().filter(|frames| **frames >= 15).count());
    }
    assert!(most > 8, "{most} at once");
}

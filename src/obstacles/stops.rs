//! Vehicles that stop, stand and leave, as tests of all the rules together.

use std::vec::Vec;

use super::Obstacles;
use super::made_up::{Vehicle, car, change_speed, follow, reflection, rules};
use super::solid::Solid;
use crate::fixed::time::Step;
use crate::frame::by_range::ByRange;
use crate::frame::reflection::Reflection;

fn boxes<const N: usize>(list: &Obstacles<N>) -> Vec<Solid> {
    list.solids(&rules()).collect()
}

/// A car that came along the road and has stopped 50 m ahead.
fn stopped() -> (Obstacles<16>, Solid) {
    let mut list = Obstacles::new();
    let mut cars = [car([30.0, 3.0], [1.0, 0.0], 10.0)];
    follow(&mut list, &mut cars, 2.0, true);
    change_speed(&mut list, &mut cars, 0.0);
    follow(&mut list, &mut cars, 2.0, true);
    let found = boxes(&list);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!((f64::from(found[0].x_cm) / 100.0 - cars[0].at[0]).abs() < 1.5, "{found:?}");
    (list, found[0])
}

#[test]
fn what_has_stopped_keeps_its_box_through_a_red_light_in_a_shadow() {
    let (mut list, found) = stopped();
    follow(&mut list, &mut [], 30.0, false);
    let after = boxes(&list);
    assert_eq!(after.len(), 1);
    assert!((after[0].x_cm - found.x_cm).abs() < 50 && after[0].height_cm == found.height_cm, "{after:?}");
    // seen free, it is given up
    follow(&mut list, &mut [], 6.0, true);
    assert!(boxes(&list).is_empty());
}

#[test]
fn what_stops_across_the_line_of_sight_stays_where_it_stopped() {
    let mut list = Obstacles::<16>::new();
    let mut cars = [car([40.0, -27.5], [0.0, 1.0], 8.0)];
    follow(&mut list, &mut cars, 1.5, true);
    change_speed(&mut list, &mut cars, 0.0);
    follow(&mut list, &mut cars, 3.0, true);
    for _ in 0..10 {
        follow(&mut list, &mut cars, 2.0, true);
        let found = boxes(&list);
        assert_eq!(found.len(), 1, "{found:?}");
        let aside = f64::from(found[0].y_cm) / 100.0 - cars[0].at[1];
        assert!(aside.abs() < 1.0, "{aside} m from where it stands: {found:?}");
        let (vx, vy) = list.iter().next().unwrap().velocity();
        assert!(vx.abs() < 40 && vy.abs() < 40 && found[0].height_cm == 150, "{vx} {vy} cm/s: {found:?}");
    }
}

#[test]
fn what_is_first_seen_as_it_comes_to_a_stop_is_a_vehicle() {
    let mut list = Obstacles::<16>::new();
    // from 2.5 m/s it is 1.6 m to where it stands
    let mut cars = [car([40.0, 3.0], [1.0, 0.0], 2.5)];
    change_speed(&mut list, &mut cars, 0.0);
    follow(&mut list, &mut cars, 5.0, true);
    let found = boxes(&list);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!((f64::from(found[0].x_cm) / 100.0 - cars[0].at[0]).abs() < 1.5, "{found:?}, it is at {:?}", cars[0].at);
}

#[test]
fn what_was_moving_is_given_up_in_a_shadow() {
    let mut list = Obstacles::<16>::new();
    follow(&mut list, &mut [car([30.0, 3.0], [1.0, 0.0], 10.0)], 2.0, true);
    assert_eq!(boxes(&list).len(), 1);
    follow(&mut list, &mut [], 8.0, false);
    assert!(boxes(&list).is_empty());
}

#[test]
fn a_lorry_that_stands_for_an_hour_stays_the_same_box() {
    let mut list = Obstacles::<16>::new();
    let mut lorry = [car([30.0, 5.0], [1.0, 0.0], 6.0)];
    lorry[0].size = [9.0, 2.0];
    follow(&mut list, &mut lorry, 3.0, true);
    change_speed(&mut list, &mut lorry, 0.0);
    follow(&mut list, &mut lorry, 3.0, true);
    let before = boxes(&list);
    follow(&mut list, &mut lorry, 3600.0, true);
    let after = boxes(&list);
    assert_eq!((before.len(), after.len()), (1, 1));
    assert!((after[0].x_cm - before[0].x_cm).abs() < 100 && (after[0].y_cm - before[0].y_cm).abs() < 50);
    assert!((after[0].half_length_cm - before[0].half_length_cm).abs() < 50, "{before:?} {after:?}");
}

#[test]
fn a_crowd_of_standing_detections_makes_no_obstacle() {
    let crowd: Vec<Reflection> =
        (0..256).map(|i| reflection([10.0 + f64::from(i % 16) * 8.0, f64::from(i / 16) - 8.0], [0.0; 2])).collect();
    let mut list = Obstacles::<16>::new();
    for _ in 0..100 {
        let sorted = ByRange::<256>::sort(&crowd, rules().limit_cm);
        let claimed = list.step(&crowd, &sorted, Step::from_micros(66_972), &rules(), |_, _| true);
        assert!((0..256).all(|i| !claimed.contains(i)));
    }
    assert_eq!((list.iter().count(), list.dropped()), (0, 0));
}

/// A jam that has stood since the unit started, so many seconds, and has no boxes.
fn jam<const N: usize>(seconds: f64) -> (Obstacles<N>, Vec<Vehicle>) {
    let mut list = Obstacles::new();
    let mut cars: Vec<_> = (0..6).map(|k| car([30.0 + 8.0 * f64::from(k), 3.0], [1.0, 0.0], 0.0)).collect();
    follow(&mut list, &mut cars, seconds, true);
    assert!(boxes(&list).is_empty());
    (list, cars)
}

#[test]
fn a_jam_the_unit_started_in_is_followed_once_it_moves() {
    let (mut list, mut cars) = jam::<16>(5.0);
    change_speed(&mut list, &mut cars, 2.0);
    follow(&mut list, &mut cars, 3.0, true);
    assert_eq!(boxes(&list).len(), 6);
}

#[test]
fn a_jam_that_stood_for_minutes_before_it_moved_is_followed_when_each_stops_where_another_stood() {
    let (mut list, mut cars) = jam::<64>(120.0);
    change_speed(&mut list, &mut cars, 3.0);
    // 2.25 m in speeding up and as much in stopping
    follow(&mut list, &mut cars, 3.5 / 3.0, true);
    change_speed(&mut list, &mut cars, 0.0);
    for _ in 0..6 {
        follow(&mut list, &mut cars, 10.0, true);
        let found = boxes(&list);
        assert_eq!(found.len(), 6, "{found:?}");
        assert!(found.iter().all(|b| b.half_length_cm > 180), "{found:?}");
    }
}

#[test]
fn a_slow_lorry_half_hidden_for_seconds_stays_a_lorry() {
    let mut list = Obstacles::<16>::new();
    let mut lorry = [car([20.0, 5.0], [1.0, 0.0], 3.0)];
    lorry[0].size = [12.0, 2.0];
    follow(&mut list, &mut lorry, 6.0, true);
    let whole = boxes(&list)[0];
    // only its rear half reflects
    lorry[0].at[0] -= 3.0;
    lorry[0].size[0] = 6.0;
    follow(&mut list, &mut lorry, 4.0, true);
    let half_hidden = boxes(&list)[0];
    assert!(whole.half_length_cm > 550, "{whole:?}");
    assert!(half_hidden.half_length_cm > 360 && half_hidden.height_cm > 290, "{half_hidden:?}");
    // the hidden half lies away from the sensor
    let rear = f64::from(half_hidden.x_cm - half_hidden.half_length_cm) / 100.0;
    assert!((rear - (lorry[0].at[0] - 3.0)).abs() < 1.5, "{rear}");
}

#[test]
fn what_starts_to_move_in_a_standing_box_is_its_departure_and_no_second_vehicle() {
    let (mut list, found) = stopped();
    follow(&mut list, &mut [], 10.0, false);
    // it comes out of the shadow with 5 m/s, a metre from where it stood
    let at = [f64::from(found.x_cm) / 100.0 + 1.0, f64::from(found.y_cm) / 100.0];
    let mut cars = [car(at, [1.0, 0.0], 5.0)];
    follow(&mut list, &mut cars, 1.0, false);
    let after = boxes(&list);
    assert_eq!(after.len(), 1, "{after:?}");
    assert!((f64::from(after[0].x_cm) / 100.0 - cars[0].at[0]).abs() < 1.5, "{after:?}, it is at {:?}", cars[0].at);
}

#[test]
fn one_stray_reflection_that_moves_takes_no_standing_box_away() {
    let (mut list, found) = stopped();
    let place = [f64::from(found.x_cm) / 100.0, f64::from(found.y_cm) / 100.0];
    for _ in 0..20 {
        let seen = [reflection(place, [6.0, 0.0])];
        let sorted = ByRange::<256>::sort(&seen, rules().limit_cm);
        list.step(&seen, &sorted, Step::from_micros(67_000), &rules(), |_, _| false);
        follow(&mut list, &mut [], 2.0, false);
    }
    let after = boxes(&list);
    assert_eq!(after.len(), 1, "{after:?}");
    assert!((after[0].x_cm - found.x_cm).abs() < 100, "{after:?}");
}

#[test]
fn a_scene_and_its_mirror_image_give_boxes_that_are_mirror_images() {
    let side = |mirrored: f64| {
        let mut list = Obstacles::<16>::new();
        // both directions of the road, and one that crosses it
        let mut cars = [
            car([20.0, 4.0 * mirrored], [1.0, 0.0], 12.0),
            car([80.0, 9.0 * mirrored], [-1.0, 0.0], 12.0),
            car([45.0, -14.0 * mirrored], [0.0, mirrored], 8.0),
        ];
        follow(&mut list, &mut cars, 2.5, true);
        let mut found = boxes(&list);
        found.sort_by_key(|s| s.x_cm);
        found
    };
    let (right, left) = (side(1.0), side(-1.0));
    assert_eq!((right.len(), left.len()), (3, 3), "{right:?} {left:?}");
    for (a, b) in right.iter().zip(&left) {
        assert!((a.x_cm - b.x_cm).abs() <= 30 && (a.y_cm + b.y_cm).abs() <= 30, "{a:?} {b:?}");
        assert!((a.half_length_cm - b.half_length_cm).abs() <= 30 && a.height_cm == b.height_cm, "{a:?} {b:?}");
    }
}

#[test]
fn a_standing_vehicle_nobody_sees_is_doubted_as_quickly_whatever_the_rate_of_frames() {
    let (list, _) = stopped();
    let lost = |frames_a_second: u64| {
        let mut list = list.clone();
        let evidence = |list: &Obstacles<16>| list.iter().map(|o| o.existence).sum::<i32>();
        let before = evidence(&list);
        let step = Step::from_micros(1_000_000 / frames_a_second);
        for _ in 0..20 * frames_a_second {
            list.step(&[], &ByRange::<256>::sort(&[], rules().limit_cm), step, &rules(), |_, _| false);
        }
        before - evidence(&list)
    };
    let expected = 20 * rules().standing_hidden_loss;
    for frames in [10, 15, 26, 30, 50] {
        assert!((lost(frames) - expected).abs() <= 2, "{frames} frames a second: {}, not {expected}", lost(frames));
    }
}

//! Starts in the middle of traffic and gaps between frames: what is not known yet is unknown, and what was known is kept.

use crate::common::{FRAME_US, Rig, Vehicle, gantry};
use viewshed::frame::detection::Detection;
use viewshed::frame::health::{Condition, Continuity};
use viewshed::map::Visibility;
use viewshed::radar_3d::{FrameReport, Radar3dConfig};

/// A unit that has just been switched on, 6 m above the road.
fn started() -> Rig {
    Rig::with(gantry(6.0, 0.0), &Radar3dConfig::default())
}

/// So many seconds of these vehicles, which start where they are given.
fn watch(rig: &mut Rig, vehicles: &[Vehicle], seconds: f64) -> Option<FrameReport> {
    let mut report = None;
    for _ in 0..(seconds / (FRAME_US as f64 * 1e-6)).ceil() as u32 {
        let t = rig.seconds();
        let all: Vec<Detection> = vehicles.iter().flat_map(|v| v.at(t).detections(&rig.sensor, true)).collect();
        report = Some(rig.frame(&all));
    }
    report
}

#[test]
fn an_empty_road_settles_outwards_within_two_seconds() {
    let mut rig = started();
    let report = rig.frame(&[]);
    assert_eq!((report.condition, report.continuity), (Condition::Settling, Continuity::First));
    assert!(report.condition.has_map());
    let known = |rig: &Rig| [20.0, 100.0, 190.0].map(|x| rig.visibility(x, 0.0) != Visibility::Unknown);
    assert_eq!(known(&rig), [false; 3]);
    watch(&mut rig, &[], 1.2);
    assert_eq!(known(&rig), [true, false, false]);
    watch(&mut rig, &[], 0.5);
    assert_eq!(known(&rig), [true, true, false]);
    assert_eq!(watch(&mut rig, &[], 0.6).map(|r| r.condition), Some(Condition::Healthy));
    assert_eq!(known(&rig), [true; 3]);
}

#[test]
fn a_lorry_that_stands_at_the_start_hides_from_the_first_map_on_and_its_road_is_seen_once_it_has_left() {
    let mut rig = started();
    let lorry = Vehicle::truck(60.0, 0.0, 0.0);
    let behind = |rig: &Rig| [75.0, 110.0, 180.0].map(|x| rig.visibility(x, 0.0) == Visibility::Visible);
    for _ in 0..100 {
        let report = watch(&mut rig, &[lorry], 0.1);
        assert_eq!(behind(&rig), [false; 3], "{}", rig.draw(5..190, -15..15));
        assert!(rig.frames < 40 || report.map(|r| r.condition) == Some(Condition::Settling));
    }
    assert_eq!(rig.visibility(40.0, 0.0), Visibility::Visible, "before it");
    assert_eq!(rig.visibility(110.0, 8.0), Visibility::Visible, "beside it");
    // it drives off, and is known to be a vehicle
    let mut moving = lorry;
    for _ in 0..150 {
        moving = Vehicle { speed: (moving.speed + 0.1).min(15.0), ..moving.at(FRAME_US as f64 * 1e-6) };
        let seen = moving.detections(&rig.sensor, true);
        rig.frame(&seen);
        let [x, half] = [moving.x, moving.length / 2.0];
        assert_ne!(rig.visibility(x + half + 6.0, 0.0), Visibility::Visible, "{x} {}", rig.draw(5..190, -15..15));
    }
    let condition = watch(&mut rig, &[], 2.0).map(|r| r.condition);
    assert!(condition == Some(Condition::Blind) || behind(&rig) == [true; 3], "{}", rig.draw(5..190, -15..15));
}

#[test]
fn over_a_gap_of_seconds_a_lorry_is_where_it_would_be_by_then() {
    let lorry = Vehicle::truck(150.0, 0.0, -20.0);
    let mut rig = started();
    watch(&mut rig, &[lorry], 4.0);
    let obstacles = |rig: &Rig| rig.state.obstacles().iter().map(|o| o.anchor().0).collect::<Vec<_>>();
    let before = obstacles(&rig);
    assert_eq!(before.len(), 1);
    rig.frames += 30;
    // nothing is detected in the frame after it
    let report = rig.frame(&[]);
    assert!(matches!(report.continuity, Continuity::Follows(us) if us > 2_000_000), "{report:?}");
    let after = obstacles(&rig);
    assert_eq!(after.len(), 1, "kept");
    assert!((after[0] - (before[0] - 20 * 207)).abs() < 150, "{before:?} {after:?}");
    let at = f64::from(after[0]) / 100.0;
    assert_ne!(rig.visibility(at + 12.0, 0.0), Visibility::Visible, "behind it {}", rig.draw(5..190, -15..15));
    assert_eq!(report.condition, Condition::Settling, "what came in the gap has not shown itself");
    assert_eq!(rig.visibility(190.0, 10.0), Visibility::Unknown, "far away");
}

#[test]
fn what_stood_before_a_gap_still_stands_and_what_stands_after_it_alone_may_be_a_vehicle() {
    let mut rig = started();
    // drives up and stops
    let mut lorry = Vehicle::truck(60.0, 0.0, 10.0);
    for _ in 0..600 {
        lorry = Vehicle { speed: (lorry.speed - 0.15).max(0.0), ..lorry.at(FRAME_US as f64 * 1e-6) };
        let seen = lorry.detections(&rig.sensor, true);
        rig.frame(&seen);
    }
    let behind = |rig: &Rig, y: f64| rig.visibility(lorry.x + 20.0, y * (lorry.x + 20.0) / lorry.x);
    assert_eq!(behind(&rig, 0.0), Visibility::Invisible);
    rig.frames += 15 * 20;
    let newcomer = Vehicle::truck(lorry.x, 6.0, 0.0);
    watch(&mut rig, &[lorry, newcomer], 3.0);
    assert_eq!(behind(&rig, 0.0), Visibility::Invisible, "its box outlasts 20 s {}", rig.draw(5..190, -15..15));
    assert_ne!(behind(&rig, 6.0), Visibility::Visible, "came and stopped {}", rig.draw(5..190, -15..15));
}

#[test]
fn a_gap_of_more_than_a_minute_and_a_step_of_the_clock_begin_anew() {
    for jump in [61_000_000_i64, -1_000_000] {
        let mut rig = started();
        assert_eq!(watch(&mut rig, &[], 3.0).map(|r| r.condition), Some(Condition::Healthy));
        let now = viewshed::fixed::time::Time::from_micros(rig.now().micros().saturating_add_signed(jump));
        let report = rig.state.process(&rig.parameters, now, &[], false, &mut rig.map);
        assert_eq!(report.condition, Condition::Settling, "{jump}");
        assert_eq!(rig.visibility(50.0, 0.0), Visibility::Unknown, "{jump}");
    }
}

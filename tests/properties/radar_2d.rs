//! radar-2d: whatever comes in, the map says no more than it may.

use proptest::prelude::*;
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::fixed::trig;
use viewshed::frame::health::Condition;
use viewshed::map::query::{self, Footprint};
use viewshed::map::{Visibility, VisibilityMap};
use viewshed::radar_2d::sightlines::{Fan, Sightlines};
use viewshed::radar_2d::{Radar2d, Radar2dParameters, Radar2dReading};
use viewshed::sensor::road::RoadPoint;

use crate::cases;
use crate::setup::{Setup, setups};
use crate::traffic::{Frame, crowd, frames};

/// Longest range the grid of these tests holds whatever the azimuths, metres.
const RANGE_M: f32 = 60.0;

type Estimator = Radar2d<128, 16, 48, 64>;

struct Rig {
    setup: Setup,
    parameters: Box<Radar2dParameters>,
    state: Box<Estimator>,
}

impl Rig {
    fn new(setup: &Setup) -> Self {
        let parameters = Radar2dParameters::new::<128, 16, 48>(&setup.sensor, &setup.radar_2d).unwrap();
        Self { setup: *setup, parameters: Box::new(parameters), state: Box::new(Estimator::new()) }
    }

    fn frame(&mut self, f: &Frame) -> Condition {
        self.state.process(&self.parameters, f.now, &f.detections, f.fault)
    }

    /// Points around the sensor, every few metres.
    fn points(&self) -> impl Iterator<Item = RoadPoint> + use<> {
        let m = self.setup.sensor.mount;
        let (x, y) = ((m.x_m * 100.0) as i32, (m.y_m * 100.0) as i32);
        let steps = || (-7..=7).map(|i| i * 937);
        steps().flat_map(move |dx| steps().map(move |dy| RoadPoint::new(x + dx, y + dy)))
    }

    fn check(&self, condition: Condition) -> Result<(), TestCaseError> {
        let [last, first] =
            [Radar2dReading::Last, Radar2dReading::First].map(|reading| self.state.map(&self.parameters, reading));
        for p in self.points() {
            let (last, first) = (last.at(p), first.at(p));
            prop_assert!(first.visibility <= last.visibility, "the first run ends no later than the last");
            prop_assert_eq!(first.occupancy, last.occupancy);
            prop_assert!(condition == Condition::Healthy || last.visibility == Visibility::Unknown);
            prop_assert!((last.visibility == Visibility::Unknown) == (last.grade == 0));
        }
        for (k, centre) in self.points().enumerate().filter(|(k, _)| k % 5 == 0) {
            let heading = trig::direction(Angle::from_raw((k * 7919) as u16 as i16));
            let area = Footprint { centre, heading, half_length_cm: 230, half_width_cm: 90 };
            let answer = query::area(&last, &area);
            for (a, b) in (-4..=4).flat_map(|a| (-4..=4).map(move |b| (a * 57, b * 22))) {
                let (x, y) = (heading.along(a, -b), heading.across(-a, b));
                let here = query::point(&last, RoadPoint::new(centre.x_cm + x, centre.y_cm + y));
                prop_assert!(answer <= here, "{answer:?}, and {here:?} at ({a}, {b}) of {area:?}");
            }
        }
        Ok(())
    }
}

/// Setups whose field of view fits the grid.
fn short() -> impl Strategy<Value = Setup> {
    setups().prop_map(|mut s| {
        let v = &mut s.sensor.field_of_view;
        let by = RANGE_M / v.range_max_m.max(RANGE_M);
        (v.range_min_m, v.range_max_m) = (v.range_min_m * by, v.range_max_m * by);
        s
    })
}

fn worlds(most: usize) -> impl Strategy<Value = (Setup, Vec<Frame>)> {
    short().prop_flat_map(move |s| (Just(s), frames(&s, most)))
}

proptest! {
    #![proptest_config(cases(100))]

    #[test]
    fn any_frames_at_any_setup_leave_a_map_that_holds(world in worlds(12)) {
        let [mut rig, mut twin] = [Rig::new(&world.0), Rig::new(&world.0)];
        for f in &world.1 {
            let condition = rig.frame(f);
            prop_assert_eq!(condition, twin.frame(f));
            rig.check(condition)?;
            let [a, b] = [&rig, &twin].map(|r| r.state.map(&r.parameters, Radar2dReading::First));
            prop_assert!(rig.points().all(|p| a.at(p) == b.at(p)), "the same input gives the same bits");
        }
    }

    #[test]
    fn a_map_is_unknown_once_it_is_stale(world in worlds(6), late in any::<u64>()) {
        let mut rig = Rig::new(&world.0);
        let mut last = Time::from_micros(0);
        for f in &world.1 {
            rig.frame(f);
            last = f.now;
        }
        let hold_us = (world.0.radar_2d.health.hold_s * 1e6).round() as u64;
        let condition = rig.state.expire(&rig.parameters, Time::from_micros(late));
        if late.checked_sub(last.micros()).is_none_or(|age| age > hold_us) {
            prop_assert_eq!(condition, Condition::Stale);
        }
        rig.check(condition)?;
    }

    #[test]
    fn a_larger_field_of_view_takes_nothing_away(setup in short(), more in proptest::array::uniform5(0.0..20.0_f32)) {
        let mut larger = setup;
        let v = &mut larger.sensor.field_of_view;
        v.azimuth_min_deg = (v.azimuth_min_deg - more[0]).max(-85.0);
        v.azimuth_max_deg = (v.azimuth_max_deg + more[1]).min(85.0);
        v.elevation_min_deg = (v.elevation_min_deg - more[2]).max(-85.0);
        v.elevation_max_deg = (v.elevation_max_deg + more[3]).min(85.0);
        v.range_max_m = (v.range_max_m + more[4]).min(RANGE_M);
        let [mut small, mut large] = [Rig::new(&setup), Rig::new(&larger)];
        let empty = Frame { now: Time::from_micros(1), fault: false, detections: Vec::new() };
        prop_assert_eq!([small.frame(&empty), large.frame(&empty)], [Condition::Healthy; 2]);
        let [a, b] = [&small, &large].map(|rig| rig.state.map(&rig.parameters, Radar2dReading::First));
        for p in small.points() {
            prop_assert!(!a.at(p).visible() || b.at(p).visible(), "an empty road is visible: {:?}", p);
        }
    }

    #[test]
    fn any_point_can_be_asked_for(world in worlds(4), x in any::<i32>(), y in any::<i32>()) {
        let mut rig = Rig::new(&world.0);
        world.1.iter().for_each(|f| { rig.frame(f); });
        let m = world.0.sensor.mount;
        let away = (f64::from(x) / 100.0 - f64::from(m.x_m)).hypot(f64::from(y) / 100.0 - f64::from(m.y_m));
        let known = rig.state.map(&rig.parameters, Radar2dReading::Last).at(RoadPoint::new(x, y)).visibility != Visibility::Unknown;
        prop_assert!(!known || away <= f64::from(world.0.sensor.field_of_view.range_max_m) + 0.1);
    }

    #[test]
    fn ten_thousand_detections_a_frame_are_taken(setup in short(), seed in any::<u64>()) {
        let mut rig = Rig::new(&setup);
        let detections = crowd(&setup, seed, 10_000);
        let condition = rig.frame(&Frame { now: Time::from_micros(1), fault: false, detections });
        prop_assert!(rig.state.rejections().total() >= 10_000 - 64);
        rig.check(condition)?;
    }

    #[test]
    fn along_a_ray_the_grade_only_falls(
        setup in short(),
        cells in proptest::collection::vec((-6000..6000, -6000..6000), 0..40),
        step in (-100..100_i32, -100..100_i32),
    ) {
        // multiples of one vector have one bearing to the last bit
        prop_assume!(step.0.abs().max(step.1.abs()) >= 20);
        let fan = Fan::new(&setup.sensor.field_of_view.limits().unwrap(), 48, 100);
        let mut sightlines = Sightlines::<48>::new();
        for (x, y) in &cells {
            sightlines.block(*x, *y, &fan);
        }
        let grades: Vec<u8> = (1..120).map(|k| sightlines.grade(k * step.0, k * step.1, &fan)).collect();
        prop_assert!(grades.windows(2).all(|g| g[1] <= g[0]) && grades[118] >= 1, "{:?}", grades);
    }
}

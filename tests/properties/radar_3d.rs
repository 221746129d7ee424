//! radar-3d: whatever comes in, the map says no more than it may.

use proptest::prelude::*;
use viewshed::fixed::time::Time;
use viewshed::frame::health::Condition;
use viewshed::map::polar::PolarMap;
use viewshed::map::{Visibility, VisibilityMap};
use viewshed::radar_3d::{FrameReport, Radar3d, Radar3dParameters};
use viewshed::sensor::road::RoadPoint;

use crate::cases;
use crate::setup::{Setup, setups};
use crate::traffic::{Frame, crowd, drives, frames};

/// An estimator of any shape with its map.
struct Rig<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize> {
    setup: Setup,
    parameters: Box<Radar3dParameters<R, A, E>>,
    state: Box<Radar3d<R, A, E, W, N, D>>,
    map: Box<PolarMap<R, A>>,
}

impl<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>
    Rig<R, A, E, W, N, D>
{
    /// `None` where the slice plane is out of view.
    fn new(setup: &Setup) -> Option<Self> {
        let parameters = Box::new(Radar3dParameters::new(&setup.sensor, &setup.radar_3d).ok()?);
        let map = Box::new(parameters.map());
        Some(Self { setup: *setup, parameters, state: Box::new(Radar3d::new()), map })
    }

    fn frame(&mut self, f: &Frame) -> FrameReport {
        self.state.process(&self.parameters, f.now, &f.detections, f.fault, &mut self.map)
    }

    /// What must hold after any frame.
    fn check(&self, f: &Frame, report: &FrameReport) -> Result<(), TestCaseError> {
        let used = usize::from(report.used);
        prop_assert_eq!(used + report.rejections.total() as usize, f.detections.len(), "all are used or counted");
        prop_assert!(used <= D.min(usize::from(self.setup.radar_3d.gate.max_detections)));
        prop_assert!(usize::from(report.obstacles) <= N);
        prop_assert!(report.condition != Condition::Starting && report.condition != Condition::Stale);
        let (healthy, settling) = (report.condition.has_map(), report.condition == Condition::Settling);
        for a in 0..A {
            let view = self.parameters.axes().view(a);
            for r in 0..R {
                let cell = self.map.cell(a, r);
                let known = cell.visibility != Visibility::Unknown;
                let may_be = healthy && view.contains(&r);
                prop_assert!(known == may_be || settling && may_be, "column {} cell {}", a, r);
                prop_assert!(known == (cell.grade > 0) && (known || !cell.occupied && cell.occupancy == 0));
            }
        }
        Ok(())
    }
}

/// Feeds all frames to two estimators alike.
fn run<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>(
    setup: &Setup,
    frames: &[Frame],
) -> Result<(), TestCaseError> {
    let Some(mut rig) = Rig::<R, A, E, W, N, D>::new(setup) else { return Ok(()) };
    let mut twin = Rig::<R, A, E, W, N, D>::new(setup).unwrap();
    for f in frames {
        let report = rig.frame(f);
        rig.check(f, &report)?;
        prop_assert_eq!(report, twin.frame(f));
        prop_assert!(rig.map == twin.map, "the same input gives the same bits");
    }
    Ok(())
}

/// A setup with frames for it.
fn worlds(most: usize) -> impl Strategy<Value = (Setup, Vec<Frame>)> {
    setups().prop_flat_map(move |s| (Just(s), frames(&s, most)))
}

proptest! {
    #![proptest_config(cases(120))]

    #[test]
    fn any_frames_at_any_setup_leave_a_map_that_holds(world in worlds(16)) {
        run::<24, 12, 4, 1, 6, 24>(&world.0, &world.1)?;
    }

    #[test]
    fn the_least_grid_holds_too(world in worlds(8)) {
        run::<2, 2, 2, 1, 1, 1>(&world.0, &world.1)?;
    }
}

/// Setups as far as sensors reach and as badly as they may measure, in which next to nothing is taken for sure.
fn unsure() -> impl Strategy<Value = Setup> {
    let parts = (proptest::bool::ANY, proptest::bool::ANY, proptest::bool::ANY, proptest::bool::ANY);
    (setups(), parts).prop_map(|(mut setup, (far, noisy, unsure, creeps))| {
        let (view, obstacles) = (&mut setup.sensor.field_of_view, &mut setup.radar_3d.obstacles);
        if far {
            view.range_max_m = 400.0;
        }
        if noisy {
            setup.sensor.noise.azimuth_deg = 10.0;
            (obstacles.gate_sigmas, obstacles.lateral_gate_m) = (8.0, 5.0);
        }
        if unsure {
            (obstacles.heading_sigmas, obstacles.off_axis_sigmas) = (0.0, 0.0);
            (obstacles.off_axis_mps, obstacles.off_axis_share) = (0.0, 0.0);
        }
        if creeps {
            (obstacles.turning_speed_mps, obstacles.min_speed_mps) = (0.5, 0.3);
        }
        setup
    })
}

proptest! {
    #![proptest_config(cases(150))]

    /// With debug assertions: arithmetic that overflows, and what parts of the estimator ask of one another.
    #[test]
    fn whatever_is_followed_stays_within_the_numbers_at_any_setup(
        world in unsure().prop_flat_map(|s| (Just(s), drives(&s, 40)))
    ) {
        run::<12, 8, 2, 1, 8, 24>(&world.0, &world.1)?;
    }
}

proptest! {
    #![proptest_config(cases(8))]

    #[test]
    fn the_small_profile_holds(world in worlds(12)) {
        run::<100, 96, 4, 4, 28, 160>(&world.0, &world.1)?;
    }

    #[test]
    fn the_longest_and_highest_grid_holds(world in worlds(6)) {
        run::<256, 5, 64, 8, 3, 40>(&world.0, &world.1)?;
    }

    #[test]
    fn ten_thousand_detections_a_frame_are_used_or_counted(setup in setups(), seed in any::<u64>()) {
        let frame = |k: u64| Frame {
            now: Time::from_micros(1_000_000 + 66_667 * k),
            fault: false,
            detections: crowd(&setup, seed ^ k, 10_000),
        };
        run::<24, 12, 4, 1, 6, 256>(&setup, &[frame(0), frame(1), frame(2)])?;
    }
}

proptest! {
    #![proptest_config(cases(60))]

    /// The bit of a cell is the visibility at its centre, so the centre is what must be in view.
    #[test]
    fn only_what_the_sensor_can_see_is_known(setup in setups()) {
        let Some(mut rig) = Rig::<50, 24, 6, 2, 4, 8>::new(&setup) else { return Ok(()) };
        rig.frame(&Frame { now: Time::from_micros(1), fault: false, detections: Vec::new() });
        let axes = rig.parameters.axes();
        let slice_cm = (setup.radar_3d.visibility.slice_height_m * 100.0).round() as i32;
        let down_m = f64::from(axes.sensor_height_cm() - slice_cm) / 100.0;
        for (a, r) in (0..24).flat_map(|a| (0..50).map(move |r| (a, r))) {
            if rig.map.cell(a, r).visibility == Visibility::Unknown {
                continue;
            }
            let bearing = f64::from(axes.azimuth_of(a as i32 * 256 + 128).radians());
            let ground = (r as f64 + 0.5) * f64::from(axes.cell_cm) / 100.0;
            let seen = seen(&setup, [ground * bearing.cos(), ground * bearing.sin(), -down_m]);
            prop_assert!(in_view(&setup, seen), "column {} cell {}: {:?}", a, r, seen);
        }
    }

    #[test]
    fn a_map_is_unknown_once_it_is_stale_and_never_comes_back(world in worlds(10), late in any::<u64>()) {
        let Some(mut rig) = Rig::<24, 12, 4, 1, 6, 24>::new(&world.0) else { return Ok(()) };
        let mut last = Time::from_micros(0);
        for f in &world.1 {
            rig.frame(f);
            last = f.now;
        }
        let before = rig.map.clone();
        let hold_us = (world.0.radar_3d.health.hold_s * 1e6).round() as u64;
        let now = Time::from_micros(late);
        let condition = rig.state.expire(&rig.parameters, now, &mut rig.map);
        let age = late.checked_sub(last.micros());
        if age.is_none_or(|age| age > hold_us) {
            prop_assert_eq!(condition, Condition::Stale);
            prop_assert!((0..12).all(|a| (0..24).all(|r| rig.map.cell(a, r).visibility == Visibility::Unknown)));
            rig.state.expire(&rig.parameters, last, &mut rig.map);
            prop_assert!((0..12).all(|a| (0..24).all(|r| rig.map.cell(a, r).visibility == Visibility::Unknown)));
        } else {
            prop_assert!(condition != Condition::Stale && rig.map == before);
        }
    }

    #[test]
    fn any_point_can_be_asked_for(world in worlds(6), points in proptest::collection::vec((any::<i32>(), any::<i32>()), 64)) {
        let Some(mut rig) = Rig::<24, 12, 4, 1, 6, 24>::new(&world.0) else { return Ok(()) };
        world.1.iter().for_each(|f| { rig.frame(f); });
        let range_cm = f64::from(world.0.sensor.field_of_view.range_max_m) * 100.0;
        let mount = world.0.sensor.mount;
        for (x_cm, y_cm) in points {
            // far away, and around the sensor
            let near = RoadPoint::new((mount.x_m * 100.0) as i32 + x_cm % 45_000, (mount.y_m * 100.0) as i32 + y_cm % 45_000);
            for p in [RoadPoint::new(x_cm, y_cm), near] {
                let away = (f64::from(p.x_cm) - f64::from(mount.x_m) * 100.0).hypot(f64::from(p.y_cm) - f64::from(mount.y_m) * 100.0);
                let known = rig.map.at(p).visibility != Visibility::Unknown;
                // a range cell may reach half its length beyond the limit
                prop_assert!(!known || away < range_cm * (1.0 + 1.0 / 24.0) + 300.0, "{:?}", p);
            }
        }
    }
}

/// A levelled point relative to the sensor, metres, as azimuth, elevation (degrees) and range.
fn seen(setup: &Setup, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let m = &setup.sensor.mount;
    let (sp, cp) = f64::from(m.pitch_deg).to_radians().sin_cos();
    let (sr, cr) = f64::from(m.roll_deg).to_radians().sin_cos();
    // nose down and left up undone, in that order
    let (x, z) = (cp * x - sp * z, sp * x + cp * z);
    let (y, z) = (cr * y + sr * z, -sr * y + cr * z);
    [y.atan2(x).to_degrees(), z.atan2(x.hypot(y)).to_degrees(), x.hypot(y).hypot(z)]
}

/// Whether this lies in the field of view, but for what whole centimetres and 2^-16 turns round off.
fn in_view(setup: &Setup, [azimuth, elevation, range]: [f64; 3]) -> bool {
    let v = &setup.sensor.field_of_view;
    // a centimetre to either side, and a twentieth of a degree
    let spare = 0.05 + (0.02 / range.max(0.02)).atan().to_degrees();
    let within = |value: f64, low: f32, high: f32, spare: f64| {
        value >= f64::from(low) - spare && value <= f64::from(high) + spare
    };
    within(azimuth, v.azimuth_min_deg, v.azimuth_max_deg, spare / elevation.to_radians().cos().max(0.01))
        && within(elevation, v.elevation_min_deg, v.elevation_max_deg, spare)
        && within(range, v.range_min_m, v.range_max_m, 0.05)
}

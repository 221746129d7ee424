//! A bad configuration is an error that names the parameter.

use proptest::prelude::*;
use viewshed::radar_2d::Radar2dParameters;
use viewshed::radar_3d::Radar3dParameters;
use viewshed::sensor::config::{ConfigError, Problem};

use crate::cases;
use crate::setup::{OF_BOTH, OF_RADAR_2D, OF_RADAR_3D, OF_SENSOR, Parameter, Setup, all, setups};

fn radar_3d(setup: &Setup) -> Result<(), ConfigError> {
    Radar3dParameters::<24, 12, 4>::new(&setup.sensor, &setup.radar_3d).map(|_| ())
}

fn radar_2d(setup: &Setup) -> Result<(), ConfigError> {
    Radar2dParameters::new::<208, 45, 64>(&setup.sensor, &setup.radar_2d).map(|_| ())
}

fn with(p: &Parameter, value: f32) -> Setup {
    let mut setup = Setup::default();
    (p.set)(&mut setup, value);
    setup
}

#[test]
fn what_lies_outside_its_limits_is_named_with_its_value() {
    let check = |parameters: &[Parameter], of: fn(&Setup) -> Result<(), ConfigError>| {
        for p in parameters {
            let [min, max] = p.limits;
            for value in [min - 1e-3 - min.abs() * 1e-3, max + max.abs() * 1e-3 + 1e-3, 1e30, -1e30] {
                let error = of(&with(p, value)).expect_err(p.name);
                assert_eq!((error.parameter, error.value), (p.name, value));
                assert!(matches!(error.problem, Problem::OutOfLimits { .. }), "{error}");
            }
            for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let error = of(&with(p, value)).expect_err(p.name);
                assert_eq!((error.parameter, error.problem), (p.name, Problem::NotFinite));
            }
        }
    };
    check(OF_SENSOR, radar_3d);
    check(OF_BOTH, radar_3d);
    check(OF_RADAR_3D, radar_3d);
    check(OF_SENSOR, radar_2d);
    check(OF_BOTH, radar_2d);
    check(OF_RADAR_2D, radar_2d);
}

#[test]
fn limits_the_wrong_way_round_are_named() {
    type Change = fn(&mut Setup);
    let cases: [(&str, Change); 5] = [
        ("field_of_view.azimuth_max_deg", |s| s.sensor.field_of_view.azimuth_min_deg = 61.0),
        ("field_of_view.elevation_max_deg", |s| s.sensor.field_of_view.elevation_min_deg = 17.0),
        ("field_of_view.range_max_m", |s| s.sensor.field_of_view.range_min_m = 201.0),
        ("gate.max_speed_mps", |s| {
            s.radar_3d.gate.max_speed_mps = 10.0;
            s.radar_3d.gate.min_speed_mps = 11.0;
        }),
        ("obstacles.max_evidence", |s| s.radar_3d.obstacles.confirm_hits = 13.0),
    ];
    for (name, reverse) in cases {
        let mut setup = Setup::default();
        reverse(&mut setup);
        let error = radar_3d(&setup).expect_err(name);
        assert_eq!(error.parameter, name);
        assert!(matches!(error.problem, Problem::NotAscending { .. }), "{error}");
    }
}

#[test]
fn a_field_of_view_that_never_meets_the_road_is_named() {
    let mut setup = Setup::default();
    setup.sensor.field_of_view.elevation_min_deg = 5.0;
    assert_eq!(radar_3d(&setup).unwrap_err().parameter, "field_of_view.elevation_min_deg");
}

#[test]
fn a_field_of_view_larger_than_the_flat_grid_is_named() {
    let mut setup = Setup::default();
    setup.sensor.field_of_view.range_max_m = 260.0;
    assert_eq!(radar_2d(&setup).unwrap_err().parameter, "field_of_view.range_max_m");
}

proptest! {
    #![proptest_config(cases(1000))]

    #[test]
    fn any_number_anywhere_is_taken_or_named(changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<f32>()), 1..4)) {
        let parameters: Vec<_> = all().collect();
        let mut setup = Setup::default();
        for (at, value) in &changes {
            (at.get(&parameters).set)(&mut setup, *value);
        }
        let [a, b] = [radar_3d(&setup), radar_2d(&setup)];
        for error in [a, b].into_iter().filter_map(Result::err) {
            let known = parameters.iter().any(|p| p.name == error.parameter);
            prop_assert!(known, "{error}");
        }
    }
}

proptest! {
    #![proptest_config(cases(100))]

    /// What a mount and a field of view do to each other is all that can be wrong within the limits.
    #[test]
    fn within_the_limits_only_geometry_is_refused(setup in setups()) {
        if let Err(error) = radar_3d(&setup) {
            prop_assert_eq!(error.parameter, "field_of_view.elevation_min_deg", "{}", error);
        }
        if let Err(error) = radar_2d(&setup) {
            prop_assert_eq!(error.parameter, "field_of_view.range_max_m", "{}", error);
        }
    }
}

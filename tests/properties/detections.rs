//! Measurements and placing: any number is refused or rounded, and everything is placed.

use proptest::prelude::*;
use viewshed::fixed::trig::{self, Direction};
use viewshed::frame::detection::{Detection, Measurement};
use viewshed::frame::reflection::Reflection;
use viewshed::sensor::road::RoadPoint;

use crate::cases;
use crate::setup::setups;
use crate::traffic::any_detection;

fn any_measurement() -> impl Strategy<Value = Measurement> {
    let number = || prop_oneof![any::<f32>(), -7.0..7.0_f32, -700.0..700.0_f32];
    (
        number(),
        number(),
        proptest::option::of(number()),
        number(),
        proptest::option::of(number()),
        proptest::option::of(number()),
    )
        .prop_map(|(range_m, azimuth_rad, elevation_rad, radial_velocity_mps, rcs_dbsm, snr_db)| Measurement {
            range_m,
            azimuth_rad,
            elevation_rad,
            radial_velocity_mps,
            rcs_dbsm,
            snr_db,
        })
}

proptest! {
    #![proptest_config(cases(5000))]

    #[test]
    fn a_measurement_is_refused_or_rounded_to_the_next_step(m in any_measurement()) {
        let Ok(d) = Detection::new(&m) else { return Ok(()) };
        let near = |got: f64, exact: f64, step: f64| (got - exact).abs() <= step * 0.5001 + exact.abs() * 1e-6;
        prop_assert!(near(f64::from(d.range_cm), f64::from(m.range_m) * 100.0, 1.0));
        prop_assert!(near(f64::from(d.radial_velocity_cm_s), f64::from(m.radial_velocity_mps) * 100.0, 1.0));
        let turns = |radians: f32| f64::from(radians) / std::f64::consts::TAU * 65536.0;
        let apart = (f64::from(d.azimuth.raw()) - turns(m.azimuth_rad)).rem_euclid(65536.0);
        prop_assert!(apart.min(65536.0 - apart) < 0.51, "{} {}", d.azimuth.raw(), m.azimuth_rad);
        prop_assert_eq!(d.elevation.is_some(), m.elevation_rad.is_some());
        if let (Some(got), Some(exact)) = (d.elevation, m.elevation_rad) {
            prop_assert!((f64::from(got.raw()) - turns(exact)).abs() < 0.51);
        }
    }

    #[test]
    fn any_vector_has_a_bearing_and_components(x in -131_071..131_072, y in -131_071..131_072, angle in any::<i16>(), far in any::<i32>()) {
        let d: Direction = trig::direction(viewshed::fixed::angle::Angle::from_raw(angle));
        let (cos, sin) = (f64::from(d.x) / 16384.0, f64::from(d.y) / 16384.0);
        let (x, y) = (f64::from(x), f64::from(y));
        prop_assert!((f64::from(d.along(x as i32, y as i32)) - (x * cos + y * sin)).abs() <= 1.0);
        prop_assert!((f64::from(d.across(x as i32, y as i32)) - (y * cos - x * sin)).abs() <= 1.0);
        let bearing = f64::from(trig::bearing(x as i32, y as i32).radians());
        let exact = if (x, y) == (0.0, 0.0) { 0.0 } else { y.atan2(x) };
        let apart = (bearing - exact).abs() % std::f64::consts::TAU;
        prop_assert!(apart.min(std::f64::consts::TAU - apart) < 3e-4, "{} {}", bearing, exact);
        // beyond what has a meaning nothing panics
        let _ = (d.along(far, far), d.across(far, i32::MIN), d.left(), d.reversed());
    }
}

proptest! {
    #![proptest_config(cases(200))]

    /// No field of view reaches beyond 400 m.
    #[test]
    fn a_detection_is_placed_no_farther_away_than_it_was_measured(setup in setups(), d in any_detection()) {
        let (noise, levelling) = (setup.sensor.noise.noise().unwrap(), setup.sensor.mount.levelling().unwrap());
        let d = Detection { range_cm: d.range_cm.min(40_000), ..d };
        let r = noise.place(&d, &levelling);
        prop_assert_eq!(noise.place_flat(&d, &levelling), Reflection { height_cm: None, ..r });
        let ground = f64::from(r.x_cm).hypot(f64::from(r.y_cm));
        // unit vectors are good to 2^-14 in every component
        prop_assert!(ground <= f64::from(d.range_cm) * 1.0005 + 2.0, "{} {:?}", ground, r);
        prop_assert!((f64::from(r.ground_cm) - ground.min(65_535.0)).abs() <= 3.0, "{} {:?}", ground, r);
        prop_assert_eq!(r.height_cm.is_some(), d.elevation.is_some());
        if let Some((height, _)) = r.height_cm {
            let off = (f64::from(height) - f64::from(levelling.height_cm)).abs();
            prop_assert!(off <= f64::from(d.range_cm) * 1.0005 + 2.0);
        }
    }

    #[test]
    fn a_road_point_comes_back_from_the_levelled_frame(setup in setups(), x in -30_000..30_000, y in -30_000..30_000) {
        let levelling = setup.sensor.mount.levelling().unwrap();
        let p = RoadPoint::new(levelling.origin().x_cm + x, levelling.origin().y_cm + y);
        let (ahead, left) = levelling.place(p);
        let near = levelling.place_near(p);
        prop_assert!((near.0 - ahead).abs() <= 1 && (near.1 - left).abs() <= 1, "{:?} {:?}", near, (ahead, left));
        let back = levelling.unplace(ahead, left);
        prop_assert!((back.x_cm - p.x_cm).abs() <= 6 && (back.y_cm - p.y_cm).abs() <= 6, "{:?} {:?}", back, p);
    }
}

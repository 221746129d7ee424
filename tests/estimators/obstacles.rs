//! The box of an obstacle that the radar has seen one end of.

use viewshed::fixed::trig::Direction;
use viewshed::frame::reflection::Reflection;
use viewshed::obstacles::config::ObstacleConfig;
use viewshed::obstacles::obstacle::Obstacle;
use viewshed::sensor::noise::NoiseConfig;

#[test]
fn what_was_not_seen_of_a_vehicle_lies_behind_the_face_that_was() {
    let noise = NoiseConfig::default().noise().unwrap();
    let tracking = ObstacleConfig::default().tracking(noise, Direction::AHEAD, 22_500).unwrap();
    let seed = Reflection {
        x_cm: 5_000,
        y_cm: 300,
        ground_cm: 5_009,
        sight: Direction::AHEAD,
        radial_velocity_cm_s: 0,
        across_cm: 40,
        height_cm: None,
        rcs_half_dbsm: None,
    };
    for heading in [Direction::AHEAD, Direction::AHEAD.reversed()] {
        let solid = Obstacle::new(&seed, heading, 2_500).solid(&tracking);
        // away from the sensor, whichever way it drives
        assert!(solid.x_cm > 5_100 && solid.x_cm - solid.half_length_cm > 4_950, "{heading:?}: {solid:?}");
        assert!((solid.y_cm - 300).abs() <= 2, "{solid:?}");
    }
}

//! A radar on a pole beside the road.

use viewshed::{FieldOfView, Mount, NoiseConfig, Sensor};

/// 5 m up, looking down by so much.
pub fn sensor(pitch_deg: f32) -> Sensor {
    Sensor {
        mount: Mount { x_m: 0.0, y_m: 0.0, height_m: 5.0, yaw_deg: 0.0, pitch_deg, roll_deg: 0.0 },
        field_of_view: FieldOfView {
            azimuth_min_deg: -45.0,
            azimuth_max_deg: 45.0,
            elevation_min_deg: -16.0,
            elevation_max_deg: 16.0,
            range_min_m: 1.0,
            range_max_m: 100.0,
        },
        noise: NoiseConfig::default(),
    }
}

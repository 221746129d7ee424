//! A recording's sensor as the library takes it.

use viewshed::sensor::Sensor;
use viewshed::sensor::field_of_view::FieldOfView;
use viewshed::sensor::mount::Mount;
use viewshed::sensor::noise::NoiseConfig;

use super::Recording;
use crate::geometry::pose::SensorPose;

/// The recording's sensor as the library takes it.
pub fn sensor(recording: &Recording, noise: &NoiseConfig) -> Sensor {
    let view = recording.sensor.field_of_view;
    let degrees = |v: f64| v.to_degrees() as f32;
    let mut mount = mount(&recording.pose);
    // above the road below it
    mount.height_m -= recording.ground.height(recording.pose.position[0]) as f32;
    Sensor {
        mount,
        field_of_view: FieldOfView {
            azimuth_min_deg: degrees(view.azimuth_rad[0]),
            azimuth_max_deg: degrees(view.azimuth_rad[1]),
            elevation_min_deg: degrees(view.elevation_rad[0]),
            elevation_max_deg: degrees(view.elevation_rad[1]),
            range_min_m: view.range_m[0] as f32,
            range_max_m: view.range_m[1] as f32,
        },
        noise: *noise,
    }
}

/// Where a sensor hangs, as the library takes it.
pub fn mount(pose: &SensorPose) -> Mount {
    let [x, y, z] = pose.position;
    Mount {
        x_m: x as f32,
        y_m: y as f32,
        height_m: z as f32,
        yaw_deg: pose.yaw_rad().to_degrees() as f32,
        pitch_deg: pose.pitch_rad().to_degrees() as f32,
        roll_deg: pose.roll_rad().to_degrees() as f32,
    }
}

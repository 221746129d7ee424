//! The part of the road that pictures of a recording show.

use crate::geometry::pose::SensorPose;
use crate::geometry::solid::Solid;
use crate::recording::{FieldOfView, Recording};
use crate::results::pictures::scene::Window;

/// Everything labelled inside the field of view, and the sensor; without labels the detections, or the whole field of
/// view where they show little of it.
pub fn window(recording: &Recording) -> Window {
    let inside = |p: [f64; 3]| recording.sensor.field_of_view.contains(recording.pose.to_spherical(p));
    let sensor = [recording.pose.position[0], recording.pose.position[1]];
    let solids = recording.truth.iter().flat_map(|t| t.solids());
    let mut places = Places { sensor, count: 0, reach_m: 0.0, ends: [sensor; 2] };
    solids.filter(|s: &&Solid| inside(s.center)).for_each(|s| places.add([s.center[0], s.center[1]]));
    if places.count == 0 {
        recording.all().each(&mut |frame| {
            let placed = frame.detections.iter().map(|d| d.road_position(&recording.pose, 1.0));
            placed.filter(|p| inside(*p)).for_each(|p| places.add([p[0], p[1]]));
        });
    }
    let view = &recording.sensor.field_of_view;
    // with the sensor's own place
    if places.count + 1 < LITTLE || places.reach_m < 0.5 * view.range_m[1] {
        corners(&recording.pose, view).for_each(|corner| places.add(corner));
    }
    Window::around(places.ends, 6.0)
}

/// Places around a sensor.
struct Places {
    sensor: [f64; 2],
    count: usize,
    /// Of the farthest.
    reach_m: f64,
    /// The least and the greatest of each coordinate, the sensor's among them.
    ends: [[f64; 2]; 2],
}

impl Places {
    fn add(&mut self, place: [f64; 2]) {
        self.count += 1;
        self.reach_m = self.reach_m.max((place[0] - self.sensor[0]).hypot(place[1] - self.sensor[1]));
        let [low, high] = &mut self.ends;
        for (k, v) in place.into_iter().enumerate() {
            (low[k], high[k]) = (low[k].min(v), high[k].max(v));
        }
    }
}

/// Fewer places than this, of a whole recording, do not show where the road is.
const LITTLE: usize = 100;

/// Ends of the field of view on the road: to the right, ahead and to the left.
fn corners(pose: &SensorPose, view: &FieldOfView) -> impl Iterator<Item = [f64; 2]> {
    let [right, left] = view.azimuth_rad;
    let far = view.range_m[1];
    (0..=8).map(move |k| right + (left - right) * f64::from(k) / 8.0).map(move |azimuth| {
        let heading = pose.yaw_rad() + azimuth;
        [pose.position[0] + far * heading.cos(), pose.position[1] + far * heading.sin()]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up;
    use crate::recording::RadarDetection;

    #[test]
    fn where_little_was_detected_the_whole_field_of_view_is_shown() {
        let detection = |range_m: f32| RadarDetection {
            range_m,
            azimuth_rad: 0.0,
            elevation_rad: None,
            radial_velocity_mps: 0.0,
            rcs_dbsm: None,
            snr_db: None,
        };
        let seen = |detections: Vec<RadarDetection>| {
            let mut recording = made_up::recording(1, 0);
            (recording.truth, recording.frames[0].detections) = (None, detections);
            window(&recording)
        };
        // 1 rad to each side of 200 m
        for little in [vec![], vec![detection(30.0); 3], vec![detection(30.0); 500]] {
            let all = seen(little);
            assert!(all.x_m[1] >= 200.0 && all.y_m[0] <= -168.0 && all.y_m[1] >= 168.0, "{all:?}");
        }
        let road = seen((0..500).map(|k| detection(20.0 + 0.3 * k as f32)).collect());
        assert!(road.x_m[1] < 190.0 && road.y_m[1] <= 10.0, "{road:?}");
    }
}

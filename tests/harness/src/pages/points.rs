//! Every detection of a recording as plots take it: bytes in the order of the browser's typed arrays.
//!
//! # Model
//! Little endian: the number of detections as u32, then one array after the other, each of four bytes a detection:
//! frame (u32), x and y in the road frame in metres, radial velocity in m/s, RCS in dBsm (f32; NaN where not
//! measured). Detections are in the order of time.

use serde::Serialize;

use crate::labels::Site;
use crate::recording::Recording;

/// Height above the road at which a radar without elevation is taken to have measured, metres.
const HEIGHT_M: f64 = 1.0;

/// What the page is told of a recording before the points.
#[derive(Debug, Serialize)]
pub struct Description {
    name: String,
    sensor: String,
    /// Seconds since the first frame.
    frame_times_s: Vec<f64>,
    points: usize,
    /// Road frame: x, y, height in metres, heading in radians.
    mount: [f64; 4],
    azimuth_rad: [f64; 2],
    range_m: [f64; 2],
    /// Single frames without continuity.
    frames_independent: bool,
    has_camera: bool,
    /// What was wrong with the input.
    problems: Vec<String>,
}

impl Description {
    pub fn of(recording: &Recording, has_camera: bool) -> Self {
        let Site { start_ns, .. } = Site::of(recording);
        let view = recording.sensor.field_of_view;
        let [x, y, height] = recording.pose.position;
        Self {
            name: recording.name.clone(),
            sensor: recording.sensor.name.clone(),
            frame_times_s: recording.frames.iter().map(|f| f.time_ns.saturating_sub(start_ns) as f64 * 1e-9).collect(),
            points: recording.frames.iter().map(|f| f.detections.len()).sum(),
            mount: [x, y, height, recording.pose.yaw_rad()],
            azimuth_rad: view.azimuth_rad,
            range_m: view.range_m,
            frames_independent: recording.sensor.frames_independent,
            has_camera,
            problems: recording.problems.iter().map(|p| p.since(start_ns)).collect(),
        }
    }
}

/// The detections of all frames.
pub fn bytes(recording: &Recording) -> Vec<u8> {
    let (mut frames, mut values) = (Vec::new(), [const { Vec::new() }; 4]);
    for (k, frame) in recording.frames.iter().enumerate() {
        for d in &frame.detections {
            let [x, y, _] = d.road_position(&recording.pose, HEIGHT_M);
            frames.extend((k as u32).to_le_bytes());
            let of_one = [x as f32, y as f32, d.radial_velocity_mps, d.rcs_dbsm.unwrap_or(f32::NAN)];
            values.iter_mut().zip(of_one).for_each(|(array, value)| array.extend(value.to_le_bytes()));
        }
    }
    let count = (frames.len() / 4) as u32;
    [&count.to_le_bytes()[..], &frames].into_iter().chain(values.iter().map(Vec::as_slice)).collect::<Vec<_>>().concat()
}

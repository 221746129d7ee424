//! A recording as scans for a controller.

use viewshed::bench::job::{Job, JobEntry, ScanHead};
use viewshed::camera::boxes::{ImageBox, VehicleClass};
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::sensor::field_of_view::FieldOfView;
use viewshed::unit::settings::Settings;

use crate::estimators::{Intake, camera_3d};
use crate::recording::Recording;
use crate::recording::camera::{Box2d, CameraFrame, RecordedCamera};

/// One scan as the library takes it.
#[derive(Debug, Clone)]
pub struct Scan<T = Detection> {
    pub time: Time,
    /// Forget everything first.
    pub reset: bool,
    pub detections: Vec<T>,
}

/// Every frame of a recording; what cannot be turned into a detection is left out, as in a replay.
pub fn of(recording: &Recording) -> Vec<Scan> {
    let mut intake = Intake::default();
    let reset = recording.sensor.frames_independent;
    let scan = |frame| {
        // the format they are sent in holds detections only
        let (time, detections, _) = intake.take(frame);
        Scan { time, reset, detections: detections.to_vec() }
    };
    recording.frames.iter().map(scan).collect()
}

/// Every picture of a camera; boxes of what is no vehicle are left out, as in a replay.
pub fn of_camera(camera: &RecordedCamera) -> Vec<Scan<ImageBox>> {
    let size_px = camera.intrinsics.for_library().size_px;
    let boxed = |b: &Box2d| ImageBox::of_picture(b.edges.map(|v| v as f32), size_px, VehicleClass::named(&b.class)?);
    let scan = |f: &CameraFrame| Scan {
        time: camera_3d::time(f.time_ns),
        reset: false,
        detections: f.boxes.iter().filter_map(boxed).collect(),
    };
    camera.frames.iter().map(scan).collect()
}

/// What an integrator would set for a camera: its mount, and where its picture ends.
pub fn camera_settings(camera: &RecordedCamera) -> Settings {
    let i = &camera.intrinsics;
    let degrees = |pixel| i.tangents(pixel).map(|tangent| tangent.atan().to_degrees() as f32);
    let ([left, up], [right, down]) = (degrees([0.0; 2]), degrees(i.size_px.map(f64::from)));
    let field_of_view = FieldOfView {
        azimuth_min_deg: right,
        azimuth_max_deg: left,
        elevation_min_deg: down,
        elevation_max_deg: up,
        range_min_m: 0.0,
        range_max_m: 200.0,
    };
    Settings::of_camera(camera_3d::calibration(camera).mount, field_of_view)
}

/// The job as bytes.
pub fn job<T: JobEntry>(settings: &Settings, scans: &[Scan<T>], dump: Option<u32>) -> Vec<u8> {
    let mut bytes = Job { settings: *settings, dump }.to_bytes().to_vec();
    for scan in scans {
        let detections = u16::try_from(scan.detections.len()).unwrap_or(u16::MAX);
        bytes.extend(ScanHead { time: scan.time, detections, fault: false, reset: scan.reset }.to_bytes());
        bytes.extend(scan.detections.iter().take(usize::from(detections)).flat_map(T::to_bytes));
    }
    bytes
}

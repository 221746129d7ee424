//! A recording as scans for a controller.

use viewshed::bench::job::{Job, ScanHead, detection_to_bytes};
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::unit::settings::Settings;

use crate::estimators::Intake;
use crate::recording::Recording;

/// One scan as the library takes it.
#[derive(Debug, Clone)]
pub struct Scan {
    pub time: Time,
    /// Forget everything first.
    pub reset: bool,
    pub detections: Vec<Detection>,
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

/// The job as bytes.
pub fn job(settings: &Settings, scans: &[Scan], dump: Option<u32>) -> Vec<u8> {
    let mut bytes = Job { settings: *settings, dump }.to_bytes().to_vec();
    for scan in scans {
        let detections = u16::try_from(scan.detections.len()).unwrap_or(u16::MAX);
        bytes.extend(ScanHead { time: scan.time, detections, fault: false, reset: scan.reset }.to_bytes());
        bytes.extend(scan.detections.iter().take(usize::from(detections)).flat_map(detection_to_bytes));
    }
    bytes
}

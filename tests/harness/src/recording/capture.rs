//! Raw captures: what they do not say of their sensor is assumed, and reported.

use std::collections::BTreeMap;

use super::problems::Problems;
use super::{FieldOfView, Frame, RadarDetection, ReadOptions, Recording, Sensor};
use crate::geometry::ground::Ground;
use crate::geometry::pose::SensorPose;
use viewshed::frame::detection::Detection;
use viewshed::frame::gate::GateConfig;

/// Height of a mount that is not given, metres: a usual pole or gantry.
const HEIGHT_M: f64 = 6.0;

/// A kind of radar, as its data sheet has it.
pub struct Kind {
    pub name: String,
    pub azimuth_deg: f64,
    pub elevation_deg: f64,
    pub range_m: [f64; 2],
    pub has_elevation: bool,
}

/// A recording of a raw capture's frames. Mount and field of view that are not given are assumed and reported.
pub fn recording(name: String, kind: Kind, frames: Vec<Frame>, problems: Problems, options: &ReadOptions) -> Recording {
    let start = frames.first().map_or(0, |f| f.time_ns);
    Recording { frames, ..without_frames(name, kind, start, problems, options) }
}

/// The same without its frames, of which the first has this time.
pub fn without_frames(
    name: String,
    kind: Kind,
    start: i64,
    mut problems: Problems,
    options: &ReadOptions,
) -> Recording {
    let pose = match options.mount {
        Some([x, y, z, yaw, pitch, roll]) => SensorPose::new([x, y, z], yaw, pitch, roll),
        None => {
            let what = format!("a raw capture has no mount: {HEIGHT_M} m high and level assumed; give it with --mount");
            problems.add("capture", what, start);
            SensorPose::new([0.0, 0.0, HEIGHT_M], 0.0, 0.0, 0.0)
        }
    };
    let field_of_view = options.field_of_view.unwrap_or_else(|| {
        let (azimuth, elevation, [near, far]) = (kind.azimuth_deg, kind.elevation_deg, kind.range_m);
        let what = format!(
            "a raw capture has no field of view: +-{azimuth} and +-{elevation} degrees, {near} to {far} m assumed; give it with --fov"
        );
        problems.add("capture", what, start);
        FieldOfView {
            azimuth_rad: [-azimuth.to_radians(), azimuth.to_radians()],
            elevation_rad: [-elevation.to_radians(), elevation.to_radians()],
            range_m: kind.range_m,
        }
    });
    let sensor = Sensor {
        name: kind.name,
        field_of_view,
        has_elevation: kind.has_elevation,
        frames_independent: false,
        platform_moving: false,
        synthetic: false,
        licence: None,
    };
    Recording {
        name,
        sensor,
        pose,
        frames: Vec::new(),
        scans: None,
        ground: Ground::default(),
        truth: None,
        occlusion: BTreeMap::new(),
        camera: None,
        problems,
    }
}

/// Values below these are of points too weak to be taken, in dB and dBsm: a number that a field is left at is often one.
pub fn weak() -> [f32; 2] {
    let gate = GateConfig::default();
    [gate.min_snr_db, gate.min_rcs_dbsm]
}

/// The library's detection as recordings have it.
pub fn detection(d: &Detection) -> RadarDetection {
    RadarDetection {
        range_m: f32::from(d.range_cm) / 100.0,
        azimuth_rad: d.azimuth.radians(),
        elevation_rad: d.elevation.map(|e| e.radians()),
        radial_velocity_mps: f32::from(d.radial_velocity_cm_s) / 100.0,
        rcs_dbsm: d.rcs_half_dbsm.map(|r| f32::from(r) / 2.0),
        snr_db: d.snr_half_db.map(|s| f32::from(s) / 2.0),
    }
}

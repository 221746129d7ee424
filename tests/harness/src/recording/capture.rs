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
pub fn recording(
    name: String,
    kind: Kind,
    mut frames: Vec<Frame>,
    mut problems: Problems,
    options: &ReadOptions,
) -> Recording {
    let start = frames.first().map_or(0, |f| f.time_ns);
    not_filled(&mut frames, &mut problems);
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
        frames,
        ground: Ground::default(),
        truth: None,
        occlusion: BTreeMap::new(),
        camera: None,
        problems,
    }
}

/// Points that tell that a value never changes.
const TELLING: usize = 50;

/// Values below these are of points too weak to be taken, in dB and dBsm: a number that a field is left at is often one.
pub fn weak() -> [f32; 2] {
    let gate = GateConfig::default();
    [gate.min_snr_db, gate.min_rcs_dbsm]
}

/// A value of a detection that a radar may leave unmeasured: its name, its unit, the least that is not weak.
type Value = (&'static str, &'static str, f32, fn(&mut RadarDetection) -> &mut Option<f32>);

/// Where all points would be too weak by a value that never changes, it was not measured: firmware and gateways that do not
/// fill a field leave one number in it.
fn not_filled(frames: &mut [Frame], problems: &mut Problems) {
    let [snr, rcs] = weak();
    let values: [Value; 2] =
        [("signal-to-noise ratio", "dB", snr, |d| &mut d.snr_db), ("RCS", "dBsm", rcs, |d| &mut d.rcs_dbsm)];
    for (name, unit, weak, value) in values {
        let mut points = frames.iter_mut().flat_map(|frame| &mut frame.detections);
        let Some(Some(first)) = points.next().map(|d| *value(d)).filter(|v| v.is_some_and(|v| v < weak)) else {
            continue;
        };
        let mut count = 1;
        let same = points.all(|d| {
            count += 1;
            *value(d) == Some(first)
        });
        if same && count >= TELLING {
            let start = frames.first().map_or(0, |frame| frame.time_ns);
            let what = format!("the {name} of all points is {first} {unit}: not filled, so taken as not measured");
            problems.add_many("capture", what, start, count as u64);
            frames.iter_mut().flat_map(|frame| &mut frame.detections).for_each(|d| *value(d) = None);
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_never_changes_is_not_measured() {
        let point = |snr_db, rcs_dbsm| RadarDetection {
            range_m: 20.0,
            azimuth_rad: 0.0,
            elevation_rad: None,
            radial_velocity_mps: 1.0,
            rcs_dbsm,
            snr_db,
        };
        let told = |values: &dyn Fn(usize) -> (Option<f32>, Option<f32>), points: usize| {
            let frame = |k: usize| {
                let (snr, rcs) = values(k);
                Frame { time_ns: k as i64, detections: vec![point(snr, rcs)], refused: 0, fault: false }
            };
            let mut frames: Vec<Frame> = (0..points).map(frame).collect();
            let mut problems = Problems::default();
            not_filled(&mut frames, &mut problems);
            let left = frames.iter().map(|f| f.detections[0]).next().unwrap();
            (problems.count("not filled"), left.snr_db, left.rcs_dbsm)
        };
        for constant in [0.0, -64.0, 2.0] {
            assert_eq!(told(&|_| (Some(constant), None), 60), (60, None, None));
        }
        assert_eq!(told(&|k| (Some(k as f32), Some(-64.0)), 60), (60, Some(0.0), None));
        let zero = Some(0.0);
        assert_eq!(told(&|_| (Some(20.0), zero), 60), (0, Some(20.0), zero), "what is not weak does no harm");
        assert_eq!(told(&|k| (Some(f32::from(u8::from(k == 40))), None), 60), (0, zero, None), "one that differs");
        assert_eq!(told(&|_| (zero, zero), 20), (0, zero, zero), "too few to tell");
        assert_eq!(told(&|k| (zero.filter(|_| k != 30), None), 60), (0, zero, None), "one without it");
    }
}

//! Scans nobody should send, to know what a frame costs at most.

use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;

use super::scans::Scan;

/// Frames of each scene.
const FRAMES: u64 = 45;
const FRAME_US: u64 = 66_667;

/// A scene of 256 detections a frame that fit the field of view, with speeds of their own, so that
/// few join: along one ray, one a ray, or new ones everywhere in every frame.
pub const SCENES: [&str; 3] = ["one-ray", "all-rays", "everywhere"];

/// All frames of a scene.
pub fn scans(scene: &str) -> Vec<Scan> {
    let scan = |k| Scan { time: Time::from_micros(k * FRAME_US), reset: false, detections: detections(scene, k) };
    (0..FRAMES).map(scan).collect()
}

fn detections(scene: &str, frame: u64) -> Vec<Detection> {
    let mut seed = if scene == "everywhere" { frame + 1 } else { 1 };
    let mut random = |range: std::ops::Range<i32>| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        range.start + ((seed >> 33) % (range.end - range.start) as u64) as i32
    };
    (0..256)
        .map(|i| {
            let (range_cm, azimuth) = match scene {
                "one-ray" => (2000 + 69 * i, 500),
                "all-rays" => (6000, -10_000 + 78 * i),
                _ => (random(1500..19_900), random(-10_500..10_500)),
            };
            Detection {
                range_cm: range_cm as u16,
                azimuth: Angle::from_raw(azimuth as i16),
                elevation: Some(Angle::from_raw(random(-1500..200) as i16)),
                radial_velocity_cm_s: random(-3000..3000) as i16,
                rcs_half_dbsm: Some(20),
                snr_half_db: Some(60),
            }
        })
        .collect()
}

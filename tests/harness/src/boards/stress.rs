//! Scans nobody should send, to know what a frame costs at most.

use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;

use super::scans::Scan;

/// Frames of each scene.
const FRAMES: u64 = 45;
const FRAME_US: u64 = 66_667;

/// Frames before those in which a crowd stands until it is learnt as fixtures (half a minute, and time to find all of it), as far
/// apart as frames of one scene may be.
const LEARNING: u64 = 70;
const LEARNING_US: u64 = 900_000;

/// A scene of 256 detections a frame that fit the field of view. With speeds of their own, so that few join: along one ray,
/// one a ray, or new ones everywhere in every frame; and those of a crowd of which every second one stands and is learnt.
pub const SCENES: [&str; 4] = ["one-ray", "all-rays", "everywhere", CROWD];

const CROWD: &str = "crowd";

/// All frames of a scene.
pub fn scans(scene: &str) -> Vec<Scan> {
    let learning = if scene == CROWD { LEARNING } else { 0 };
    let time = |k: u64| Time::from_micros(k.min(learning) * LEARNING_US + k.saturating_sub(learning) * FRAME_US);
    let scan = |k| Scan { time: time(k), reset: false, detections: detections(scene, k) };
    (0..learning + FRAMES).map(scan).collect()
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
                // too far from each other to be one fixture
                CROWD => (5000 + 200 * (i / 2 % 4), -10_000 + 78 * i),
                _ => (random(1500..19_900), random(-10_500..10_500)),
            };
            let elevation = Some(Angle::from_raw(random(-1500..200) as i16));
            let speed = random(-3000..3000) as i16;
            Detection {
                range_cm: range_cm as u16,
                azimuth: Angle::from_raw(azimuth as i16),
                elevation,
                radial_velocity_cm_s: if scene == CROWD && i % 2 == 0 { 0 } else { speed },
                rcs_half_dbsm: Some(20),
                snr_half_db: Some(60),
                marked: false,
            }
        })
        .collect()
}

//! What a recording says that contradicts itself: a velocity's sign, and a mount, that its own detections deny.
//!
//! # Method
//! A detection that moves is paired with detections of a later frame that have its radial velocity and lie where it
//! would lie by then: `velocity * time` farther away. Pairs are formed by chance, too, so what is asked is what most
//! pairs agree on.
//!
//! - *Sign*: over one frame, pairs with the velocity as it stands against pairs with its opposite.
//! - *Yaw*: over [`PAUSE_S`], the direction in the road frame from one to the other. Traffic runs along the road's axis,
//!   or across it, so the direction most pairs have is a multiple of 90 degrees.
//! - *Height and pitch*: the median height above the road of what moves, over its distance. By a height that is wrong
//!   it is off everywhere, by a pitch that is wrong the more the farther.

use super::problems::Problems;
use super::{Frame, RadarDetection, Recording};
use crate::geometry::pose::SensorPose;

/// What is slower tells no direction, m/s.
const LEAST_SPEED_MPS: f32 = 5.0;

/// Time between the detections of a pair, seconds.
const PAUSE_S: f64 = 1.0;

/// Frames that are looked at, spread over the recording.
const MOST_FRAMES: usize = 300;

/// Median height of a vehicle's reflections above the road, metres.
const USUAL_HEIGHT_M: f64 = 0.9;

/// What is farther off is named: degrees and metres.
const YAW_DEG: f64 = 1.5;
const PITCH_DEG: f64 = 0.8;
const HEIGHT_M: f64 = 0.6;

/// A direction farther off is another road.
const MOST_YAW_DEG: f64 = 6.0;

const TOPIC: &str = "mount";

/// By how much a mount as given is more than what the detections say; `None` where they say nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MountError {
    pub yaw_deg: Option<f64>,
    /// Pitch in degrees and height in metres.
    pub pitch_and_height: Option<(f64, f64)>,
}

/// Adds what contradicts itself to a recording's problems.
pub fn check(recording: &mut Recording) {
    if recording.sensor.platform_moving || recording.sensor.frames_independent {
        return;
    }
    let start = recording.frames.first().map_or(0, |f| f.time_ns);
    let add = |problems: &mut Problems, what: String| problems.add(TOPIC, what, start);
    let (as_it_stands, reversed) = signs(&recording.frames);
    if reversed > 100 && reversed > 2 * as_it_stands {
        let what = format!(
            "velocities have the wrong sign, by how ranges change ({reversed} pairs against {as_it_stands}): + is receding; turn them with --velocity-sign approaching"
        );
        add(&mut recording.problems, what);
        return;
    }
    let error = mount_error(&recording.frames, &recording.pose);
    if let Some(yaw) = error.yaw_deg.filter(|yaw| yaw.abs() >= YAW_DEG) {
        add(
            &mut recording.problems,
            told(
                "yaw",
                yaw,
                "degrees",
                recording.pose.yaw_rad().to_degrees(),
                "traffic does not run along the road's axis",
            ),
        );
    }
    // on a road that is known not to be flat both follow the road
    let flat = recording.truth.as_ref().is_none_or(|truth| truth.ground.is_level());
    if let Some((pitch, height)) = error.pitch_and_height.filter(|_| flat) {
        if pitch.abs() >= PITCH_DEG {
            add(
                &mut recording.problems,
                told(
                    "pitch",
                    pitch,
                    "degrees",
                    recording.pose.pitch_rad().to_degrees(),
                    "what moves does not stay on the road with distance",
                ),
            );
        }
        // a pitch that is wrong takes the height with it
        if height.abs() >= HEIGHT_M && pitch.abs() < PITCH_DEG {
            add(
                &mut recording.problems,
                told("height", height, "m", recording.pose.position[2], "what moves is not on the road"),
            );
        }
    }
}

fn told(what: &str, error: f64, unit: &str, given: f64, why: &str) -> String {
    let word = if error > 0.0 { "large" } else { "small" };
    format!("{why}: {what} {given:.1} {unit} seems {:.1} too {word}; --mount sets it", error.abs())
}

/// Pairs of neighbouring frames that agree with the velocities as they stand, and with their opposites.
pub fn signs(frames: &[Frame]) -> (usize, usize) {
    let (mut as_it_stands, mut reversed) = (0, 0);
    for pair in spread(frames.windows(2)) {
        let [before, after] = pair else { continue };
        let passed = seconds(before, after);
        if !(0.01..=0.5).contains(&passed) {
            continue;
        }
        for d in before.detections.iter().filter(|d| f64::from(d.radial_velocity_mps.abs()) * passed >= 0.5) {
            let found = |sign: f64| {
                let range = f64::from(d.range_m) + sign * f64::from(d.radial_velocity_mps) * passed;
                after.detections.iter().any(|a| {
                    (f64::from(a.range_m) - range).abs() < 0.25
                        && (a.azimuth_rad - d.azimuth_rad).abs() < 0.015
                        && (a.radial_velocity_mps - d.radial_velocity_mps).abs() < 0.5
                })
            };
            match (found(1.0), found(-1.0)) {
                (true, false) => as_it_stands += 1,
                (false, true) => reversed += 1,
                _ => {}
            }
        }
    }
    (as_it_stands, reversed)
}

/// By how much the mount is off.
pub fn mount_error(frames: &[Frame], pose: &SensorPose) -> MountError {
    MountError { yaw_deg: yaw_error(frames, pose), pitch_and_height: pitch_and_height(frames, pose) }
}

fn yaw_error(frames: &[Frame], pose: &SensorPose) -> Option<f64> {
    let mut directions = Vec::new();
    for (k, before) in spread(frames.iter().enumerate()) {
        let Some(after) = frames[k..].iter().find(|after| seconds(before, after) >= PAUSE_S) else { break };
        let passed = seconds(before, after);
        if passed > 1.3 * PAUSE_S {
            continue;
        }
        for d in before.detections.iter().filter(|d| d.radial_velocity_mps.abs() >= LEAST_SPEED_MPS) {
            let from = d.road_position(pose, USUAL_HEIGHT_M);
            for a in &after.detections {
                let range =
                    f64::from(d.range_m) + passed * f64::from(d.radial_velocity_mps + a.radial_velocity_mps) / 2.0;
                if (a.radial_velocity_mps - d.radial_velocity_mps).abs() > 1.0
                    || (f64::from(a.range_m) - range).abs() > 1.0
                {
                    continue;
                }
                let to = a.road_position(pose, USUAL_HEIGHT_M);
                let (x, y) = (to[0] - from[0], to[1] - from[1]);
                // across the line of sight everything fits
                if y.hypot(x) < 2.0 * passed * f64::from(d.radial_velocity_mps.abs()) {
                    directions.push((y.atan2(x).to_degrees() + 45.0).rem_euclid(90.0) - 45.0);
                }
            }
        }
    }
    directions.sort_by(f64::total_cmp);
    let within = |middle: f64, half: f64| {
        let start = directions.partition_point(|d| *d < middle - half);
        &directions[start..directions.partition_point(|d| *d <= middle + half)]
    };
    let steps = (0..=180).map(|step| -45.0 + 0.5 * f64::from(step));
    let most = steps.max_by_key(|middle| within(*middle, 1.5).len())?;
    let near = within(most, 2.5);
    // where roads bend or cross at any angle no direction stands out from those beside it, nor from chance
    let stands_out = 100 * within(most, 1.5).len() >= 42 * within(most, 4.0).len();
    let agreed = near.len() >= 300 && 3 * near.len() >= within(most, 15.0).len();
    (stands_out && agreed && most.abs() <= MOST_YAW_DEG).then(|| near.iter().sum::<f64>() / near.len() as f64)
}

fn pitch_and_height(frames: &[Frame], pose: &SensorPose) -> Option<(f64, f64)> {
    const BIN_M: f64 = 10.0;
    let mut heights: Vec<Vec<f64>> = vec![Vec::new(); 16];
    let moves = |d: &&RadarDetection| d.radial_velocity_mps.abs() >= LEAST_SPEED_MPS && d.elevation_rad.is_some();
    for frame in spread(frames.iter()) {
        for d in frame.detections.iter().filter(moves) {
            let bin = (f64::from(d.range_m) / BIN_M) as usize;
            if let Some(bin) = heights.get_mut(bin) {
                bin.push(d.road_position(pose, USUAL_HEIGHT_M)[2]);
            }
        }
    }
    // a line through the medians of the distances that have enough
    let medians: Vec<(f64, f64)> = heights
        .iter_mut()
        .enumerate()
        .filter(|(_, heights)| heights.len() >= 200)
        .map(|(k, heights)| {
            heights.sort_by(f64::total_cmp);
            ((k as f64 + 0.5) * BIN_M, heights[heights.len() / 2])
        })
        .collect();
    let n = medians.len() as f64;
    let span = medians.last()?.0 - medians.first()?.0;
    if n < 4.0 || span < 40.0 {
        return None;
    }
    let mean = |of: fn(&(f64, f64)) -> f64| medians.iter().map(of).sum::<f64>() / n;
    let (r, z) = (mean(|m| m.0), mean(|m| m.1));
    let slope = medians.iter().map(|m| (m.0 - r) * (m.1 - z)).sum::<f64>()
        / medians.iter().map(|m| (m.0 - r).powi(2)).sum::<f64>();
    Some((-slope.atan().to_degrees(), z - slope * r - USUAL_HEIGHT_M))
}

/// Every so manieth, so that there are not more than [`MOST_FRAMES`].
fn spread<I: ExactSizeIterator>(all: I) -> impl Iterator<Item = I::Item> {
    let step = all.len().div_ceil(MOST_FRAMES).max(1);
    all.step_by(step)
}

fn seconds(before: &Frame, after: &Frame) -> f64 {
    after.time_ns.saturating_sub(before.time_ns) as f64 * 1e-9
}

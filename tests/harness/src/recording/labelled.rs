//! Labels that contradict the recording: mirrored, late, elsewhere, one id for several objects.
//!
//! # Method
//! A detection that moves fits a labelled object if it lies in its box, and has its velocity along the line of sight. What
//! is asked is how many fit the labels as they are, and how many fit them mirrored, turned, or at another time. What stands
//! tells nothing, and a queue little: the time is judged by what drives.

use super::frames::{Extent, Frames, spread};
use super::problems::Problems;
use super::{Frame, RadarDetection, Recording};
use crate::geometry::solid::Solid;
use crate::recording::truth::Truth;

/// Frames that are looked at, spread over the recording.
const MOST_FRAMES: usize = 120;

/// What is slower along the line of sight tells nothing, m/s.
const LEAST_SPEED_MPS: f64 = 3.0;

/// How far outside of its box a detection of an object may lie, metres, and its velocity be off, m/s.
const AROUND_M: f64 = 0.7;
const OFF_MPS: f64 = 1.5;

/// Detections that fit before something is said.
const LEAST_FITS: usize = 100;

/// Times that labels are tried at: steps of a tenth of a second, to both sides.
const STEP_NS: i64 = 100_000_000;
const STEPS: i64 = 15;

/// Fewer steps off are a driver's delay, or rounding.
const LEAST_STEPS: i64 = 3;

/// Nothing on a road moves faster, m/s.
const FASTEST_MPS: f64 = 100.0;

const TOPIC: &str = "labels";

/// Adds what contradicts itself to a recording's problems.
pub fn check(recording: &mut Recording, frames: &dyn Frames, extent: &Extent) {
    let Some(truth) = recording.truth.take() else { return };
    let start_ns = extent.first_ns;
    note_jumps(&truth, &mut recording.problems);
    let is_apart = recording.sensor.platform_moving || recording.sensor.frames_independent;
    let some = || spread(frames, extent.frames, MOST_FRAMES);
    let what = if is_apart { None } else { misplaced(recording, &truth, &some()) };
    if let Some(what) = what {
        recording.problems.add(TOPIC, what, start_ns);
    }
    recording.truth = Some(truth);
}

/// Objects that are faster than anything on a road between two labels.
fn note_jumps(truth: &Truth, problems: &mut Problems) {
    for (time_ns, _) in truth.tracks.iter().flat_map(|t| t.steps()).filter(|(_, speed)| *speed > FASTEST_MPS) {
        let what =
            "object moves faster than 100 m/s between two labels: one id of several objects, or rows of another place";
        problems.add(TOPIC, what, time_ns);
    }
}

/// A detection that moves: when, where in the road frame, the direction it is seen in, how fast along that.
struct Moving {
    time_ns: i64,
    place: [f64; 2],
    direction: [f64; 2],
    velocity: f64,
}

/// What of the labels' places or times the detections deny.
fn misplaced(recording: &Recording, truth: &Truth, frames: &[Frame]) -> Option<String> {
    let [x, y, _] = recording.pose.position;
    let moves = |d: &&RadarDetection| f64::from(d.radial_velocity_mps.abs()) >= LEAST_SPEED_MPS;
    let frames: Vec<Vec<Moving>> = frames
        .iter()
        .map(|frame| {
            let moving = |d: &RadarDetection| {
                let [px, py, _] = d.road_position(&recording.pose, 0.9);
                let away = (px - x).hypot(py - y).max(0.1);
                Moving {
                    time_ns: frame.time_ns,
                    place: [px, py],
                    direction: [(px - x) / away, (py - y) / away],
                    velocity: d.radial_velocity_mps.into(),
                }
            };
            frame.detections.iter().filter(moves).map(moving).collect()
        })
        .collect();
    let all: usize = frames.iter().map(Vec::len).sum();
    if all < LEAST_FITS {
        return None;
    }
    let fits = |turn: [f64; 2], shift_ns: i64| -> usize {
        frames.iter().map(|frame| fitting(frame, truth, turn, shift_ns)).sum()
    };
    let as_they_are = fits([1.0, 1.0], 0);
    for (turn, how) in [
        ([1.0, -1.0], "mirrored, left and right exchanged: y is + to the left"),
        ([-1.0, 1.0], "mirrored, ahead and behind exchanged: x is + ahead"),
        ([-1.0, -1.0], "turned by 180 degrees"),
    ] {
        let turned = fits(turn, 0);
        if turned >= LEAST_FITS && turned > 2 * as_they_are {
            return Some(format!(
                "labels seem {how} ({turned} of {all} moving detections lie in labelled objects then, and {as_they_are} as they are)"
            ));
        }
    }
    let (best, steps) = (-STEPS..=STEPS)
        .map(|steps| (fits([1.0, 1.0], steps * STEP_NS), steps))
        .max_by_key(|(fits, steps)| (*fits, -steps.abs()))?;
    if steps.abs() >= LEAST_STEPS && best >= LEAST_FITS && best * 10 >= as_they_are * 13 + 100 {
        let seconds = steps.unsigned_abs() as f64 * STEP_NS as f64 * 1e-9;
        let (word, mend) = if steps > 0 { ("late", "take it from") } else { ("early", "add it to") };
        return Some(format!(
            "labels seem shifted in time, {seconds:.1} s {word} ({best} of {all} moving detections lie in labelled objects then, and {as_they_are} as they are); {mend} each time_s"
        ));
    }
    let hit = objects_hit(&frames, truth, recording);
    (best < LEAST_FITS && hit.1 >= LEAST_FITS && hit.0 * 20 < hit.1).then(|| {
        format!(
            "labels do not lie where the detections are: of {} labelled objects that drive in view only {} have one, and none fit mirrored or at another time; compare their frame, and the mount",
            hit.1, hit.0
        )
    })
}

/// How many detections of a frame fit an object whose place is turned by these factors of x and y, at another time.
fn fitting(frame: &[Moving], truth: &Truth, [turn_x, turn_y]: [f64; 2], shift_ns: i64) -> usize {
    let Some(first) = frame.first() else { return 0 };
    let objects: Vec<(Solid, [f64; 2])> = truth
        .at(first.time_ns.saturating_add(shift_ns))
        .into_iter()
        .filter_map(|o| {
            let mut solid = o.solid;
            let (sin, cos) = solid.yaw_rad.sin_cos();
            solid.center = [turn_x * solid.center[0], turn_y * solid.center[1], solid.center[2]];
            solid.yaw_rad = (turn_y * sin).atan2(turn_x * cos);
            o.velocity.map(|[vx, vy]| (solid, [turn_x * vx, turn_y * vy]))
        })
        .collect();
    frame.iter().filter(|d| objects.iter().any(|(solid, velocity)| is_of(d, solid, *velocity))).count()
}

fn is_of(d: &Moving, solid: &Solid, velocity: [f64; 2]) -> bool {
    let (dx, dy) = (d.place[0] - solid.center[0], d.place[1] - solid.center[1]);
    let (s, c) = solid.yaw_rad.sin_cos();
    let within = (c * dx + s * dy).abs() <= solid.size[0] / 2.0 + AROUND_M
        && (c * dy - s * dx).abs() <= solid.size[1] / 2.0 + AROUND_M;
    within && (velocity[0] * d.direction[0] + velocity[1] * d.direction[1] - d.velocity).abs() <= OFF_MPS
}

/// Of labelled objects that drive in view, at the times of the frames: how many have a detection, and how many there are.
fn objects_hit(frames: &[Vec<Moving>], truth: &Truth, recording: &Recording) -> (usize, usize) {
    let (mut hit, mut all) = (0, 0);
    for frame in frames {
        let Some(first) = frame.first() else { continue };
        for object in truth.at(first.time_ns) {
            let Some(velocity) = object.velocity else { continue };
            let seen = recording.pose.to_spherical(object.solid.center);
            if velocity[0].hypot(velocity[1]) < 2.0 * LEAST_SPEED_MPS || !recording.sensor.field_of_view.contains(seen)
            {
                continue;
            }
            all += 1;
            hit += usize::from(frame.iter().any(|d| is_of(d, &object.solid, velocity)));
        }
    }
    (hit, all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up;
    use crate::geometry::pose::Spherical;
    use crate::recording::truth::Label;

    /// Traffic to both sides, and its labels: turned by these factors, and late.
    fn traffic(turn: [f64; 2], late_ns: i64, moved_m: f64) -> Recording {
        let mut recording = made_up::recording(200, 0);
        let mut labels = Vec::new();
        for (k, frame) in recording.frames.iter_mut().enumerate() {
            frame.time_ns = k as i64 * 100_000_000;
            for vehicle in 0..8 {
                let (lane, speed) = if vehicle % 2 == 0 { (-4.0, 14.0) } else { (8.0, -16.0) };
                let way = 41.0 * f64::from(vehicle) + speed * 0.1 * k as f64;
                let (along, lap) = (way.rem_euclid(320.0) - 100.0, way.div_euclid(320.0));
                let place = [along, lane, 0.9];
                let Spherical { range_m, azimuth_rad, elevation_rad } = recording.pose.to_spherical(place);
                if along > 5.0 {
                    let radial = (place[0] * speed) / (place[0].hypot(place[1]));
                    frame.detections.push(RadarDetection {
                        range_m: range_m as f32,
                        azimuth_rad: azimuth_rad as f32,
                        elevation_rad: Some(elevation_rad as f32),
                        radial_velocity_mps: radial as f32,
                        rcs_dbsm: None,
                        snr_db: None,
                    });
                }
                let center = [turn[0] * along, turn[1] * lane + moved_m, 0.75];
                let solid = Solid { center, yaw_rad: 0.0, size: [4.6, 1.8, 1.5] };
                let id = format!("{vehicle} {lap}");
                labels.push(Label { time_ns: frame.time_ns + late_ns, id, class: "car".into(), solid });
            }
        }
        recording.truth = Some(Truth::new(labels));
        recording
    }

    fn check_held(recording: &mut Recording) {
        let frames = recording.frames.clone();
        check(recording, &frames, &Extent::of(&frames));
    }

    fn said(mut recording: Recording) -> String {
        check_held(&mut recording);
        assert!(recording.truth.is_some());
        recording.problems.iter().map(|p| p.what).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn labels_that_fit_are_not_mentioned() {
        for late_ms in [-100, 0, 100] {
            assert_eq!(said(traffic([1.0, 1.0], late_ms * 1_000_000, 0.0)), "", "{late_ms}");
        }
    }

    #[test]
    fn labels_that_are_mirrored_or_late_are_told_by_how_much() {
        assert!(said(traffic([1.0, -1.0], 0, 0.0)).contains("labels seem mirrored, left and right exchanged"));
        assert!(said(traffic([-1.0, -1.0], 0, 0.0)).contains("labels seem turned by 180 degrees"));
        for (ms, word) in [(500, "0.5 s late"), (-700, "0.7 s early"), (1200, "1.2 s late")] {
            let said = said(traffic([1.0, 1.0], ms * 1_000_000, 0.0));
            assert!(said.contains(&format!("labels seem shifted in time, {word}")), "{ms}: {said}");
        }
        let elsewhere = said(traffic([1.0, 1.0], 0, 30.0));
        assert!(elsewhere.contains("labels do not lie where the detections are"), "{elsewhere}");
    }

    #[test]
    fn one_id_of_two_objects_is_told_by_its_speed() {
        let mut recording = traffic([1.0, 1.0], 0, 0.0);
        let solid = |x: f64| Solid { center: [x, 0.0, 0.75], yaw_rad: 0.0, size: [4.6, 1.8, 1.5] };
        let label = |k: i64| Label {
            time_ns: k * 100_000_000,
            id: "both".into(),
            class: "car".into(),
            solid: solid(if k % 2 == 0 { 20.0 } else { 80.0 }),
        };
        recording.truth = Some(Truth::new((0..5).map(label).collect()));
        check_held(&mut recording);
        assert_eq!(recording.problems.count("faster than 100 m/s"), 4);
    }
}

//! Which objects count at which frame, and whether the sensor detected them.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::Options;
use crate::geometry::ground::Ground;
use crate::geometry::polygon::{Bounds, Convex};
use crate::geometry::pose::{SensorPose, direction};
use crate::geometry::sight::{box_in_sight, column_in_sight, footprint_in_sight, shadow};
use crate::geometry::solid::{Solid, clipped};
use crate::recording::truth::Object;
use crate::recording::{Frame, RadarDetection, Recording};

/// A 1 m cell (i, j) = [i, i+1) x [j, j+1) metres of the road frame.
pub type Cell = (i32, i32);

/// One object at one counted frame.
#[derive(Debug, Clone)]
pub struct Sample {
    /// Index into the truth's tracks.
    pub track: usize,
    /// Ground distance from the sensor to the box centre, metres.
    pub distance_m: f64,
    /// Detections associated with it.
    pub detections: u32,
    /// D_O: enough detections.
    pub detected: bool,
    /// Some point of its footprint at slice height is in sight (`geometry-slice`).
    pub slice_in_sight: bool,
    /// Some point of its box is in sight (`geometry-box`).
    pub box_in_sight: bool,
    pub cells: Vec<Cell>,
    pub solid: Solid,
}

/// One radar frame as the evaluation sees it.
#[derive(Debug, Clone, Default)]
pub struct FrameSamples {
    pub counted: bool,
    pub objects: Vec<Sample>,
    /// Road cells without an object, and whether their centre is in sight.
    pub cells: Vec<(Cell, bool)>,
}

/// Samples of every frame. Without labels no frame has any, but warm-up is kept apart from the rest.
///
/// `progress` is called after each frame.
pub fn collect(recording: &Recording, options: &Options, progress: &(dyn Fn() + Sync)) -> Vec<FrameSamples> {
    collect_every(recording, options, 1, progress)
}

/// The same of every `every`-th frame alone; the others are not counted.
pub fn collect_every(
    recording: &Recording,
    options: &Options,
    every: usize,
    progress: &(dyn Fn() + Sync),
) -> Vec<FrameSamples> {
    let detections = |k: usize, objects: &[Object]| {
        let detections = recording.frames.get(k).map_or(&[][..], |frame| &frame.detections);
        associate(recording, objects, detections, options)
    };
    collect_judged(recording, options, every, &Judge { detections: &detections, column: None }, progress)
}

/// What a kind of sensor detected, and what is in sight of a cell.
pub struct Judge<'a> {
    /// Detections that belong to each object of a frame.
    pub detections: &'a (dyn Fn(usize, &[Object]) -> Vec<u32> + Sync),
    /// Height of the column above a cell, metres, and the share of it that has to be in sight; without, the cell's
    /// centre at slice height has to.
    pub column: Option<(f64, f64)>,
}

/// The same for any kind of sensor.
pub fn collect_judged(
    recording: &Recording,
    options: &Options,
    every: usize,
    judge: &Judge,
    progress: &(dyn Fn() + Sync),
) -> Vec<FrameSamples> {
    let start = recording.frames.first().map_or(0, |f| f.time_ns);
    let warm_up = if recording.sensor.frames_independent { 0.0 } else { options.warm_up_s };
    let counted =
        |k: usize, f: &Frame| k.is_multiple_of(every) && f.time_ns.saturating_sub(start) as f64 * 1e-9 >= warm_up;
    let Some(truth) = &recording.truth else {
        let unlabelled = |(k, f)| FrameSamples { counted: counted(k, f), ..FrameSamples::default() };
        return recording.frames.iter().enumerate().map(unlabelled).collect();
    };
    let road = if recording.sensor.frames_independent { Vec::new() } else { road_cells(recording, options) };
    recording
        .frames
        .par_iter()
        .enumerate()
        .map(|(k, frame)| {
            progress();
            if !counted(k, frame) {
                return FrameSamples::default();
            }
            let objects = truth.at(frame.time_ns);
            frame_samples(recording, &objects, &(judge.detections)(k, &objects), judge.column, &road, options)
        })
        .collect()
}

/// Tells anew which samples were detected, from another recording of the same truth at the same times. What is in
/// sight does not depend on the sensor's measurements and stays.
pub fn detect_again(recording: &Recording, samples: &mut [FrameSamples], options: &Options) {
    let Some(truth) = &recording.truth else { return };
    recording.frames.par_iter().zip(samples).for_each(|(frame, samples)| {
        if samples.objects.is_empty() {
            return;
        }
        let objects = truth.at(frame.time_ns);
        let associated = associate(recording, &objects, &frame.detections, options);
        for sample in &mut samples.objects {
            let own = objects.iter().position(|o| o.track == sample.track);
            sample.detections = own.map_or(0, |k| associated[k]);
            sample.detected = sample.detections >= options.min_detections;
        }
    });
}

fn frame_samples(
    recording: &Recording,
    objects: &[Object],
    associated: &[u32],
    column: Option<(f64, f64)>,
    road: &[Cell],
    options: &Options,
) -> FrameSamples {
    let pose = &recording.pose;
    let sensor = pose.position;
    let height = options.slice_height_m;
    let ground = ground(recording);
    let shadows: Vec<Option<Convex>> = match ground {
        Some(_) => vec![None; objects.len()],
        None => objects.iter().map(|o| shadow(sensor, &o.solid, height)).collect(),
    };
    let mut samples = Vec::new();
    for (k, object) in objects.iter().enumerate() {
        let [x, y, _] = object.solid.center;
        let slow = object.slower_than(options.min_speed_mps);
        if slow || !recording.sensor.field_of_view.contains(pose.to_spherical(above(ground, [x, y], height))) {
            continue;
        }
        let others = || (0..objects.len()).filter(|&i| i != k);
        let (slice_in_sight, box_in_sight) = match ground {
            Some(ground) => {
                let others: Vec<Solid> = others().map(|i| objects[i].solid).collect();
                let slice = ground.footprint_in_sight(sensor, &object.solid, height, &others);
                (slice, ground.box_in_sight(sensor, &object.solid, &others))
            }
            None => (
                footprint_in_sight(&object.solid, others().filter_map(|i| shadows[i].as_ref())),
                box_in_sight(sensor, &object.solid, others().map(|i| &objects[i].solid)),
            ),
        };
        samples.push(Sample {
            track: object.track,
            distance_m: (x - sensor[0]).hypot(y - sensor[1]),
            detections: associated[k],
            detected: associated[k] >= options.min_detections,
            slice_in_sight,
            box_in_sight,
            cells: object.solid.cells().collect(),
            solid: object.solid,
        });
    }
    let taken: BTreeSet<Cell> = objects.iter().flat_map(|o| o.solid.cells()).collect();
    let bounded: Vec<(Bounds, &Convex)> = shadows.iter().flatten().map(|s| (s.bounds(), s)).collect();
    let cells = road
        .iter()
        .filter(|c| !taken.contains(c))
        .map(|&(i, j)| {
            let centre = [f64::from(i) + 0.5, f64::from(j) + 0.5];
            let in_sight = match (column, ground) {
                (Some((height_m, share)), _) => {
                    column_in_sight(sensor, centre, height_m, objects.iter().map(|o| &o.solid)) >= share
                }
                (None, Some(ground)) => {
                    ground.in_sight(sensor, ground.above(centre, height), objects.iter().map(|o| &o.solid))
                }
                (None, None) => !bounded.iter().any(|(b, s)| b.contains(centre) && s.contains(centre)),
            };
            ((i, j), in_sight)
        })
        .collect();
    FrameSamples { counted: true, objects: samples, cells }
}

/// Cells inside the field of view that some footprint overlaps at some frame of the recording.
fn road_cells(recording: &Recording, options: &Options) -> Vec<Cell> {
    let Some(truth) = &recording.truth else { return Vec::new() };
    let visited: BTreeSet<Cell> = recording
        .frames
        .par_iter()
        .fold(BTreeSet::new, |mut set, frame| {
            for object in truth.at(frame.time_ns) {
                set.extend(object.solid.cells());
            }
            set
        })
        .reduce(BTreeSet::new, |mut a, b| {
            a.extend(b);
            a
        });
    visited.into_iter().filter(|&(i, j)| cell_in_view(recording, (i, j), options.slice_height_m)).collect()
}

/// Whether a cell's own centre, at slice height, lies in the static field of view.
pub fn cell_in_view(recording: &Recording, (i, j): Cell, height_m: f64) -> bool {
    let centre = above(ground(recording), [f64::from(i) + 0.5, f64::from(j) + 0.5], height_m);
    recording.sensor.field_of_view.contains(recording.pose.to_spherical(centre))
}

/// The road's heights, where it is known not to be flat.
fn ground(recording: &Recording) -> Option<&Ground> {
    Some(&recording.ground).filter(|ground| !ground.is_level())
}

/// A place so high above the road.
fn above(ground: Option<&Ground>, [x, y]: [f64; 2], height_m: f64) -> [f64; 3] {
    [x, y, ground.map_or(0.0, |g| g.height(x)) + height_m]
}

/// How many detections belong to each object. A detection belongs to at most one.
pub fn associate(
    recording: &Recording,
    objects: &[Object],
    detections: &[RadarDetection],
    options: &Options,
) -> Vec<u32> {
    let mut counts = vec![0; objects.len()];
    for d in detections {
        if let Some(k) = owner(recording, objects, d, options) {
            counts[k] += 1;
        }
    }
    counts
}

/// Added to the distance beyond which a footprint is not looked at closer, for rounding, metres.
const NOTICE_M: f64 = 0.01;

/// The object a detection belongs to: nearest ungrown footprint among those whose grown footprint
/// holds it and whose motion explains its Doppler; ties by centre.
pub fn owner(
    recording: &Recording,
    objects: &[Object],
    detection: &RadarDetection,
    options: &Options,
) -> Option<usize> {
    let pose = &recording.pose;
    let mut p = detection.road_position(pose, options.slice_height_m);
    if let Some(ground) = ground(recording).filter(|_| detection.elevation_rad.is_none()) {
        p = detection.road_position(pose, ground.height(p[0]) + options.slice_height_m);
    }
    let grown = !recording.sensor.frames_independent;
    let judge_doppler = grown && !recording.sensor.platform_moving;
    let line = line_of_sight(pose, p);
    let moved =
        (p[0] - pose.position[0]).hypot(p[1] - pose.position[1]) * options.growth_azimuth_deg.to_radians().tan();
    let mut best: Option<(f64, f64, usize)> = None;
    for (k, object) in objects.iter().enumerate() {
        // farther than the grown footprint reaches in any direction
        let [length, width, _] = object.solid.size;
        let reach = 0.5 * length.hypot(width) + std::f64::consts::SQRT_2 * options.growth_m + moved + NOTICE_M;
        if (p[0] - object.solid.center[0]).hypot(p[1] - object.solid.center[1]) > reach {
            continue;
        }
        let inside = if grown {
            in_grown_footprint(&object.solid, pose, p, options)
        } else {
            object.solid.footprint_distance([p[0], p[1]]) <= 0.0
        };
        if !inside {
            continue;
        }
        if judge_doppler && let Some([vx, vy]) = object.velocity {
            let expected = vx * line[0] + vy * line[1];
            if (f64::from(detection.radial_velocity_mps) - expected).abs() > options.doppler_tolerance_mps {
                continue;
            }
        }
        let to_footprint = object.solid.footprint_distance([p[0], p[1]]);
        let to_centre = (p[0] - object.solid.center[0]).hypot(p[1] - object.solid.center[1]);
        if best.is_none_or(|(f, c, _)| (to_footprint, to_centre) < (f, c)) {
            best = Some((to_footprint, to_centre, k));
        }
    }
    best.map(|(_, _, k)| k)
}

/// Unit vector from the sensor to a road point.
fn line_of_sight(pose: &SensorPose, p: [f64; 3]) -> [f64; 3] {
    let s = pose.to_spherical(p);
    pose.rotate_to_road(direction(s.azimuth_rad, s.elevation_rad))
}

/// Whether the point, moved by up to the azimuth growth across its line of sight, meets the
/// footprint grown on every side.
fn in_grown_footprint(solid: &Solid, pose: &SensorPose, p: [f64; 3], options: &Options) -> bool {
    let (dx, dy) = (p[0] - pose.position[0], p[1] - pose.position[1]);
    let reach = options.growth_azimuth_deg.to_radians().tan();
    // across the line of sight: the ground vector turned left, scaled by the tangent
    let across = [-dy * reach, dx * reach];
    let (l, w) = (solid.size[0] / 2.0 + options.growth_m, solid.size[1] / 2.0 + options.growth_m);
    let a = solid.local([p[0] - across[0], p[1] - across[1]]);
    let b = solid.local([p[0] + across[0], p[1] + across[1]]);
    clipped(a, [b[0] - a[0], b[1] - a[1]], [l, w], [0.0, 1.0]).is_some_and(|(enter, leave)| enter <= leave)
}

/// Samples and recordings put together by hand, for the tests of what is made of them.
#[cfg(test)]
pub mod made_up {
    use super::*;
    use crate::recording::problems::Problems;
    use crate::recording::truth::{Label, Truth};
    use crate::recording::{FieldOfView, Sensor};

    pub const PERIOD_NS: i64 = 100_000_000;

    /// A car of the given track, straight ahead.
    pub fn sample(track: usize, distance_m: f64, detected: bool, in_sight: bool) -> Sample {
        let solid = car(distance_m);
        Sample {
            track,
            distance_m,
            detections: u32::from(detected),
            detected,
            slice_in_sight: in_sight,
            box_in_sight: in_sight,
            cells: solid.cells().collect(),
            solid,
        }
    }

    fn car(x: f64) -> Solid {
        Solid { center: [x, 0.0, 0.75], yaw_rad: 0.0, size: [4.6, 1.8, 1.5] }
    }

    /// Counted frames of the given objects.
    pub fn frames(objects: impl IntoIterator<Item = Vec<Sample>>) -> Vec<FrameSamples> {
        objects.into_iter().map(|objects| FrameSamples { counted: true, objects, cells: Vec::new() }).collect()
    }

    /// Empty frames at 10 Hz, and tracks named `0`, `1`, ... in their order.
    pub fn recording(frames: usize, tracks: usize) -> Recording {
        let label = |k| Label { time_ns: 0, id: format!("{k}"), class: "car".into(), solid: car(50.0) };
        Recording {
            name: "by-hand".into(),
            sensor: Sensor {
                name: "by-hand".into(),
                field_of_view: FieldOfView {
                    azimuth_rad: [-1.0, 1.0],
                    elevation_rad: [-0.5, 0.5],
                    range_m: [1.0, 200.0],
                },
                has_elevation: true,
                frames_independent: false,
                platform_moving: false,
                synthetic: false,
                licence: None,
            },
            pose: SensorPose::new([0.0, 0.0, 6.0], 0.0, 0.0, 0.0),
            frames: (0..frames)
                .map(|k| Frame {
                    time_ns: k as i64 * PERIOD_NS,
                    detections: Vec::new(),
                    refused: 0,
                    unwanted: Vec::new(),
                    fault: false,
                })
                .collect(),
            scans: None,
            ground: Ground::default(),
            truth: Some(Truth::new((0..tracks).map(label).collect())),
            occlusion: Default::default(),
            camera: None,
            problems: Problems::default(),
        }
    }
}

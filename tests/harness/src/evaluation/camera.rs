//! A recorded camera judged by itself: its own frames, field of view and detections.
//!
//! D_O: boxes are assigned one to one to the objects' visible outlines, the nearest object first, each the box that
//! overlaps it most, from an intersection over union of 0.3 on. Overlap with the whole outline would call a hidden
//! vehicle detected, which projects into the box of what hides it. A box around two counts for the nearer one.
//! Truth of a road cell: the share of its column, 0 to 4 m above the road, that is in sight past all boxes, against
//! the share from which the estimator calls a cell visible.

use super::Options;
use super::samples::{FrameSamples, Judge, collect_judged};
use crate::geometry::pose::SensorPose;
use crate::geometry::sight::{Uncovered, uncovered_outlines};
use crate::geometry::solid::Solid;
use crate::recording::Recording;
use crate::recording::camera::{Box2d, Intrinsics, RecordedCamera};
use crate::recording::truth::Object;
use rayon::prelude::*;
use viewshed::camera::boxes::VehicleClass;

/// Least overlap of a box with a visible outline.
const LEAST_OVERLAP: f64 = 0.3;

/// Height of the columns above road cells, metres.
const COLUMN_M: f64 = 4.0;

/// The recording of a recording's camera: its frames, within the time of the radar's, as frames without detections.
pub fn recording(of: &Recording, range_max_m: f64) -> Option<Recording> {
    let camera = of.camera.as_ref()?;
    let (first, last) = (of.frames.first()?.time_ns, of.frames.last()?.time_ns);
    let mut camera = camera.clone();
    camera.frames.retain(|f| (first..=last).contains(&f.time_ns));
    let alone = camera.alone(format!("{}, camera", of.name), of.sensor.clone(), of.truth.clone(), range_max_m);
    Some(Recording { ground: of.ground.clone(), ..alone })
}

/// Samples of every `every`-th frame of a camera's own recording.
pub fn samples(
    recording: &Recording,
    visible_share: f64,
    options: &Options,
    every: usize,
    progress: &(dyn Fn() + Sync),
) -> Vec<FrameSamples> {
    let detections = |k: usize, objects: &[Object]| found(recording, k, objects);
    let judge = Judge { detections: &detections, column: Some((COLUMN_M, visible_share)) };
    collect_judged(recording, options, every, &judge, progress)
}

/// Tells anew which samples were detected, from other boxes of the same truth at the same times.
pub fn detect_again(recording: &Recording, samples: &mut [FrameSamples], options: &Options) {
    let Some(truth) = &recording.truth else { return };
    recording.frames.par_iter().zip(samples).enumerate().for_each(|(k, (frame, samples))| {
        if samples.objects.is_empty() {
            return;
        }
        let objects = truth.at(frame.time_ns);
        let found = found(recording, k, &objects);
        for sample in &mut samples.objects {
            let own = objects.iter().position(|o| o.track == sample.track);
            sample.detections = own.map_or(0, |k| found[k]);
            sample.detected = sample.detections >= options.min_detections;
        }
    });
}

/// How many boxes of a frame each object was assigned.
fn found(recording: &Recording, frame: usize, objects: &[Object]) -> Vec<u32> {
    let Some(camera) = &recording.camera else { return vec![0; objects.len()] };
    let boxes = camera.frames.get(frame).map_or(&[][..], |f| &f.boxes);
    let solids: Vec<Solid> = objects.iter().map(|o| o.solid).collect();
    let boxed = |k: usize| objects[k].speed() != Some(0.0) || is_vehicle(recording, &objects[k]);
    assigned(camera, &solids, boxes, boxed)
}

/// What shows of each object: the share of its outline that is in the image and that no other covers.
pub fn visible_shares(camera: &RecordedCamera, objects: &[Object]) -> Vec<f64> {
    let solids: Vec<Solid> = objects.iter().map(|o| o.solid).collect();
    let mut shares = vec![0.0; objects.len()];
    for seen in uncovered_outlines(&camera.pose, &solids, &[], &camera.intrinsics.frame()) {
        shares[seen.object] = seen.share;
    }
    shares
}

/// What stands still and is no vehicle, a barrier, hides others but has no box.
fn is_vehicle(recording: &Recording, object: &Object) -> bool {
    let track = recording.truth.as_ref().and_then(|t| t.tracks.get(object.track));
    track.is_some_and(|t| VehicleClass::named(&t.class).is_some())
}

/// How many boxes each object was assigned, none or one; `boxed` says which may have any.
fn assigned(camera: &RecordedCamera, objects: &[Solid], boxes: &[Box2d], boxed: impl Fn(usize) -> bool) -> Vec<u32> {
    let mut outlines = visible_outlines(&camera.pose, &camera.intrinsics, objects);
    let eye = camera.pose.position;
    let distance = |k: usize| (objects[k].center[0] - eye[0]).hypot(objects[k].center[1] - eye[1]);
    outlines.sort_by(|(a, _), (b, _)| distance(*a).total_cmp(&distance(*b)));
    let mut counts = vec![0; objects.len()];
    let mut taken = vec![false; boxes.len()];
    for (object, outline) in outlines.iter().filter(|(object, _)| boxed(*object)) {
        let free = boxes.iter().enumerate().filter(|(k, _)| !taken[*k]);
        let best = free.map(|(k, b)| (b.overlap(outline), k)).max_by(|(a, _), (b, _)| a.total_cmp(b));
        if let Some((_, k)) = best.filter(|(overlap, _)| *overlap >= LEAST_OVERLAP) {
            taken[k] = true;
            counts[*object] = 1;
        }
    }
    counts
}

/// The box around what is visible of each object, in pixels.
fn visible_outlines(pose: &SensorPose, i: &Intrinsics, objects: &[Solid]) -> Vec<(usize, Box2d)> {
    let seen = uncovered_outlines(pose, objects, &[], &i.frame()).into_iter();
    let outline = |s: Uncovered| {
        let ([l, t], [r, b]) = (i.pixel(s.high), i.pixel(s.low));
        (s.object, Box2d { class: String::new(), score: 1.0, edges: [l, t, r, b] })
    };
    seen.map(outline).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> RecordedCamera {
        RecordedCamera {
            pose: SensorPose::new([0.0, 0.0, 6.0], 0.0, 0.0, 0.0),
            intrinsics: Intrinsics::centred([1920, 1080], 1600.0),
            frames: Vec::new(),
            alone: false,
        }
    }

    fn solid(x: f64, y: f64, size: [f64; 3]) -> Solid {
        Solid { center: [x, y, size[2] / 2.0], yaw_rad: 0.0, size }
    }

    fn boxes(objects: &[Solid]) -> Vec<Box2d> {
        let c = camera();
        visible_outlines(&c.pose, &c.intrinsics, objects).into_iter().map(|(_, b)| b).collect()
    }

    fn assigned_to(objects: &[Solid], boxes: &[Box2d]) -> Vec<u32> {
        assigned(&camera(), objects, boxes, |_| true)
    }

    #[test]
    fn what_is_no_vehicle_hides_but_has_no_box() {
        let (wall, car) = (solid(30.0, 0.0, [1.0, 9.0, 1.0]), solid(38.0, 0.0, [4.6, 1.8, 1.5]));
        let own = boxes(&[wall, car]);
        assert_eq!(assigned(&camera(), &[wall, car], &own, |k| k == 1), [0, 1]);
        assert_eq!(assigned(&camera(), &[wall, car], &own[..1], |k| k == 1), [0, 0]);
    }

    #[test]
    fn a_hidden_vehicle_is_not_detected_by_the_box_of_what_hides_it() {
        let truck = solid(46.0, 0.0, [12.0, 2.5, 4.0]);
        let hidden = solid(58.0, 0.0, [4.6, 1.8, 1.5]);
        assert_eq!(boxes(&[truck, hidden]).len(), 1);
        assert_eq!(assigned_to(&[hidden, truck], &boxes(&[truck])), [0, 1]);
        assert_eq!(assigned_to(&[hidden], &boxes(&[truck])), [0], "its own outline is a small part of that");
    }

    #[test]
    fn a_box_belongs_to_one_object_and_around_two_to_the_nearer_one() {
        let (near, far) = (solid(40.0, 0.0, [4.6, 1.8, 1.5]), solid(46.0, 0.0, [4.6, 1.8, 1.5]));
        let own = boxes(&[near, far]);
        assert_eq!(assigned_to(&[far, near], &own), [1, 1]);
        let mut both = own[0].clone();
        both.edges = [0, 1, 2, 3].map(|k| {
            let (a, b) = (own[0].edges[k], own[1].edges[k]);
            if k < 2 { a.min(b) } else { a.max(b) }
        });
        assert_eq!(assigned_to(&[far, near], &[both]), [0, 1]);
        let elsewhere = boxes(&[solid(40.0, 6.0, [4.6, 1.8, 1.5])]);
        assert_eq!(assigned_to(&[near], &elsewhere), [0], "beside it");
    }
}

//! Whether a camera's boxes may be of the picture it is said to have.
//!
//! A vehicle stands on the road: the lower edge of its box says how far it is, and that how high the box is to be. Boxes
//! of another size of the picture (binned, a region, scaled for the detector) lie above the horizon, or are far too large or
//! small for where they stand.

use super::camera::{OBJECTS_TOPIC, RecordedCamera};
use super::labels::class_size;
use super::problems::Problems;

/// Boxes before anything is said.
const LEAST_BOXES: usize = 30;

/// A box may end outside by this part of the picture: detectors round, and complete what is cut.
const OUTSIDE: f64 = 0.05;

/// Boxes that touch the edge of the picture, to this part of it, are cut there.
const EDGE: f64 = 0.01;

/// Pixels that a horizon may be off: pitch, and the road.
const HORIZON_PX: f64 = 10.0;

/// Heights of a box over those of its class at its place that may be: vehicles are of many sizes, and partly hidden.
const LIKELY: std::ops::RangeInclusive<f64> = 0.4..=2.5;

/// A camera whose boxes may be of vehicles on the road, which is level; none where they cannot, and why.
pub fn of_the_road(camera: Option<RecordedCamera>, level: bool, problems: &mut Problems) -> Option<RecordedCamera> {
    let camera = camera?;
    let Some(what) = contradiction(&camera).filter(|_| level) else { return Some(camera) };
    let first = camera.frames.first().map_or(0, |frame| frame.time_ns);
    problems.add(OBJECTS_TOPIC, format!("boxes left out: {what}"), first);
    None
}

/// What contradicts that the boxes are of the picture as told; `None` where nothing does.
pub fn contradiction(camera: &RecordedCamera) -> Option<String> {
    let [width, height] = camera.intrinsics.size_px.map(f64::from);
    let boxes = || camera.frames.iter().flat_map(|frame| &frame.boxes);
    let n = boxes().count();
    let size = format!("{width} x {height} pixels");
    let cause = "the size of the picture is another, or the binning or region of interest of CameraInfo is wrong";
    let ends_outside = |[l, t, r, b]: [f64; 4]| {
        let (x, y) = (OUTSIDE * width, OUTSIDE * height);
        l < -x || t < -y || r > width + x || b > height + y
    };
    let outside = boxes().filter(|b| ends_outside(b.edges)).count();
    if n >= LEAST_BOXES && outside * 5 > n {
        return Some(format!("{outside} of {n} end outside of the picture of {size}: {cause}"));
    }
    let (mut judged, mut above, mut unlikely) = (0, 0, 0);
    for b in boxes() {
        let [l, t, r, bottom] = b.edges;
        let is_cut =
            l < EDGE * width || t < EDGE * height || r > (1.0 - EDGE) * width || bottom > (1.0 - EDGE) * height;
        let Some([.., high]) = class_size(&b.class).filter(|_| !is_cut) else { continue };
        let down = |v: f64| {
            let [left, up] = camera.intrinsics.tangents([(l + r) / 2.0, v]);
            -camera.pose.rotate_to_road([1.0, left, up])[2]
        };
        judged += 1;
        if down(bottom + HORIZON_PX) <= 0.0 {
            above += 1;
        } else if down(bottom - HORIZON_PX) > 0.0 {
            let ahead_m = camera.pose.position[2] / down(bottom);
            let expected_px = high * camera.intrinsics.focal_px[1] / ahead_m;
            unlikely += usize::from(!LIKELY.contains(&((bottom - t) / expected_px)));
        }
    }
    (judged >= LEAST_BOXES && (above + unlikely) * 5 > judged * 3).then(|| {
        format!(
            "{above} of {judged} lie above the horizon and {unlikely} have not the size of what stands there, in a picture of {size}: {cause}, or the camera's pitch"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose::SensorPose;
    use crate::recording::camera::{Box2d, CameraFrame, Intrinsics};

    /// Cars at 12 to 100 m, with boxes whose pixels are scaled and moved.
    fn camera(pitch_deg: f64, scale: f64, shift: [f64; 2]) -> RecordedCamera {
        let pose = SensorPose::new([0.0, 0.0, 6.0], 0.0, pitch_deg.to_radians(), 0.0);
        let intrinsics = Intrinsics::centred([1920, 1080], 1660.0);
        let car = |k: u32| {
            let (x, y) = (12.0 + 2.0 * f64::from(k), 7.0 * (f64::from(k % 3) - 1.0));
            let corner = |y: f64, z: f64| intrinsics.pixel_of(&pose, [x, y, z]).unwrap();
            let ([l, b], [r, t]) = (corner(y + 0.9, 0.0), corner(y - 0.9, 1.5));
            let [l, r] = [l, r].map(|u| scale * u + shift[0]);
            let [t, b] = [t, b].map(|v| scale * v + shift[1]);
            Box2d { class: "car".into(), score: 1.0, edges: [l, t, r, b] }
        };
        let frames = vec![CameraFrame { time_ns: 0, boxes: (0..45).map(car).collect(), refused: 0 }];
        RecordedCamera { pose, intrinsics, frames, alone: false }
    }

    #[test]
    fn boxes_of_the_picture_say_nothing() {
        for pitch in [3.0, 6.0, 10.0] {
            assert_eq!(contradiction(&camera(pitch, 1.0, [0.0; 2])), None, "{pitch}");
        }
    }

    #[test]
    fn boxes_of_another_picture_are_told() {
        for pitch in [3.0, 6.0, 10.0] {
            for (scale, shift) in [(0.5, [0.0; 2]), (0.33, [0.0; 2]), (2.0, [0.0; 2]), (1.0, [-500.0, -400.0])] {
                let said = contradiction(&camera(pitch, scale, shift)).unwrap_or_default();
                assert!(said.contains("the size of the picture is another"), "{pitch} {scale} {shift:?}: {said}");
            }
        }
    }
}

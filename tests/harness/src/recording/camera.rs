//! Camera detections: boxes in pixels, and the camera they were made with.

use viewshed::camera::calibration;

use super::problems::Problems;
use super::ros::{
    BoundingBox2D, CameraInfo, Detection2D, Detection2DArray, Header, ObjectHypothesis, ObjectHypothesisWithPose, Pose,
    Quaternion, RegionOfInterest, Vector3,
};
use super::transforms::Transforms;
use crate::geometry::pose::SensorPose;

pub const OBJECTS_TOPIC: &str = "/camera/objects";
pub const INFO_TOPIC: &str = "/camera/info";
/// x ahead, as every frame of a recording.
pub const CAMERA_FRAME: &str = "camera";
/// z ahead, x right, y down (REP-103, suffix `_optical`): the frame pixels are of.
pub const OPTICAL_FRAME: &str = "camera_optical";

/// A pinhole camera without distortion; the optical axis meets the middle of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    pub width_px: u32,
    pub height_px: u32,
    pub focal_px: f64,
}

/// A box around something, in pixels from the upper left corner.
#[derive(Debug, Clone, PartialEq)]
pub struct Box2d {
    pub class: String,
    /// 0 to 1.
    pub score: f64,
    /// Left, top, right, bottom.
    pub edges: [f64; 4],
}

impl Box2d {
    pub fn area(&self) -> f64 {
        let [l, t, r, b] = self.edges;
        (r - l).max(0.0) * (b - t).max(0.0)
    }

    /// Intersection over union.
    pub fn overlap(&self, other: &Self) -> f64 {
        let ([l, t, r, b], [m, u, s, c]) = (self.edges, other.edges);
        let common = (r.min(s) - l.max(m)).max(0.0) * (b.min(c) - t.max(u)).max(0.0);
        let all = self.area() + other.area() - common;
        if all > 0.0 { common / all } else { 0.0 }
    }
}

/// One camera frame.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraFrame {
    pub time_ns: i64,
    pub boxes: Vec<Box2d>,
    /// Boxes dropped when it was read: not finite.
    pub refused: u64,
}

/// A camera of a recording, its frames in the order of time.
#[derive(Debug, Clone)]
pub struct RecordedCamera {
    /// Where it hangs, x ahead.
    pub pose: SensorPose,
    pub intrinsics: calibration::Intrinsics,
    pub frames: Vec<CameraFrame>,
}

/// What a file tells of a camera, gathered while it is read.
#[derive(Debug, Default)]
pub struct CameraReader {
    info: Option<CameraInfo>,
    frames: Vec<CameraFrame>,
}

impl CameraReader {
    pub fn info(&mut self, info: CameraInfo) {
        self.info.get_or_insert(info);
    }

    pub fn boxes(&mut self, array: Detection2DArray, problems: &mut Problems) {
        let time_ns = array.header.stamp.nanoseconds();
        if self.frames.last().is_some_and(|last| time_ns <= last.time_ns) {
            problems.add(OBJECTS_TOPIC, "time does not go on, frame dropped", time_ns);
            return;
        }
        let mut frame = CameraFrame { time_ns, boxes: Vec::new(), refused: 0 };
        for d in array.detections {
            let ([x, y], [w, h]) = (d.bbox.center, d.bbox.size);
            if [x, y, w, h].iter().any(|v| !v.is_finite()) {
                frame.refused += 1;
                continue;
            }
            let named = d.results.into_iter().next().map(|r| (r.hypothesis.class_id, r.hypothesis.score));
            let (class, score) = named.unwrap_or_else(|| ("unknown".into(), 0.0));
            frame.boxes.push(Box2d { class, score, edges: [x - w / 2.0, y - h / 2.0, x + w / 2.0, y + h / 2.0] });
        }
        problems.add_many(OBJECTS_TOPIC, "box with a value that is not finite, dropped", time_ns, frame.refused);
        self.frames.push(frame);
    }

    /// The camera, if there are boxes of one whose mount and projection are told.
    pub fn finish(self, transforms: &Transforms, road: &str, problems: &mut Problems) -> Option<RecordedCamera> {
        let first = self.frames.first()?.time_ns;
        let Some(info) = self.info else {
            problems.add(OBJECTS_TOPIC, format!("boxes left out: there is no {INFO_TOPIC}"), first);
            return None;
        };
        let frame = info.header.frame_id.as_str();
        let pose = match transforms.pose(road, frame) {
            Some(pose) if frame.ends_with("_optical") => Some(ahead_of_optical(&pose)),
            other => other.or_else(|| transforms.pose(road, CAMERA_FRAME)),
        };
        let Some(pose) = pose else {
            let what = format!("boxes left out: /tf_static joins no frame `{road}` to the camera's `{frame}`");
            problems.add(INFO_TOPIC, what, first);
            return None;
        };
        if info.d.iter().any(|d| *d != 0.0) {
            problems.add(INFO_TOPIC, "lens with distortion: boxes are taken as those of the rectified image", first);
        }
        // what lies outside of 16 bits is refused with its name later on
        let side = |v: u32| u16::try_from(v).unwrap_or(u16::MAX);
        let [fx, _, cx, _, fy, cy, ..] = info.k;
        let intrinsics = calibration::Intrinsics {
            size_px: [side(info.width), side(info.height)],
            focal_px: [fx as f32, fy as f32],
            center_px: [cx as f32, cy as f32],
        };
        Some(RecordedCamera { pose, intrinsics, frames: self.frames })
    }
}

/// The pose with x ahead of an optical one, with z ahead, x right and y down.
fn ahead_of_optical(optical: &SensorPose) -> SensorPose {
    let [ahead, left, up] =
        [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]].map(|axis| optical.rotate_to_road(axis));
    let pitch = (-ahead[2]).atan2(ahead[0].hypot(ahead[1]));
    SensorPose::new(optical.position, ahead[1].atan2(ahead[0]), pitch, left[2].atan2(up[2]))
}

/// The message of a frame. Boxes are written to a quarter of a pixel.
pub fn message(frame: &CameraFrame, header: &Header) -> Detection2DArray {
    let quarter = |v: f64| (v * 4.0).round() / 4.0;
    let detection = |b: &Box2d| {
        let [l, t, r, b_] = b.edges.map(quarter);
        let origin = Pose { position: Vector3::default(), orientation: Quaternion::from_yaw(0.0) };
        let score = (b.score * 256.0).round() / 256.0;
        Detection2D {
            header: header.clone(),
            results: vec![ObjectHypothesisWithPose {
                hypothesis: ObjectHypothesis { class_id: b.class.clone(), score },
                pose: origin,
                covariance: Default::default(),
            }],
            bbox: BoundingBox2D { center: [(l + r) / 2.0, (t + b_) / 2.0], theta: 0.0, size: [r - l, b_ - t] },
            id: String::new(),
        }
    };
    Detection2DArray { header: header.clone(), detections: frame.boxes.iter().map(detection).collect() }
}

/// The camera's own message.
pub fn info(camera: &Intrinsics, header: &Header) -> CameraInfo {
    let (f, cx, cy) = (camera.focal_px, f64::from(camera.width_px) / 2.0, f64::from(camera.height_px) / 2.0);
    CameraInfo {
        header: header.clone(),
        height: camera.height_px,
        width: camera.width_px,
        distortion_model: "plumb_bob".into(),
        d: vec![0.0; 5],
        k: [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [f, 0.0, cx, 0.0, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        binning_x: 0,
        binning_y: 0,
        roi: RegionOfInterest::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::ros::{decode, encode};
    use super::*;

    #[test]
    fn messages_survive_the_wire() {
        let frame = CameraFrame {
            time_ns: 5,
            boxes: vec![Box2d { class: "van".into(), score: 0.5, edges: [10.0, 20.0, 30.25, 44.0] }],
            refused: 0,
        };
        let header = Header { frame_id: OPTICAL_FRAME.into(), ..Default::default() };
        let back: Detection2DArray = decode(&encode(&message(&frame, &header)).unwrap()).unwrap();
        let d = &back.detections[0];
        assert_eq!((d.bbox.center, d.bbox.size), ([20.125, 32.0], [20.25, 24.0]));
        assert_eq!(d.results[0].hypothesis.class_id, "van");
        let camera = Intrinsics { width_px: 640, height_px: 480, focal_px: 500.0 };
        let back: CameraInfo = decode(&encode(&info(&camera, &header)).unwrap()).unwrap();
        assert_eq!((back.width, back.k[2], back.p[5]), (640, 320.0, 500.0));
    }

    #[test]
    fn overlap_is_intersection_over_union() {
        let b = |edges| Box2d { class: String::new(), score: 1.0, edges };
        let one = b([0.0, 0.0, 2.0, 2.0]);
        assert_eq!(one.overlap(&b([1.0, 0.0, 3.0, 2.0])), 1.0 / 3.0);
        assert_eq!(one.overlap(&b([5.0, 0.0, 6.0, 2.0])), 0.0);
        assert_eq!(one.overlap(&one), 1.0);
    }

    #[test]
    fn what_cannot_be_a_frame_of_a_camera_is_told() {
        let header =
            |ns| Header { stamp: super::super::ros::Stamp::from_nanoseconds(ns), frame_id: OPTICAL_FRAME.into() };
        let b = |edges| Box2d { class: "car".into(), score: 1.0, edges };
        let frame = |time_ns, boxes| message(&CameraFrame { time_ns, boxes, refused: 0 }, &header(time_ns));
        let (mut reader, mut problems) = (CameraReader::default(), Problems::default());
        reader.boxes(frame(5, vec![b([1.0, 2.0, 3.0, 4.0]), b([f64::NAN; 4])]), &mut problems);
        reader.boxes(frame(5, vec![]), &mut problems);
        assert_eq!((reader.frames.len(), reader.frames[0].boxes.len(), reader.frames[0].refused), (1, 1, 1));
        assert_eq!((problems.count("not finite"), problems.count("does not go on")), (1, 1));
        assert!(reader.finish(&Transforms::default(), "road", &mut problems).is_none());
        assert_eq!(problems.count("there is no /camera/info"), 1);
    }

    #[test]
    fn the_optical_frame_is_turned_back_ahead() {
        let pose = SensorPose::new([1.0, 2.0, 6.0], 0.3, 0.1, -0.05);
        let axes = [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]].map(|axis| pose.rotate_to_road(axis));
        // right, down and ahead as yaw, pitch and roll of the optical frame
        let (x, y, z) = (axes[0], axes[1], axes[2]);
        let pitch = (-x[2]).asin();
        let optical = SensorPose::new(pose.position, x[1].atan2(x[0]), pitch, y[2].atan2(z[2]));
        let back = ahead_of_optical(&optical);
        let off = [back.yaw_rad() - 0.3, back.pitch_rad() - 0.1, back.roll_rad() + 0.05];
        assert!(off.iter().all(|v| v.abs() < 1e-9), "{off:?}");
    }
}

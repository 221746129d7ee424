//! Camera detections: boxes in pixels, and the camera they were made with.

use super::ros::{
    BoundingBox2D, CameraInfo, Detection2D, Detection2DArray, Header, ObjectHypothesis, ObjectHypothesisWithPose, Pose,
    Quaternion, RegionOfInterest, Vector3,
};

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
}

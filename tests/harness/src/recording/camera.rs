//! Camera detections: boxes in pixels, and the camera they were made with.

use viewshed::camera::calibration;

use super::problems::Problems;
use super::ros::{
    BoundingBox2D, CameraInfo, Detection2D, Detection2DArray, Header, ObjectHypothesis, ObjectHypothesisWithPose, Pose,
    Quaternion, RegionOfInterest, Vector3,
};
use super::transforms::Transforms;
use super::truth::Truth;
use super::{FieldOfView, Frame, Recording, Sensor};
use crate::geometry::ground::Ground;
use crate::geometry::polygon::Convex;
use crate::geometry::pose::SensorPose;

pub const OBJECTS_TOPIC: &str = "/camera/objects";
pub const INFO_TOPIC: &str = "/camera/info";
/// x ahead, as every frame of a recording.
pub const CAMERA_FRAME: &str = "camera";
/// z ahead, x right, y down (REP-103, suffix `_optical`): the frame pixels are of.
pub const OPTICAL_FRAME: &str = "camera_optical";

/// A pinhole camera without distortion, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// Width and height.
    pub size_px: [u32; 2],
    /// Along u and v.
    pub focal_px: [f64; 2],
    /// Where the optical axis meets the image.
    pub center_px: [f64; 2],
}

impl Intrinsics {
    /// With square pixels; the optical axis meets the middle of the image.
    pub fn centred(size_px: [u32; 2], focal_px: f64) -> Self {
        Self { size_px, focal_px: [focal_px; 2], center_px: size_px.map(|side| f64::from(side) / 2.0) }
    }

    /// Pixel of a point of the image plane at unit distance, left and up.
    pub fn pixel(&self, [left, up]: [f64; 2]) -> [f64; 2] {
        let ([u, v], [fu, fv]) = (self.center_px, self.focal_px);
        [u - fu * left, v - fv * up]
    }

    /// The point of the image plane at unit distance, left and up, that a pixel shows.
    pub fn tangents(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        [(self.center_px[0] - u) / self.focal_px[0], (self.center_px[1] - v) / self.focal_px[1]]
    }

    /// Pixel of a place; `None` behind the camera.
    pub fn pixel_of(&self, pose: &SensorPose, place: [f64; 3]) -> Option<[f64; 2]> {
        let [ahead, left, up] = pose.to_sensor(place);
        (ahead > 1e-6).then(|| self.pixel([left / ahead, up / ahead]))
    }

    /// The image's border on the plane at unit distance.
    pub fn frame(&self) -> Convex {
        let ([left, up], [right, down]) = (self.tangents([0.0; 2]), self.tangents(self.size_px.map(f64::from)));
        Convex::hull(vec![[left, up], [right, up], [right, down], [left, down]])
    }

    /// Limits within which everything is in the image.
    pub fn field_of_view(&self, range_max_m: f64) -> FieldOfView {
        let ([left, up], [right, down]) = (self.tangents([0.0; 2]), self.tangents(self.size_px.map(f64::from)));
        let slant = 1.0_f64.hypot(left.max(-right));
        FieldOfView {
            azimuth_rad: [right.atan(), left.atan()],
            elevation_rad: [(down / slant).atan(), (up / slant).atan()],
            range_m: [0.0, range_max_m],
        }
    }

    /// As the library takes it. A side outside of 16 bits is refused there with its name.
    pub fn for_library(&self) -> calibration::Intrinsics {
        calibration::Intrinsics {
            size_px: self.size_px.map(|side| u16::try_from(side).unwrap_or(u16::MAX)),
            focal_px: self.focal_px.map(|v| v as f32),
            center_px: self.center_px.map(|v| v as f32),
        }
    }
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
    pub intrinsics: Intrinsics,
    pub frames: Vec<CameraFrame>,
    /// Whether the recording is the camera's own: its frames are the recording's.
    pub alone: bool,
}

impl RecordedCamera {
    /// As a recording of its own, its frames without detections; `sensor` says what is known beside the view.
    pub fn alone(mut self, name: String, sensor: Sensor, truth: Option<Truth>, range_max_m: f64) -> Recording {
        self.alone = true;
        let frame = |time_ns| Frame { time_ns, detections: Vec::new(), refused: 0, unwanted: Vec::new(), fault: false };
        Recording {
            name,
            sensor: Sensor {
                name: "camera".into(),
                field_of_view: self.intrinsics.field_of_view(range_max_m),
                has_elevation: true,
                ..sensor
            },
            pose: self.pose,
            frames: self.frames.iter().map(|f| frame(f.time_ns)).collect(),
            scans: None,
            ground: Ground::default(),
            truth,
            occlusion: Default::default(),
            camera: Some(self),
            problems: Problems::default(),
        }
    }
}

/// What a file tells of a camera, gathered while it is read.
#[derive(Debug, Default)]
pub struct CameraReader {
    info: Option<CameraInfo>,
    /// With the times they were logged at.
    frames: Vec<(i64, CameraFrame)>,
    /// Messages of boxes that cannot be read.
    pub unread: u64,
}

impl CameraReader {
    pub fn info(&mut self, info: CameraInfo) {
        self.info.get_or_insert(info);
    }

    pub fn boxes(&mut self, array: Detection2DArray, logged_ns: i64, problems: &mut Problems) {
        let time_ns = array.header.stamp.nanoseconds();
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
        self.frames.push((logged_ns, frame));
    }

    /// The frames in the order of time: as they were logged where that is the better order.
    fn in_order(&mut self, problems: &mut Problems) -> Vec<CameraFrame> {
        let back = |frames: &[(i64, CameraFrame)]| {
            frames.windows(2).filter(|pair| pair[1].1.time_ns < pair[0].1.time_ns).count()
        };
        let mut logged = self.frames.clone();
        logged.sort_by_key(|(logged_ns, _)| *logged_ns);
        if back(&logged) < back(&self.frames) {
            self.frames = logged;
        }
        let mut frames: Vec<CameraFrame> = Vec::new();
        for (_, frame) in self.frames.drain(..) {
            if frames.last().is_some_and(|last| frame.time_ns <= last.time_ns) {
                problems.add(OBJECTS_TOPIC, "time does not go on, frame dropped", frame.time_ns);
            } else {
                frames.push(frame);
            }
        }
        frames
    }

    /// The camera, if there are boxes of one whose mount and projection are told.
    pub fn finish(mut self, transforms: &Transforms, road: &str, problems: &mut Problems) -> Option<RecordedCamera> {
        let frames = self.in_order(problems);
        let first = frames.first()?.time_ns;
        if self.unread > 0 {
            let what = "boxes left out: of a camera whose messages cannot all be read, those without a box would say that nothing is there";
            problems.add_many(OBJECTS_TOPIC, what, first, self.unread);
            return None;
        }
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
        Some(RecordedCamera { pose, intrinsics: delivered(&info), frames, alone: false })
    }
}

/// The projection of the picture that is sent: K is of the full one, of which a region is cut out and then binned
/// (`sensor_msgs/msg/CameraInfo`). 0 is the same as 1 for binning, and a region without size is the whole.
fn delivered(info: &CameraInfo) -> Intrinsics {
    let [fx, _, cx, _, fy, cy, ..] = info.k;
    let roi = &info.roi;
    let (offset, size) = if roi.width == 0 || roi.height == 0 {
        ([0, 0], [info.width, info.height])
    } else {
        ([roi.x_offset, roi.y_offset], [roi.width, roi.height])
    };
    let [binning_x, binning_y] = [info.binning_x, info.binning_y].map(|binning| binning.max(1));
    let by = [f64::from(binning_x), f64::from(binning_y)];
    Intrinsics {
        size_px: [size[0] / binning_x, size[1] / binning_y],
        focal_px: [fx / by[0], fy / by[1]],
        center_px: [(cx - f64::from(offset[0])) / by[0], (cy - f64::from(offset[1])) / by[1]],
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
    let ([fx, fy], [cx, cy], [width, height]) = (camera.focal_px, camera.center_px, camera.size_px);
    CameraInfo {
        header: header.clone(),
        height,
        width,
        distortion_model: "plumb_bob".into(),
        d: vec![0.0; 5],
        k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
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
        let camera = Intrinsics::centred([640, 480], 500.0);
        let back: CameraInfo = decode(&encode(&info(&camera, &header)).unwrap()).unwrap();
        assert_eq!((back.width, back.k[2], back.p[5]), (640, 320.0, 500.0));
    }

    #[test]
    fn the_field_of_view_is_within_the_image() {
        let view = Intrinsics::centred([1920, 1080], 1600.0).field_of_view(200.0);
        assert!((view.azimuth_rad[1].tan() - 0.6).abs() < 1e-9 && view.azimuth_rad[0] == -view.azimuth_rad[1]);
        let corner = (540.0_f64 / 1600.0 / 1.0_f64.hypot(0.6)).atan();
        assert!((view.elevation_rad[1] - corner).abs() < 1e-9);
    }

    #[test]
    fn left_and_up_are_small_pixels_and_lead_back() {
        let camera = Intrinsics { size_px: [1920, 1200], focal_px: [2789.0, 2783.0], center_px: [908.0, 589.0] };
        let [u, v] = camera.pixel([0.1, 0.05]);
        assert!(u < 908.0 && v < 589.0);
        let [left, up] = camera.tangents([u, v]);
        assert!((left - 0.1).abs() < 1e-12 && (up - 0.05).abs() < 1e-12);
        let pose = SensorPose::new([0.0, 0.0, 8.0], 0.0, 0.0, 0.0);
        assert_eq!(camera.pixel_of(&pose, [10.0, 0.0, 8.0]), Some([908.0, 589.0]));
        assert_eq!(camera.pixel_of(&pose, [-10.0, 0.0, 8.0]), None);
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
        reader.boxes(frame(5, vec![b([1.0, 2.0, 3.0, 4.0]), b([f64::NAN; 4])]), 5, &mut problems);
        reader.boxes(frame(5, vec![]), 6, &mut problems);
        assert_eq!((reader.frames[0].1.boxes.len(), reader.frames[0].1.refused), (1, 1));
        assert!(reader.finish(&Transforms::default(), "road", &mut problems).is_none());
        assert_eq!((problems.count("not finite"), problems.count("does not go on")), (1, 1));
        assert_eq!(problems.count("there is no /camera/info"), 1);
    }

    #[test]
    fn frames_are_read_in_the_order_they_were_logged_in() {
        let header =
            |ns| Header { stamp: super::super::ros::Stamp::from_nanoseconds(ns), frame_id: OPTICAL_FRAME.into() };
        let frame = |time_ns| message(&CameraFrame { time_ns, boxes: Vec::new(), refused: 0 }, &header(time_ns));
        let (mut reader, mut problems) = (CameraReader::default(), Problems::default());
        [3, 1, 2].into_iter().for_each(|ns| reader.boxes(frame(ns), ns + 10, &mut problems));
        let times: Vec<i64> = reader.in_order(&mut problems).iter().map(|f| f.time_ns).collect();
        assert_eq!(times, [1, 2, 3]);
        assert!(problems.is_empty());
    }

    #[test]
    fn binning_and_a_region_are_those_of_the_picture_that_is_sent() {
        let full = Intrinsics { size_px: [1920, 1080], focal_px: [1660.0, 1650.0], center_px: [960.0, 540.0] };
        let header = Header::default();
        let told = CameraInfo { binning_x: 2, binning_y: 3, ..info(&full, &header) };
        let half = Intrinsics { size_px: [960, 360], focal_px: [830.0, 550.0], center_px: [480.0, 180.0] };
        assert_eq!(delivered(&told), half);
        let roi = RegionOfInterest { x_offset: 100, y_offset: 40, width: 800, height: 600, do_rectify: false };
        let told = CameraInfo { binning_x: 2, binning_y: 1, roi, ..info(&full, &header) };
        let cut = Intrinsics { size_px: [400, 600], focal_px: [830.0, 1650.0], center_px: [430.0, 500.0] };
        assert_eq!(delivered(&told), cut);
        assert_eq!(delivered(&info(&full, &header)), full);
        // a place seen at a pixel of the full picture is seen at that of the cut and binned one
        let [u, v] = full.pixel([0.1, 0.05]);
        let [x, y] = cut.pixel([0.1, 0.05]);
        assert!(((u - 100.0) / 2.0 - x).abs() < 1e-9 && (v - 40.0 - y).abs() < 1e-9);
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

//! Bags as other people's tools leave them, from their bytes to what is said of them.

use std::collections::BTreeMap;
use std::io::Cursor;

use super::camera::{self, Box2d, CameraFrame, INFO_TOPIC, Intrinsics, OBJECTS_TOPIC, OPTICAL_FRAME};
use super::mcap::{POINTS_TOPIC, TRUTH_TOPIC, parse};
use super::ros::{
    Detection3D, Detection3DArray, Header, PointCloud2, PointField, Pose, Quaternion, Stamp, TfMessage, Transform,
    TransformStamped, Vector3, encode,
};
use super::{FieldOfView, ReadOptions, Recording, read};

/// Topic, type, its definition, and messages with their times.
type Topic<'a> = (&'a str, &'a str, &'a str, Vec<(i64, Vec<u8>)>);

const POINT_CLOUD: &str = "sensor_msgs/msg/PointCloud2";
const TF: &str = "tf2_msgs/msg/TFMessage";
const BOXES: &str = "vision_msgs/msg/Detection2DArray";

fn bag(topics: &[Topic]) -> Vec<u8> {
    let mut writer = mcap::WriteOptions::new().compression(None).create(Cursor::new(Vec::new())).unwrap();
    for (topic, schema, definition, messages) in topics {
        let schema = writer.add_schema(schema, "ros2msg", definition.as_bytes()).unwrap();
        let channel_id = writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap();
        for (time_ns, data) in messages {
            let log_time = *time_ns as u64;
            let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time, publish_time: 0 };
            writer.write_to_known_channel(&header, data).unwrap();
        }
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn header(time_ns: i64, frame: &str) -> Header {
    Header { stamp: Stamp::from_nanoseconds(time_ns), frame_id: frame.into() }
}

fn mounts(frames: &[&str]) -> Vec<u8> {
    let to = |child: &&str| TransformStamped {
        header: header(0, "road"),
        child_frame_id: (*child).into(),
        transform: Transform {
            translation: Vector3 { x: 0.0, y: 0.0, z: 6.0 },
            rotation: Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 },
        },
    };
    encode(&TfMessage { transforms: frames.iter().map(to).collect() }).unwrap()
}

/// 120 clouds of three vehicles and what stands; velocities and what else a point has by these.
fn clouds(frame: &str, velocity: f64, extra: Option<(&str, f32)>) -> Vec<(i64, Vec<u8>)> {
    let names: Vec<&str> = ["x", "y", "z", "velocity"].into_iter().chain(extra.map(|(name, _)| name)).collect();
    let step = 4 * names.len() as u32;
    let cloud = |k: i64| {
        let time_ns = 1_000_000_000 + k * 66_000_000;
        let mut points: Vec<f32> = Vec::new();
        let mut add = |x: f64, y: f64, speed: f64| {
            let radial = speed * x / x.hypot(y).hypot(5.0);
            points.extend([x as f32, y as f32, -5.0, (velocity * radial) as f32]);
            points.extend(extra.map(|(_, value)| value));
        };
        for (start, lane, speed) in [(20.0, -4.0, 15.0), (35.0, -7.0, 12.0), (190.0, 4.0, -18.0), (160.0, 4.0, -18.0)] {
            let x: f64 = start + speed * 0.066 * k as f64;
            add(x.clamp(5.0, 200.0), lane, speed);
        }
        (0..6).for_each(|post| add(25.0 + 20.0 * f64::from(post), 9.0, 0.0));
        let n = points.len() as u32 * 4;
        let field = |(k, name): (u32, &&str)| PointField { name: (*name).into(), offset: 4 * k, datatype: 7, count: 1 };
        let cloud = PointCloud2 {
            header: header(time_ns, frame),
            height: 1,
            width: n / step,
            fields: (0..).zip(&names).map(field).collect(),
            is_bigendian: false,
            point_step: step,
            row_step: n,
            data: points.iter().flat_map(|v| v.to_le_bytes()).collect(),
            is_dense: true,
        };
        (time_ns, encode(&cloud).unwrap())
    };
    (0..120).map(cloud).collect()
}

fn options() -> ReadOptions {
    let field_of_view = FieldOfView { azimuth_rad: [-1.0, 1.0], elevation_rad: [-0.3, 0.3], range_m: [1.0, 200.0] };
    ReadOptions { field_of_view: Some(field_of_view), ..ReadOptions::default() }
}

fn parsed(topics: &[Topic]) -> Result<Recording, String> {
    parse(&bag(topics), "a".into(), &options()).map_err(|e| format!("{e:#}"))
}

fn said(recording: &Recording) -> String {
    recording.problems.iter().map(|p| p.to_string()).collect::<Vec<_>>().join("\n")
}

/// The recording of a file with this content, with what is judged of it as a whole.
fn whole(test: &str, topics: &[Topic], options: &ReadOptions) -> Recording {
    let path = std::env::temp_dir().join(format!("viewshed-strange-{test}-{}.mcap", std::process::id()));
    std::fs::write(&path, bag(topics)).unwrap();
    let recording = read(&path, options).unwrap();
    std::fs::remove_file(&path).unwrap();
    recording
}

fn radar(messages: Vec<(i64, Vec<u8>)>) -> [Topic<'static>; 2] {
    [("/tf_static", TF, "", vec![(0, mounts(&["radar"]))]), (POINTS_TOPIC, POINT_CLOUD, "", messages)]
}

#[test]
fn velocities_of_another_scale_are_told_and_converted_only_when_asked() {
    let in_km_h = radar(clouds("radar", 3.6, None));
    let as_it_is = whole("km-h", &in_km_h, &options());
    assert!(said(&as_it_is).contains("--velocity-scale 0.2778"), "{}", said(&as_it_is));
    let scaled = whole("scaled", &in_km_h, &ReadOptions { velocity_scale: Some(1.0 / 3.6), ..options() });
    assert!(!said(&scaled).contains("velocit"), "{}", said(&scaled));
    let plain = whole("m-s", &radar(clouds("radar", 1.0, None)), &options());
    assert!(!said(&plain).contains("velocit"), "{}", said(&plain));
    for (a, b) in scaled.frames.iter().zip(&plain.frames).flat_map(|(a, b)| a.detections.iter().zip(&b.detections)) {
        assert!((a.radial_velocity_mps - b.radial_velocity_mps).abs() < 1e-4);
    }
    let zero = whole("zero", &radar(clouds("radar", 0.0, None)), &options());
    assert!(said(&zero).contains("velocities are 0 throughout"), "{}", said(&zero));
}

#[test]
fn fields_that_are_never_filled_are_told_once() {
    for value in [0.0, -128.0, 255.0] {
        let recording = whole("snr", &radar(clouds("radar", 1.0, Some(("snr", value)))), &options());
        assert!(said(&recording).contains(&format!("SNR (or amplitude) is {value} in every")), "{}", said(&recording));
        assert!(recording.frames.iter().flat_map(|f| &f.detections).all(|d| d.snr_db.is_none()));
    }
}

#[test]
fn messages_packed_one_by_one_are_named() {
    let packed = clouds("radar", 1.0, None).into_iter().map(|(time, _)| (time, vec![0x28, 0xB5, 0x2F, 0xFD, 0x20, 1]));
    let error = parsed(&radar(packed.collect())).unwrap_err();
    assert!(error.contains("packed with zstd by itself") && !error.contains("--radar-topic"), "{error}");
}

#[test]
fn a_mount_that_moves_is_not_taken_and_offered() {
    let clouds = || clouds("radar", 1.0, None);
    let on_tf = parsed(&[("/tf", TF, "", vec![(0, mounts(&["radar"]))]), (POINTS_TOPIC, POINT_CLOUD, "", clouds())]);
    assert!(on_tf.unwrap_err().contains("on /tf, which is for what moves"));
    let none = parsed(&[(POINTS_TOPIC, POINT_CLOUD, "", clouds())]).unwrap_err();
    assert!(none.contains("of a split bag only the first part has it"), "{none}");
}

#[test]
fn messages_of_two_frames_on_one_topic_are_told() {
    let mut both = clouds("radar", 1.0, None);
    both.extend(clouds("rear", 1.0, None));
    both.sort_by_key(|(time, _)| *time);
    let recording = parsed(&radar(both)).unwrap();
    assert!(said(&recording).contains("message of frame `rear` among those of `radar`"), "{}", said(&recording));
    assert_eq!(recording.frames.len(), 240, "not joined: they hang elsewhere");
}

#[test]
fn a_camera_of_which_some_messages_cannot_be_read_is_left_out() {
    let intrinsics = Intrinsics::centred([1920, 1080], 1660.0);
    let at = |k: i64| header(1_000_000_000 + k * 66_000_000, OPTICAL_FRAME);
    let boxes = |k: i64| {
        let b = Box2d { class: "car".into(), score: 0.9, edges: [900.0, 700.0, 1000.0, 780.0] };
        let frame = CameraFrame { time_ns: at(k).stamp.nanoseconds(), boxes: vec![b], refused: 0 };
        (frame.time_ns, encode(&camera::message(&frame, &at(k))).unwrap())
    };
    let with = |boxes: Vec<(i64, Vec<u8>)>, definition: &'static str| {
        let info = encode(&camera::info(&intrinsics, &at(0))).unwrap();
        parsed(&[
            ("/tf_static", TF, "", vec![(0, mounts(&["radar", "camera", OPTICAL_FRAME]))]),
            (POINTS_TOPIC, POINT_CLOUD, "", clouds("radar", 1.0, None)),
            (INFO_TOPIC, "sensor_msgs/msg/CameraInfo", "", vec![(1_000_000_000, info)]),
            (OBJECTS_TOPIC, BOXES, definition, boxes),
        ])
        .unwrap()
    };
    let fine = with((0..20).map(boxes).collect(), "vision_msgs/Detection2D[] detections");
    assert!(fine.camera.is_some(), "{}", said(&fine));
    let mut cut: Vec<_> = (0..20).map(boxes).collect();
    cut[3].1.truncate(60);
    let cut = with(cut, "");
    assert!(said(&cut).contains("boxes left out: of a camera whose messages cannot all be read"), "{}", said(&cut));
    for recording in [cut, with((0..20).map(boxes).collect(), "bool is_tracking\nstring tracking_id")] {
        assert!(recording.camera.is_none());
        let said = said(&recording);
        assert!(said.contains("vision_msgs since ROS 2 Humble"), "{said}");
    }
}

#[test]
fn labels_in_a_bag_whose_ids_are_of_several_objects_are_left_out() {
    let origin = Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 };
    let object = |time_ns: i64, id: String, x: f64| Detection3D {
        header: header(time_ns, "road"),
        results: Vec::new(),
        center: Pose { position: Vector3 { x, y: 0.0, z: 0.75 }, orientation: origin },
        size: Vector3 { x: 4.6, y: 1.8, z: 1.5 },
        id,
    };
    let with = |id: fn(i64) -> String| {
        let message = |k: i64| {
            let time_ns = 1_000_000_000 + k * 66_000_000;
            let detections = (0..5).map(|n| object(time_ns, id(n), 20.0 + 20.0 * n as f64 + k as f64)).collect();
            (time_ns, encode(&Detection3DArray { header: header(time_ns, "road"), detections }).unwrap())
        };
        let [tf, points] = radar(clouds("radar", 1.0, None));
        parsed(&[tf, points, (TRUTH_TOPIC, "vision_msgs/msg/Detection3DArray", "", (0..60).map(message).collect())])
            .unwrap()
    };
    let each = with(|n| n.to_string());
    assert_eq!((each.truth.as_ref().map(|t| t.tracks.len()), said(&each).as_str()), (Some(5), ""));
    let none = with(|_| String::new());
    assert!(none.truth.is_none() && said(&none).contains("the labels are left out"), "{}", said(&none));
}

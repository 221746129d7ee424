//! Recordings out: radar and camera frames, mounts and ground truth as an MCAP file by the contract.

use std::collections::BTreeMap;
use std::io::{Seek, Write};

use anyhow::{Context, Result, anyhow};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions, Writer};
use serde::Serialize;

use super::camera::{self, CAMERA_FRAME, CameraFrame, INFO_TOPIC, Intrinsics, OBJECTS_TOPIC, OPTICAL_FRAME};
use super::mcap::{GROUND_METADATA, POINTS_TOPIC, ROAD_FRAME, SENSOR_METADATA, TRUTH_TOPIC, in_topics, points_topic};
use super::ros::{
    Detection3D, Detection3DArray, Header, ObjectHypothesis, ObjectHypothesisWithPose, PointCloud2, PointField, Pose,
    Quaternion, Stamp, TfMessage, Transform, TransformStamped, Vector3, encode,
};
use super::{Frame, RadarDetection, Sensor};
use crate::geometry::ground::Ground;
use crate::geometry::pose::{SensorPose, direction};
use crate::recording::truth::Label;

pub const TF_TOPIC: &str = "/tf_static";
const RADAR_FRAME: &str = "radar";

/// Name and definition of each message type written.
const POINT_CLOUD: (&str, &str) = ("sensor_msgs/msg/PointCloud2", include_str!("msg/PointCloud2.msg"));
const DETECTIONS: (&str, &str) = ("vision_msgs/msg/Detection3DArray", include_str!("msg/Detection3DArray.msg"));
const BOXES: (&str, &str) = ("vision_msgs/msg/Detection2DArray", include_str!("msg/Detection2DArray.msg"));
const CAMERA: (&str, &str) = ("sensor_msgs/msg/CameraInfo", include_str!("msg/CameraInfo.msg"));
const TF: (&str, &str) = ("tf2_msgs/msg/TFMessage", include_str!("msg/TFMessage.msg"));

/// FLOAT32 fields of a point, in this order.
const FIELDS: [&str; 9] = ["x", "y", "z", "range", "azimuth", "elevation", "radial_velocity", "rcs", "snr"];

/// zstd's level and how much is compressed together: small files are worth more here than fast ones.
const COMPRESSION_LEVEL: u32 = 6;
const CHUNK_BYTES: u64 = 4 << 20;

/// Steps of x, y and z, which are there for viewers: range and angles are the measurement.
const VIEWER_STEP_M: f64 = 1.0 / 8.0;

/// Writes one recording, message by message, in the order of time.
pub struct RecordingWriter<W: Write + Seek> {
    writer: Writer<W>,
    /// Topic and frame of each radar.
    radars: Vec<[String; 2]>,
    channels: BTreeMap<String, u16>,
    sequence: u32,
}

impl<W: Write + Seek> RecordingWriter<W> {
    /// Begins a recording of a sensor mounted at `pose` since `start_ns`.
    pub fn new(sink: W, sensor: &Sensor, pose: &SensorPose, start_ns: i64) -> Result<Self> {
        Self::of_several(sink, &[(sensor.clone(), *pose)], None, start_ns)
    }

    /// The same with a camera beside the radar.
    pub fn with_camera(
        sink: W,
        sensor: &Sensor,
        pose: &SensorPose,
        camera: &SensorPose,
        start_ns: i64,
    ) -> Result<Self> {
        Self::of_several(sink, &[(sensor.clone(), *pose)], Some(camera), start_ns)
    }

    /// Begins a recording of a camera without a radar.
    pub fn of_camera(sink: W, camera: &SensorPose, start_ns: i64) -> Result<Self> {
        Self::of_several(sink, &[], Some(camera), start_ns)
    }

    /// Begins a recording of any radars, with their mounts, and perhaps a camera. A single radar writes to [`POINTS_TOPIC`], each of
    /// several to a topic, and with a frame, of its own name.
    pub fn of_several(
        sink: W,
        radars: &[(Sensor, SensorPose)],
        camera: Option<&SensorPose>,
        start_ns: i64,
    ) -> Result<Self> {
        let names: Vec<Option<&str>> =
            radars.iter().map(|(s, _)| (radars.len() > 1).then_some(s.name.as_str())).collect();
        let topics = names.iter().map(|name| match name {
            Some(name) => [points_topic(name), format!("{RADAR_FRAME}_{}", in_topics(name))],
            None => [POINTS_TOPIC.to_owned(), RADAR_FRAME.to_owned()],
        });
        let topics: Vec<[String; 2]> = topics.collect();
        let mut mounts = TfMessage { transforms: Vec::new() };
        for ([_, frame], (_, pose)) in topics.iter().zip(radars) {
            mounts.transforms.extend(mount(pose, frame, start_ns).transforms);
        }
        if let Some(camera) = camera {
            mounts.transforms.extend(mount(camera, CAMERA_FRAME, start_ns).transforms);
            mounts.transforms.push(optical(start_ns));
        }
        let options = WriteOptions::new().profile("ros2").compression(Some(Compression::Zstd));
        // one thread whatever the machine: the bytes must not depend on its processors
        let options = options.compression_level(COMPRESSION_LEVEL).compression_threads(1).chunk_size(Some(CHUNK_BYTES));
        let mut writer = options.create(sink)?;
        for ((sensor, _), name) in radars.iter().zip(&names) {
            let Metadata { name: record, metadata } = sensor_metadata(sensor);
            let name = name.map_or(record.clone(), |name| format!("{record}.{}", in_topics(name)));
            writer.write_metadata(&Metadata { name, metadata })?;
        }
        let mut recording = Self { writer, radars: topics, channels: BTreeMap::new(), sequence: 0 };
        recording.message(TF_TOPIC, TF, start_ns, &mounts)?;
        Ok(recording)
    }

    /// Says that the road is not flat.
    pub fn ground(&mut self, ground: &Ground) -> Result<()> {
        let points = serde_json::to_string(ground.points())?;
        let metadata = BTreeMap::from([("points_m".to_owned(), points)]);
        Ok(self.writer.write_metadata(&Metadata { name: GROUND_METADATA.into(), metadata })?)
    }

    /// A frame of the first radar.
    pub fn frame(&mut self, frame: &Frame) -> Result<()> {
        self.frame_of(0, frame)
    }

    /// A frame of any radar, by its place among them. One of which every point was refused or left out is not written:
    /// read back, a cloud without points would be a radar that looks and sees nothing.
    pub fn frame_of(&mut self, radar: usize, frame: &Frame) -> Result<()> {
        if frame.detections.is_empty() && (frame.refused > 0 || !frame.unwanted.is_empty()) {
            return Ok(());
        }
        let [topic, frame_id] = self.radars.get(radar).context("a frame of no radar")?.clone();
        self.message(&topic, POINT_CLOUD, frame.time_ns, &cloud(frame, &frame_id))
    }

    /// A camera's boxes, and the camera with them.
    pub fn camera_frame(&mut self, frame: &CameraFrame, intrinsics: &Intrinsics) -> Result<()> {
        let header = Header { stamp: Stamp::from_nanoseconds(frame.time_ns), frame_id: OPTICAL_FRAME.into() };
        self.message(INFO_TOPIC, CAMERA, frame.time_ns, &camera::info(intrinsics, &header))?;
        self.message(OBJECTS_TOPIC, BOXES, frame.time_ns, &camera::message(frame, &header))
    }

    /// All objects of one instant; the labels' own times are not written.
    pub fn objects<'a>(&mut self, time_ns: i64, labels: impl IntoIterator<Item = &'a Label>) -> Result<()> {
        let header = Header { stamp: Stamp::from_nanoseconds(time_ns), frame_id: ROAD_FRAME.into() };
        let detections = labels.into_iter().map(|l| detection(&header, l)).collect();
        self.message(TRUTH_TOPIC, DETECTIONS, time_ns, &Detection3DArray { header, detections })
    }

    /// Completes the file and gives back what it was written to.
    pub fn finish(mut self) -> Result<W> {
        self.writer.finish()?;
        Ok(self.writer.into_inner())
    }

    fn message<T: Serialize>(
        &mut self,
        topic: &str,
        (schema, definition): (&str, &str),
        time_ns: i64,
        message: &T,
    ) -> Result<()> {
        let channel_id = match self.channels.get(topic) {
            Some(&id) => id,
            None => {
                let schema = self.writer.add_schema(schema, "ros2msg", definition.as_bytes())?;
                let id = self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new())?;
                self.channels.insert(topic.to_owned(), id);
                id
            }
        };
        let data = encode(message).map_err(|e| anyhow!("cannot encode a message for {topic}: {e}"))?;
        // times before 1970 have no place in a recording
        let time = u64::try_from(time_ns).unwrap_or(0);
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
        self.sequence = self.sequence.wrapping_add(1);
        Ok(self.writer.write_to_known_channel(&header, &data)?)
    }
}

/// Name, encoding and text of the `/tf_static` schema, and the message itself, ready to be written.
pub fn mount_message(pose: &SensorPose, frame_id: &str, time_ns: i64) -> Result<(&'static str, &'static str, Vec<u8>)> {
    let data = encode(&mount(pose, frame_id, time_ns)).map_err(|e| anyhow!("cannot encode the mount: {e}"))?;
    Ok((TF.0, TF.1, data))
}

fn mount(pose: &SensorPose, frame_id: &str, time_ns: i64) -> TfMessage {
    let [x, y, z] = pose.position;
    TfMessage {
        transforms: vec![TransformStamped {
            header: Header { stamp: Stamp::from_nanoseconds(time_ns), frame_id: ROAD_FRAME.into() },
            child_frame_id: frame_id.to_owned(),
            transform: Transform { translation: Vector3 { x, y, z }, rotation: quaternion(pose) },
        }],
    }
}

/// From the camera's x ahead to the optical z ahead, x right, y down.
fn optical(time_ns: i64) -> TransformStamped {
    TransformStamped {
        header: Header { stamp: Stamp::from_nanoseconds(time_ns), frame_id: CAMERA_FRAME.into() },
        child_frame_id: OPTICAL_FRAME.to_owned(),
        transform: Transform {
            translation: Vector3::default(),
            rotation: Quaternion { x: -0.5, y: 0.5, z: -0.5, w: 0.5 },
        },
    }
}

/// Yaw, then pitch, then roll (REP-103).
fn quaternion(pose: &SensorPose) -> Quaternion {
    let (sy, cy) = (pose.yaw_rad() / 2.0).sin_cos();
    let (sp, cp) = (pose.pitch_rad() / 2.0).sin_cos();
    let (sr, cr) = (pose.roll_rad() / 2.0).sin_cos();
    Quaternion {
        x: sr * cp * cy - cr * sp * sy,
        y: cr * sp * cy + sr * cp * sy,
        z: cr * cp * sy - sr * sp * cy,
        w: cr * cp * cy + sr * sp * sy,
    }
}

/// The metadata record of a sensor.
pub fn sensor_metadata(sensor: &Sensor) -> Metadata {
    let view = &sensor.field_of_view;
    let mut map = BTreeMap::from([
        ("name".to_owned(), sensor.name.clone()),
        ("has_elevation".to_owned(), sensor.has_elevation.to_string()),
    ]);
    for (what, unit, limits) in
        [("azimuth", "rad", view.azimuth_rad), ("elevation", "rad", view.elevation_rad), ("range", "m", view.range_m)]
    {
        for (end, value) in ["min", "max"].iter().zip(limits) {
            map.insert(format!("{what}_{end}_{unit}"), value.to_string());
        }
    }
    if sensor.frames_independent {
        map.insert("frames_independent".into(), "true".into());
    }
    if sensor.platform_moving {
        map.insert("platform".into(), "moving".into());
    }
    if sensor.synthetic {
        map.insert("synthetic".into(), "true".into());
    }
    map.extend(sensor.licence.iter().map(|l| ("licence".to_owned(), l.clone())));
    Metadata { name: SENSOR_METADATA.into(), metadata: map }
}

fn cloud(frame: &Frame, frame_id: &str) -> PointCloud2 {
    let point_step = 4 * FIELDS.len() as u32;
    let width = frame.detections.len() as u32;
    let field = |(name, offset): (&&str, u32)| PointField {
        name: (*name).to_owned(),
        offset,
        datatype: PointField::FLOAT32,
        count: 1,
    };
    PointCloud2 {
        header: Header { stamp: Stamp::from_nanoseconds(frame.time_ns), frame_id: frame_id.to_owned() },
        height: 1,
        width,
        fields: FIELDS.iter().zip((0..).step_by(4)).map(field).collect(),
        is_bigendian: false,
        point_step,
        row_step: point_step * width,
        data: frame.detections.iter().flat_map(point).flat_map(f32::to_le_bytes).collect(),
        is_dense: true,
    }
}

fn point(d: &RadarDetection) -> [f32; FIELDS.len()] {
    let unit = direction(f64::from(d.azimuth_rad), f64::from(d.elevation_rad.unwrap_or(0.0)));
    let [x, y, z] = unit.map(|u| ((u * f64::from(d.range_m) / VIEWER_STEP_M).round() * VIEWER_STEP_M) as f32);
    let or_nan = |v: Option<f32>| v.unwrap_or(f32::NAN);
    let (elevation, rcs, snr) = (or_nan(d.elevation_rad), or_nan(d.rcs_dbsm), or_nan(d.snr_db));
    [x, y, z, d.range_m, d.azimuth_rad, elevation, d.radial_velocity_mps, rcs, snr]
}

fn detection(header: &Header, label: &Label) -> Detection3D {
    let vector = |[x, y, z]: [f64; 3]| Vector3 { x, y, z };
    let pose = Pose { position: vector(label.solid.center), orientation: Quaternion::from_yaw(label.solid.yaw_rad) };
    let hypothesis = ObjectHypothesis { class_id: label.class.clone(), score: 1.0 };
    Detection3D {
        header: header.clone(),
        results: vec![ObjectHypothesisWithPose { hypothesis, pose, covariance: Default::default() }],
        center: pose,
        size: vector(label.solid.size),
        id: label.id.clone(),
    }
}

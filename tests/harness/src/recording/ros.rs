//! The ROS 2 messages a recording carries, as CDR lays them out.

use byteorder::{BigEndian, LittleEndian};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Stamp {
    pub sec: i32,
    pub nanosec: u32,
}

impl Stamp {
    pub fn from_nanoseconds(ns: i64) -> Self {
        Self { sec: ns.div_euclid(1_000_000_000) as i32, nanosec: ns.rem_euclid(1_000_000_000) as u32 }
    }

    pub fn nanoseconds(&self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }
}

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Header {
    pub stamp: Stamp,
    pub frame_id: String,
}

/// `sensor_msgs/msg/PointField`
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PointField {
    pub name: String,
    pub offset: u32,
    pub datatype: u8,
    pub count: u32,
}

impl PointField {
    pub const FLOAT32: u8 = 7;
    pub const FLOAT64: u8 = 8;
}

/// `sensor_msgs/msg/PointCloud2`
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PointCloud2 {
    pub header: Header,
    pub height: u32,
    pub width: u32,
    pub fields: Vec<PointField>,
    pub is_bigendian: bool,
    pub point_step: u32,
    pub row_step: u32,
    pub data: Vec<u8>,
    pub is_dense: bool,
}

/// `radar_msgs/msg/RadarScan`
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct RadarScan {
    pub header: Header,
    pub returns: Vec<RadarReturn>,
}

/// `radar_msgs/msg/RadarReturn`; azimuth + anticlockwise, Doppler + receding
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct RadarReturn {
    pub range: f32,
    pub azimuth: f32,
    pub elevation: f32,
    pub doppler_velocity: f32,
    pub amplitude: f32,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

impl Quaternion {
    pub fn from_yaw(yaw_rad: f64) -> Self {
        let (s, c) = (yaw_rad / 2.0).sin_cos();
        Self { x: 0.0, y: 0.0, z: s, w: c }
    }

    pub fn yaw_rad(&self) -> f64 {
        let Self { x, y, z, w } = *self;
        (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    pub position: Vector3,
    pub orientation: Quaternion,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Transform {
    pub translation: Vector3,
    pub rotation: Quaternion,
}

/// `geometry_msgs/msg/TransformStamped`
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    pub transform: Transform,
}

/// `tf2_msgs/msg/TFMessage`
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TfMessage {
    pub transforms: Vec<TransformStamped>,
}

/// Row-major 6 x 6 covariance; in halves because serde's arrays end at 32.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Covariance([f64; 18], [f64; 18]);

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ObjectHypothesis {
    pub class_id: String,
    pub score: f64,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ObjectHypothesisWithPose {
    pub hypothesis: ObjectHypothesis,
    pub pose: Pose,
    pub covariance: Covariance,
}

/// `vision_msgs/msg/Detection3D`
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Detection3D {
    pub header: Header,
    pub results: Vec<ObjectHypothesisWithPose>,
    pub center: Pose,
    pub size: Vector3,
    pub id: String,
}

/// `vision_msgs/msg/Detection3DArray`
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Detection3DArray {
    pub header: Header,
    pub detections: Vec<Detection3D>,
}

/// `vision_msgs/msg/BoundingBox2D`
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BoundingBox2D {
    /// Middle, pixels.
    pub center: [f64; 2],
    pub theta: f64,
    pub size: [f64; 2],
}

/// `vision_msgs/msg/Detection2D`
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Detection2D {
    pub header: Header,
    pub results: Vec<ObjectHypothesisWithPose>,
    pub bbox: BoundingBox2D,
    pub id: String,
}

/// `vision_msgs/msg/Detection2DArray`
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Detection2DArray {
    pub header: Header,
    pub detections: Vec<Detection2D>,
}

/// `sensor_msgs/msg/RegionOfInterest`
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct RegionOfInterest {
    pub x_offset: u32,
    pub y_offset: u32,
    pub height: u32,
    pub width: u32,
    pub do_rectify: bool,
}

/// `sensor_msgs/msg/CameraInfo`
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct CameraInfo {
    pub header: Header,
    pub height: u32,
    pub width: u32,
    pub distortion_model: String,
    pub d: Vec<f64>,
    pub k: [f64; 9],
    pub r: [f64; 9],
    pub p: [f64; 12],
    pub binning_x: u32,
    pub binning_y: u32,
    pub roi: RegionOfInterest,
}

/// What packed data begins with; no CDR header is this.
const ZSTD: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];

/// Of messages that are packed one by one.
pub const PACKED: &str = "packed with zstd by itself, as `ros2 bag record --compression-mode message` does; unpack the bag with `ros2 bag convert`, or record with --compression-mode file or none";

/// Decodes a CDR message with its four-byte encapsulation header.
pub fn decode<T: DeserializeOwned>(data: &[u8]) -> Result<T, String> {
    if data.starts_with(&ZSTD) {
        return Err(PACKED.into());
    }
    let (header, body) = data.split_at_checked(4).ok_or("shorter than the CDR header")?;
    let decoded = match header[1] {
        0 => cdr_encoding::from_bytes::<T, BigEndian>(body),
        1 => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        other => return Err(format!("CDR representation {other:#04x} is not plain CDR")),
    };
    decoded.map(|(message, _)| message).map_err(|e| e.to_string())
}

/// Encodes a message as little-endian CDR with its header.
pub fn encode<T: Serialize>(message: &T) -> Result<Vec<u8>, String> {
    let mut data = vec![0, 1, 0, 0];
    data.extend(cdr_encoding::to_vec::<T, LittleEndian>(message).map_err(|e| e.to_string())?);
    Ok(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_survives_the_wire_and_a_cut_one_is_an_error() {
        let scan = RadarScan {
            header: Header { stamp: Stamp::from_nanoseconds(-1), frame_id: "radar".into() },
            returns: vec![RadarReturn {
                range: 1.0,
                azimuth: 2.0,
                elevation: 3.0,
                doppler_velocity: 4.0,
                amplitude: 5.0,
            }],
        };
        let bytes = encode(&scan).unwrap();
        let back: RadarScan = decode(&bytes).unwrap();
        assert_eq!(back.header.stamp.nanoseconds(), -1);
        assert_eq!(back.returns[0].amplitude, 5.0);
        for cut in 0..bytes.len() {
            assert!(decode::<RadarScan>(&bytes[..cut]).is_err(), "cut at {cut}");
        }
    }
}

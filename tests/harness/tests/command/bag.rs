//! Bags of other drivers, written by the crate `mcap`.

use std::collections::BTreeMap;
use std::io::Cursor;

use viewshed_harness::recording::ros::{
    Header, PointCloud2, PointField, Quaternion, Stamp, TfMessage, Transform, TransformStamped, Vector3, encode,
};

use crate::scene::Scene;

/// A bag of somebody's driver: clouds with these fields of each detection, in a frame of its own.
#[derive(Clone)]
pub struct Bag {
    pub topics: Vec<&'static str>,
    pub fields: Vec<&'static str>,
    pub encoding: &'static str,
    pub schema: &'static str,
    pub road: &'static str,
    pub velocity_sign: f32,
}

impl Default for Bag {
    fn default() -> Self {
        Self {
            topics: vec!["/sensing/front/cloud"],
            fields: vec!["x", "y", "z", "doppler"],
            encoding: "cdr",
            schema: "sensor_msgs/msg/PointCloud2",
            road: "road",
            velocity_sign: 1.0,
        }
    }
}

impl Bag {
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        let mut writer = mcap::Writer::new(&mut bytes).unwrap();
        self.write(&mut writer);
        writer.finish().unwrap();
        drop(writer);
        bytes.into_inner()
    }

    pub fn write(&self, writer: &mut mcap::Writer<&mut Cursor<Vec<u8>>>) {
        let scene = Scene::default();
        let mut channel = |topic: &str, schema: &str| {
            let schema = writer.add_schema(schema, "ros2msg", b"").unwrap();
            writer.add_channel(schema, topic, self.encoding, &BTreeMap::new()).unwrap()
        };
        let mut sent: Vec<(u16, i64, Vec<u8>)> = Vec::new();
        let p = &scene.pose;
        let half = p.pitch_rad() / 2.0;
        let mount = Transform {
            translation: Vector3 { x: p.position[0], y: p.position[1], z: p.position[2] },
            rotation: Quaternion { x: 0.0, y: half.sin(), z: 0.0, w: half.cos() },
        };
        let header = |frame: &str| Header { frame_id: frame.into(), ..Header::default() };
        let tf = TransformStamped { header: header(self.road), child_frame_id: "front".into(), transform: mount };
        let tf = encode(&TfMessage { transforms: vec![tf] }).unwrap();
        sent.push((channel("/tf_static", "tf2_msgs/msg/TFMessage"), scene.steps[0].0.time_ns, tf));
        for topic in &self.topics {
            let channel_id = channel(topic, self.schema);
            for (frame, _) in &scene.steps {
                let values = frame.detections.iter().flat_map(|d| {
                    let (r, a, e) = (d.range_m, d.azimuth_rad, d.elevation_rad.unwrap());
                    self.fields.iter().map(move |field| match *field {
                        "x" => r * e.cos() * a.cos(),
                        "y" => r * e.cos() * a.sin(),
                        "z" => r * e.sin(),
                        "range" => r,
                        "azimuth" => a,
                        "elevation" => e,
                        _ => self.velocity_sign * d.radial_velocity_mps,
                    })
                });
                let step = 4 * self.fields.len() as u32;
                let width = frame.detections.len() as u32;
                let field =
                    |(k, name): (u32, &&str)| PointField { name: (*name).into(), offset: 4 * k, datatype: 7, count: 1 };
                let cloud = PointCloud2 {
                    header: Header { stamp: Stamp::from_nanoseconds(frame.time_ns), frame_id: "front".into() },
                    height: 1,
                    width,
                    fields: (0..).zip(&self.fields).map(field).collect(),
                    is_bigendian: false,
                    point_step: step,
                    row_step: step * width,
                    data: values.flat_map(f32::to_le_bytes).collect(),
                    is_dense: true,
                };
                sent.push((channel_id, frame.time_ns, encode(&cloud).unwrap()));
            }
        }
        for (channel_id, at, data) in sent {
            let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: at as u64, publish_time: 0 };
            writer.write_to_known_channel(&header, &data).unwrap();
        }
    }
}

//! The input's own messages, raw, to be copied beside the grids.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use anyhow::{Result, anyhow};
use mcap::records::{MessageHeader, Record};

use crate::recording::write::RecordingWriter;
use crate::recording::{Recording, file, ros};

/// A channel worth copying.
#[derive(Debug, Clone)]
pub struct Channel {
    pub topic: String,
    pub message_encoding: String,
    pub metadata: BTreeMap<String, String>,
    pub schema_name: String,
    pub schema_encoding: String,
    pub schema_data: Vec<u8>,
}

/// One message as it stands in the input.
#[derive(Debug, Clone)]
pub struct RawMessage {
    pub header: MessageHeader,
    pub data: Vec<u8>,
}

/// Channels by the input's number, and their messages in the order of the file.
#[derive(Debug, Default)]
pub struct Input {
    pub channels: BTreeMap<u16, Channel>,
    pub messages: Vec<RawMessage>,
}

/// The bytes of a recording as an MCAP file; one of another kind is written as such first.
pub fn bytes(path: &Path, recording: &Recording) -> Result<Vec<u8>> {
    let bytes = file::bytes(path)?;
    if bytes.starts_with(mcap::MAGIC) {
        return Ok(bytes);
    }
    let start_ns = recording.frames.first().map_or(0, |f| f.time_ns);
    let sink = Cursor::new(Vec::new());
    if let Some(camera) = recording.of_camera() {
        let pose = &recording.pose;
        let mut writer = RecordingWriter::with_camera(sink, &recording.sensor, pose, &camera.pose, start_ns)?;
        camera.frames.iter().try_for_each(|frame| writer.camera_frame(frame, &camera.intrinsics))?;
        return Ok(writer.finish()?.into_inner());
    }
    let mut writer = RecordingWriter::new(sink, &recording.sensor, &recording.pose, start_ns)?;
    recording.frames.iter().try_for_each(|frame| writer.frame(frame))?;
    Ok(writer.finish()?.into_inner())
}

/// Reads every message whose topic (and schema) `keep` accepts; a damaged file up to the break.
pub fn read(bytes: &[u8], keep: impl Fn(&str, &str) -> bool) -> Result<Input> {
    let options = mcap::read::Options::IgnoreEndMagic.into();
    let records =
        mcap::read::ChunkFlattener::new_with_options(bytes, options).map_err(|e| anyhow!("not an MCAP file: {e}"))?;
    let mut schemas = BTreeMap::new();
    let mut input = Input::default();
    for record in records.map_while(Result::ok) {
        match record {
            Record::Schema { header, data } => {
                schemas.insert(header.id, (header.name, header.encoding, data.into_owned()));
            }
            Record::Channel(c) => {
                let (schema_name, schema_encoding, schema_data) =
                    schemas.get(&c.schema_id).cloned().unwrap_or_default();
                if keep(&c.topic, &schema_name) {
                    input.channels.entry(c.id).or_insert(Channel {
                        topic: c.topic,
                        message_encoding: c.message_encoding,
                        metadata: c.metadata,
                        schema_name,
                        schema_encoding,
                        schema_data,
                    });
                }
            }
            Record::Message { header, data } if input.channels.contains_key(&header.channel_id) => {
                input.messages.push(RawMessage { header, data: data.into_owned() });
            }
            _ => {}
        }
    }
    Ok(input)
}

impl RawMessage {
    /// Stamp of a message that begins with a ROS header, as the reader takes it: log time where it is 0.
    pub fn stamp_ns(&self) -> Option<i64> {
        let stamp = self.ros_header()?.stamp.nanoseconds();
        Some(if stamp == 0 { self.header.log_time as i64 } else { stamp })
    }

    pub fn ros_header(&self) -> Option<ros::Header> {
        ros::decode(&self.data).ok()
    }
}

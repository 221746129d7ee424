//! A recording with an estimator's map beside it, as an MCAP file for Foxglove.
//!
//! Radar points or a camera's boxes, its pictures, mount and ground truth are copied as they are; after each radar
//! message comes the map of that frame as a `foxglove.Grid` (JSON) on `/visibility/ESTIMATOR`, the labelled boxes
//! coloured by outcome on `/visibility/ESTIMATOR/boxes`, and figures to plot on `/visibility/ESTIMATOR/counts`. The
//! [`layout`] beside the file opens panels for them.

mod geometry;
pub mod grid;
pub mod input;
pub mod layout;
mod scene;

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};

use crate::estimators::Estimator;
use crate::geometry::pose::SensorPose;
use crate::recording::camera::{INFO_TOPIC, OBJECTS_TOPIC};
use crate::recording::mcap::{POINTS_TOPIC, TRUTH_TOPIC};
use crate::recording::write::{TF_TOPIC, mount_message, sensor_metadata};
use crate::recording::{ReadOptions, Recording, Sensor};
use crate::results::files::{Target, Unfinished};
use crate::results::pictures::scene::TruthBox;
use input::{Input, RawMessage};
use layout::Topics;

const RADAR_SCAN: &str = "radar_msgs/msg/RadarScan";
const POINT_CLOUD: &str = "sensor_msgs/msg/PointCloud2";
const IMAGES: [&str; 2] = ["sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"];

/// The labelled boxes of a frame.
pub type Boxes<'a> = &'a dyn Fn(usize) -> Vec<TruthBox>;

/// Writes the estimator's maps over `recording`, read from `source` with `options`, to `target`, and a layout that shows
/// them to `layout`.
///
/// `progress` is called after each frame.
///
/// # Errors
/// Files that cannot be read or written, and a field of view too large for a grid.
pub fn write(
    source: &Path,
    [target, layout]: [&Target; 2],
    recording: &Recording,
    options: &ReadOptions,
    estimator: &mut dyn Estimator,
    boxes: Boxes<'_>,
    progress: &dyn Fn(),
) -> Result<()> {
    let extent = grid::Extent::covering(recording)?;
    let of_camera = recording.of_camera().is_some();
    // the messages frames are made of
    let is_radar = |topic: &str, schema: &str| {
        if of_camera {
            return topic == OBJECTS_TOPIC;
        }
        options.radar_topic.as_deref().unwrap_or(POINTS_TOPIC) == topic
            || (options.radar_topic.is_none() && schema == RADAR_SCAN)
    };
    let is_truth = |topic: &str| options.truth_topic.as_deref().unwrap_or(TRUTH_TOPIC) == topic;
    // a mount given by hand stands in place of the one recorded
    let is_mount = |topic: &str| options.mount.is_none() && topic.ends_with("tf_static");
    let bytes = input::bytes(source, recording)?;
    let input = input::read(&bytes, |topic, schema| {
        is_radar(topic, schema)
            || is_truth(topic)
            || is_mount(topic)
            || (of_camera && topic == INFO_TOPIC)
            || IMAGES.contains(&schema)
    })?;
    let radar =
        |m: &RawMessage| input.channels.get(&m.header.channel_id).is_some_and(|c| is_radar(&c.topic, &c.schema_name));
    let mount = |m: &RawMessage| input.channels.get(&m.header.channel_id).is_some_and(|c| is_mount(&c.topic));
    let frames = frames_of(&input, recording, radar);
    let played =
        input.messages.iter().zip(&frames).filter(|(_, frame)| frame.is_some()).map(|(m, _)| m.header.log_time);
    let (first, last) = (played.clone().min().unwrap_or(0), played.max().unwrap_or(u64::MAX));

    let own = topics(&input, estimator.name(), recording.truth.is_some());
    let mut output = Output::new(target.create()?, &input, &recording.sensor, &own)?;
    if options.mount.is_some() {
        let seen = input.messages.iter().zip(&frames).find(|(_, frame)| frame.is_some());
        let frame_id = seen.and_then(|(m, _)| m.ros_header()).map_or_else(|| "radar".into(), |h| h.frame_id);
        output.mount(&recording.pose, &frame_id, first)?;
    }
    for (message, frame) in input.messages.iter().zip(&frames) {
        if !mount(message) && !(first..=last).contains(&message.header.log_time) {
            continue;
        }
        output.copy(message)?;
        if let Some((k, frame)) = frame.and_then(|k| Some((k, recording.frames.get(k)?))) {
            if recording.sensor.frames_independent {
                estimator.reset();
            }
            estimator.step(frame);
            let (map, time_ns) = (estimator.map(), frame.time_ns);
            let boxes = boxes(k);
            output.say(Said::Map, message.header.log_time, &grid::message(map, extent, time_ns)?)?;
            if own.boxes.is_some() {
                output.say(Said::Boxes, message.header.log_time, &scene::boxes(&boxes, time_ns)?)?;
            }
            let counts = scene::counts(map, extent, &boxes, frame.detections.len(), time_ns)?;
            output.say(Said::Counts, message.header.log_time, &counts)?;
            progress();
        }
    }
    output.writer.finish().with_context(|| format!("cannot write {}", target.path().display()))?;
    output.writer.into_inner().finish()?;
    let panels = layout::layout(&own, extent);
    layout.write(serde_json::to_string_pretty(&panels).context("the layout as JSON")? + "\n")
}

/// What there will be to see.
fn topics(input: &Input, estimator: &str, labelled: bool) -> Topics {
    let map = format!("/visibility/{estimator}");
    let of = |schemas: &[&str]| {
        let own = input.channels.values().filter(|c| schemas.contains(&c.schema_name.as_str()));
        own.map(|c| c.topic.clone()).collect()
    };
    Topics {
        boxes: labelled.then(|| format!("{map}/boxes")),
        counts: format!("{map}/counts"),
        points: of(&[POINT_CLOUD, RADAR_SCAN]),
        images: of(&IMAGES),
        map,
    }
}

/// Which frame each message became: frames are the readable radar messages, in their order.
fn frames_of(input: &Input, recording: &Recording, radar: impl Fn(&RawMessage) -> bool) -> Vec<Option<usize>> {
    let mut next = 0;
    let frame = |message: &RawMessage| {
        let wanted = recording.frames.get(next)?.time_ns;
        (radar(message) && message.stamp_ns() == Some(wanted)).then(|| {
            next += 1;
            next - 1
        })
    };
    input.messages.iter().map(frame).collect()
}

/// The file being written.
struct Output {
    writer: Writer<Unfinished>,
    /// Channels of the input by its number.
    copied: BTreeMap<u16, u16>,
    /// Channels of what is said of each frame, in the order of [`Said`].
    said: [u16; 3],
    sequence: u32,
}

/// What is said of each frame.
#[derive(Clone, Copy)]
enum Said {
    Map,
    Boxes,
    Counts,
}

impl Output {
    /// The sensor as it was used goes along, so that the copy can be replayed too.
    fn new(sink: Unfinished, input: &Input, sensor: &Sensor, own: &Topics) -> Result<Self> {
        let mut writer = WriteOptions::new().compression(Some(Compression::Zstd)).create(sink)?;
        writer.write_metadata(&sensor_metadata(sensor))?;
        let mut copied = BTreeMap::new();
        for (&id, c) in &input.channels {
            let schema = match c.schema_name.as_str() {
                "" => 0,
                name => writer.add_schema(name, &c.schema_encoding, &c.schema_data)?,
            };
            copied.insert(id, writer.add_channel(schema, &c.topic, &c.message_encoding, &c.metadata)?);
        }
        let mut channel = |name: &str, schema: &str, topic: Option<&str>| -> Result<u16> {
            let Some(topic) = topic else { return Ok(0) };
            let schema = writer.add_schema(name, "jsonschema", schema.as_bytes())?;
            Ok(writer.add_channel(schema, topic, "json", &BTreeMap::new())?)
        };
        let said = [
            channel(grid::SCHEMA_NAME, grid::SCHEMA, Some(&own.map))?,
            channel(scene::SCENE_SCHEMA_NAME, scene::SCENE_SCHEMA, own.boxes.as_deref())?,
            channel(scene::COUNTS_SCHEMA_NAME, scene::COUNTS_SCHEMA, Some(&own.counts))?,
        ];
        Ok(Self { writer, copied, said, sequence: 0 })
    }

    fn copy(&mut self, message: &RawMessage) -> Result<()> {
        if let Some(&channel_id) = self.copied.get(&message.header.channel_id) {
            let header = MessageHeader { channel_id, ..message.header };
            self.writer.write_to_known_channel(&header, &message.data)?;
        }
        Ok(())
    }

    fn say(&mut self, what: Said, log_time: u64, data: &[u8]) -> Result<()> {
        let channel_id = self.said[what as usize];
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time, publish_time: log_time };
        self.sequence = self.sequence.wrapping_add(1);
        Ok(self.writer.write_to_known_channel(&header, data)?)
    }

    /// The mount in use, from the road to the frame the radar's messages name.
    fn mount(&mut self, pose: &SensorPose, frame_id: &str, log_time: u64) -> Result<()> {
        let (schema, definition, data) = mount_message(pose, frame_id, log_time as i64)?;
        let schema = self.writer.add_schema(schema, "ros2msg", definition.as_bytes())?;
        let channel_id = self.writer.add_channel(schema, TF_TOPIC, "cdr", &BTreeMap::new())?;
        let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
        Ok(self.writer.write_to_known_channel(&header, &data)?)
    }
}

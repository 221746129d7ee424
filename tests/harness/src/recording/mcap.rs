//! Recordings from MCAP files (profile `ros2`, CDR messages).

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, Result, anyhow, bail};
use mcap::records::{MessageHeader, Record};
use viewshed::camera::Camera3dConfig;

use super::camera::{CameraReader, INFO_TOPIC, OBJECTS_TOPIC};
use super::container::{self, Item};
use super::points::{self, Points};
use super::problems::Problems;
use super::ros::{self, CameraInfo, Detection2DArray, Detection3DArray, PointCloud2, RadarScan, TfMessage};
use super::scans::{self, Message};
use super::transforms::Transforms;
use super::{FieldOfView, Frame, ReadOptions, Recording, Sensor, picture};
use crate::geometry::ground::Ground;
use crate::geometry::pose::SensorPose;
use crate::geometry::solid::Solid;
use crate::recording::truth::{self, Label, Truth};

pub const POINTS_TOPIC: &str = "/radar/points";
pub const TRUTH_TOPIC: &str = "/ground_truth/objects";
pub const ROAD_FRAME: &str = "road";
pub const SENSOR_METADATA: &str = "viewshed.sensor";
/// Its `points_m` is a list of [x, height] in the road frame, metres: the road where it is not flat.
pub const GROUND_METADATA: &str = "viewshed.ground";

/// Topic of one of several radars, by its name.
pub fn points_topic(name: &str) -> String {
    format!("/radar/{}/points", in_topics(name))
}

/// A name as topics, frames and records have it: small letters, digits and `_`.
pub fn in_topics(name: &str) -> String {
    let letter = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
    name.chars().map(letter).collect::<String>().trim_matches('_').to_owned()
}

const POINT_CLOUD: &str = "sensor_msgs/msg/PointCloud2";
const RADAR_SCAN: &str = "radar_msgs/msg/RadarScan";
const DETECTIONS: &str = "vision_msgs/msg/Detection3DArray";
const BOXES: &str = "vision_msgs/msg/Detection2DArray";
const CAMERA_INFO: &str = "sensor_msgs/msg/CameraInfo";
const TF: &str = "tf2_msgs/msg/TFMessage";

/// Sides an object may have.
const SIZE_M: std::ops::RangeInclusive<f64> = 0.01..=100.0;
/// Distance from the origin of the road an object may have.
const FARTHEST_M: f64 = 1e5;

/// What messages are in that are read.
const ENCODING: &str = "cdr";

#[derive(Debug, Clone)]
struct Topic {
    name: String,
    schema: String,
    encoding: String,
    is_older: bool,
    messages: u64,
}

impl Topic {
    fn is_same(&self, other: &Self) -> bool {
        (&self.name, &self.schema, &self.encoding) == (&other.name, &other.schema, &other.encoding)
    }

    /// Whether its messages are of a radar, by their type; ROS 1 leaves the `/msg` out.
    fn is_of_a_radar(&self) -> bool {
        let schema = self.schema.replace("/msg/", "/");
        [POINT_CLOUD, RADAR_SCAN].iter().any(|known| known.replace("/msg/", "/") == schema)
    }
}

/// A message type.
#[derive(Debug, Clone, Default)]
struct Schema {
    name: String,
    /// Its definition has fields of vision_msgs before 4.0.
    is_older: bool,
}

/// What is said of vision_msgs before 4.0, whose messages are laid out otherwise.
const OLDER: &str = "its layout is not that of vision_msgs since ROS 2 Humble (4.0) but perhaps of an older release (Galactic, Foxy); send it with the newer definition";

/// Fields that vision_msgs had before 4.0.
const OLDER_FIELDS: [&str; 4] = ["is_tracking", "tracking_id", "source_img", "source_cloud"];

#[derive(Default)]
struct Reader {
    radar_topic: Option<String>,
    truth_topic: Option<String>,
    /// Whether a file has begun, and whether a record was read.
    begun: bool,
    any: bool,
    schemas: BTreeMap<u16, Schema>,
    /// Places in `topics` by the numbers of the file that is read.
    channels: BTreeMap<u16, usize>,
    topics: Vec<Topic>,
    /// Records of [`SENSOR_METADATA`].
    metadata: Vec<BTreeMap<String, String>>,
    /// What [`GROUND_METADATA`] says.
    ground: Option<String>,
    transforms: Transforms,
    /// Those of `/tf`.
    moving: Transforms,
    radar_frame: Option<String>,
    topics_of_frames: BTreeSet<String>,
    messages: Vec<Message>,
    frames: Vec<Frame>,
    labels: Vec<Label>,
    labelled: bool,
    camera: CameraReader,
    problems: Problems,
}

/// Topics with messages of a radar, by what is in their first; sorted.
///
/// A lidar's clouds, which have no velocity, are none of them.
pub fn radar_topics(bytes: &[u8]) -> Vec<String> {
    let (mut schemas, mut channels) = (BTreeMap::new(), BTreeMap::new());
    let (mut radars, mut seen) = (BTreeSet::new(), BTreeSet::new());
    container::read(bytes, &mut |item| match item {
        Item::File => {
            schemas.clear();
            channels.clear();
        }
        Item::Record(Record::Schema { header, .. }) => drop(schemas.insert(header.id, header.name)),
        Item::Record(Record::Channel(c)) => drop(channels.insert(c.id, (c.topic, c.schema_id, c.message_encoding))),
        Item::Record(Record::Message { header, data }) => {
            let Some((topic, schema, encoding)) = channels.get(&header.channel_id) else { return };
            if encoding != ENCODING || !seen.insert(topic.clone()) {
                return;
            }
            let is_radar = match schemas.get(schema).map(String::as_str) {
                Some(POINT_CLOUD) => ros::decode::<PointCloud2>(&data).is_ok_and(|c| points::from_cloud(&c).is_ok()),
                Some(RADAR_SCAN) => ros::decode::<RadarScan>(&data).is_ok(),
                _ => false,
            };
            if is_radar {
                radars.insert(topic.clone());
            }
        }
        _ => {}
    });
    radars.into_iter().collect()
}

/// A whole recording from the bytes of its file, with nothing beside it.
///
/// # Errors
/// A file that is no MCAP, and whatever makes an evaluation impossible: no radar frames, several radars, no mount,
/// no field of view. The message names what was found and the option that mends it. Anything less
/// is counted in [`Recording::problems`].
pub fn parse(bytes: &[u8], name: String, options: &ReadOptions) -> Result<Recording> {
    let read = |radar_topic: Option<String>| {
        let truth_topic = options.truth_topic.clone();
        let mut reader = Reader { radar_topic, truth_topic, ..Default::default() };
        reader.records(bytes).map(|()| reader)
    };
    let mut reader = read(options.radar_topic.clone())?;
    if reader.radar_topic.is_none() && reader.topics_of_frames.is_empty() {
        // the only one that can be meant
        let by_type = reader.radar_topics();
        let by_content = if by_type.len() > 1 { radar_topics(bytes) } else { Vec::new() };
        if let ([one], _) | (_, [one]) = (&by_type[..], &by_content[..]) {
            reader = read(Some(one.clone()))?;
        }
    }
    reader.finish(name, options)
}

/// The truth of labels, if the recording is labelled and their ids are of one object each.
fn truth_of(labelled: bool, labels: Vec<Label>, problems: &mut Problems) -> Option<Truth> {
    if !labelled {
        return None;
    }
    let (all, twice) = (labels.len(), truth::twice(&labels));
    let first = labels.first().map_or(0, |l| l.time_ns);
    let few = twice == 0 || twice * 100 < all;
    if twice > 0 {
        let becomes = if few { "the first is taken" } else { "the labels are left out" };
        let what =
            format!("object at several places at one time, of the same id: {becomes}; give each object its own id");
        problems.add_many("labels", what, first, twice as u64);
    }
    few.then(|| Truth::new(labels))
}

/// What a record says of a radar; one by the radar's name is of the topic of that name.
fn of_sensor(record: mcap::records::Metadata) -> Option<BTreeMap<String, String>> {
    let name = record.name.strip_prefix(SENSOR_METADATA)?;
    let mut said = record.metadata;
    match name.strip_prefix('.') {
        None if name.is_empty() => {}
        Some(name) if !name.is_empty() => {
            said.entry("topic".to_owned()).or_insert_with(|| points_topic(name));
        }
        _ => return None,
    }
    Some(said)
}

impl Reader {
    fn records(&mut self, bytes: &[u8]) -> Result<()> {
        container::read(bytes, &mut |item| self.item(item));
        if !self.any {
            bail!("not an MCAP file: it holds no record");
        }
        Ok(())
    }

    /// Time of the last message of a radar, where something without a time of its own is told.
    fn now(&self) -> i64 {
        self.messages.last().map_or(0, |m| m.time_ns)
    }

    fn item(&mut self, item: Item<'_>) {
        let record = match item {
            Item::File => {
                if self.begun {
                    let what = "two files joined: another follows the end of the one before, and is read too";
                    self.problems.add("file", what, self.now());
                }
                self.begun = true;
                self.schemas.clear();
                self.channels.clear();
                return;
            }
            Item::Flaw(what) => return self.problems.add("file", what, self.now()),
            Item::Record(record) => record,
        };
        self.any = true;
        match record {
            Record::Schema { header, data } => {
                let definition = String::from_utf8_lossy(&data);
                let is_older = OLDER_FIELDS.iter().any(|field| definition.contains(field));
                self.schemas.insert(header.id, Schema { name: header.name, is_older });
            }
            Record::Channel(c) => {
                let none = || Schema { name: "(no schema)".into(), is_older: false };
                let Schema { name: schema, is_older } = self.schemas.get(&c.schema_id).cloned().unwrap_or_else(none);
                let topic = Topic { name: c.topic, schema, encoding: c.message_encoding, is_older, messages: 0 };
                let known = self.topics.iter().position(|t| t.is_same(&topic));
                let place = known.unwrap_or(self.topics.len());
                if known.is_none() {
                    self.topics.push(topic);
                }
                self.channels.entry(c.id).or_insert(place);
            }
            Record::Message { header, data } => self.message(&header, &data),
            Record::Metadata(m) if m.name == GROUND_METADATA => self.ground = m.metadata.get("points_m").cloned(),
            Record::Metadata(m) => self.metadata.extend(of_sensor(m)),
            _ => {}
        }
    }

    fn message(&mut self, header: &MessageHeader, data: &[u8]) {
        let place = self.channels.get(&header.channel_id);
        let Some(topic) = place.and_then(|&place| self.topics.get_mut(place)) else {
            self.problems.add("file", "message on a channel never announced, skipped", header.log_time as i64);
            return;
        };
        topic.messages += 1;
        let Topic { name, schema, encoding, is_older, .. } = topic.clone();
        let is_radar = self.radar_topic.as_deref().unwrap_or(POINTS_TOPIC) == name
            || (self.radar_topic.is_none() && schema == RADAR_SCAN);
        let is_truth = self.truth_topic.as_deref().unwrap_or(TRUTH_TOPIC) == name;
        let outcome = match schema.as_str() {
            _ if encoding != ENCODING && (is_radar || is_truth) => {
                Err(format!("its encoding is {encoding}, and only {ENCODING} (ROS 2) is read"))
            }
            POINT_CLOUD if is_radar => self.cloud(&name, header, data),
            RADAR_SCAN if is_radar => self.scan(&name, header, data),
            DETECTIONS if is_truth && is_older => Err(OLDER.into()),
            DETECTIONS if is_truth => self.objects(&name, data).map_err(|e| format!("{e}: {OLDER}")),
            BOXES if name == OBJECTS_TOPIC => {
                let decoded = ros::decode::<Detection2DArray>(data).map_err(|e| format!("{e}: {OLDER}"));
                let decoded = if is_older { Err(OLDER.into()) } else { decoded };
                self.camera.unread += u64::from(decoded.is_err());
                decoded.map(|m| self.camera.boxes(m, header.log_time as i64, &mut self.problems))
            }
            CAMERA_INFO if name == INFO_TOPIC => ros::decode::<CameraInfo>(data).map(|m| self.camera.info(m)),
            TF if name.ends_with("tf_static") => ros::decode::<TfMessage>(data).map(|m| self.transforms.add(m)),
            TF if name.ends_with("tf") => ros::decode::<TfMessage>(data).map(|m| self.moving.add(m)),
            _ if is_radar || is_truth => Err(format!("schema {schema} is none this reader knows")),
            _ => Ok(()),
        };
        if let Err(what) = outcome {
            self.problems.add(&name, format!("message skipped: {what}"), header.log_time as i64);
        }
    }

    fn cloud(&mut self, topic: &str, header: &MessageHeader, data: &[u8]) -> Result<(), String> {
        let cloud: PointCloud2 = ros::decode(data)?;
        let points = points::from_cloud(&cloud)?;
        self.frame(topic, &cloud.header, header, points);
        Ok(())
    }

    fn scan(&mut self, topic: &str, header: &MessageHeader, data: &[u8]) -> Result<(), String> {
        let scan: RadarScan = ros::decode(data)?;
        let points = points::from_scan(&scan);
        self.frame(topic, &scan.header, header, points);
        Ok(())
    }

    fn frame(&mut self, topic: &str, header: &ros::Header, message: &MessageHeader, points: Points) {
        let mut time_ns = header.stamp.nanoseconds();
        if time_ns == 0 && message.log_time > 0 {
            time_ns = message.log_time as i64;
            self.problems.add(topic, "header without a stamp, log time taken", time_ns);
        }
        for what in &points.unread {
            self.problems.add(topic, format!("{what}; taken for not measured"), time_ns);
        }
        self.radar_frame.get_or_insert_with(|| header.frame_id.clone());
        if !self.topics_of_frames.contains(topic) {
            self.topics_of_frames.insert(topic.to_owned());
        }
        let (logged_ns, frame_id) = (message.log_time as i64, header.frame_id.clone());
        self.messages.push(Message { time_ns, logged_ns, frame_id, points });
    }

    fn objects(&mut self, topic: &str, data: &[u8]) -> Result<(), String> {
        let array: Detection3DArray = ros::decode(data)?;
        self.labelled = true;
        let time_ns = array.header.stamp.nanoseconds();
        for d in array.detections {
            let (p, s, yaw_rad) = (d.center.position, d.size, d.center.orientation.yaw_rad());
            if [p.x, p.y, p.z, s.x, s.y, s.z, yaw_rad].iter().any(|v| !v.is_finite()) {
                self.problems.add(topic, "object with a value that is not finite, dropped", time_ns);
            } else if [s.x, s.y, s.z].iter().any(|side| !SIZE_M.contains(side)) {
                self.problems.add(topic, "object smaller than 1 cm or larger than 100 m, dropped", time_ns);
            } else if [p.x, p.y, p.z].iter().any(|v| v.abs() > FARTHEST_M) {
                self.problems.add(topic, "object farther than 100 km away, dropped", time_ns);
            } else {
                self.labels.push(Label {
                    time_ns,
                    id: d.id,
                    class: d.results.into_iter().next().map_or_else(|| "unknown".into(), |r| r.hypothesis.class_id),
                    solid: Solid { center: [p.x, p.y, p.z], yaw_rad, size: [s.x, s.y, s.z] },
                });
            }
        }
        Ok(())
    }

    /// Topics of the types that radars send, whatever they are called.
    fn radar_topics(&self) -> Vec<String> {
        let found = self.topics.iter().filter(|t| t.is_of_a_radar() && t.messages > 0).map(|t| t.name.clone());
        found.collect::<BTreeSet<_>>().into_iter().collect()
    }

    fn topics(&self) -> String {
        if self.topics.is_empty() {
            return "none".into();
        }
        let encoding = |t: &Topic| if t.encoding == ENCODING { String::new() } else { format!("{}, ", t.encoding) };
        let mut found: Vec<_> = self
            .topics
            .iter()
            .map(|t| format!("{} ({}, {}{} messages)", t.name, t.schema, encoding(t), t.messages))
            .collect();
        found.sort();
        found.join(", ")
    }

    fn finish(mut self, name: String, options: &ReadOptions) -> Result<Recording> {
        if let [_, _, ..] = &self.topics_of_frames.iter().collect::<Vec<_>>()[..] {
            let radars: Vec<_> = self.topics_of_frames.iter().map(String::as_str).collect();
            bail!("{name}: several radars: {}; choose one with --radar-topic", radars.join(", "));
        }
        let topic = self.topics_of_frames.first().cloned().unwrap_or_default();
        self.frames = scans::assembled(std::mem::take(&mut self.messages), &topic, &mut self.problems)
            .map_err(|what| anyhow!("{name}: {what}"))?;
        let level = self.ground.is_none();
        if self.frames.is_empty() {
            // boxes of a camera without a radar are a recording of their own
            let named_radar = |t: &Topic| t.is_of_a_radar() && t.name.starts_with("/radar/");
            let camera = match options.radar_topic {
                None if !self.topics.iter().any(named_radar) => {
                    let camera =
                        std::mem::take(&mut self.camera).finish(&self.transforms, ROAD_FRAME, &mut self.problems);
                    picture::of_the_road(camera, level, &mut self.problems)
                }
                _ => None,
            };
            if let Some(camera) = camera {
                let ground = self.ground(&name)?;
                let truth = truth_of(self.labelled, self.labels, &mut self.problems);
                let range_max_m = f64::from(Camera3dConfig::default().range_max_m);
                return Ok(Recording {
                    ground,
                    problems: self.problems,
                    ..camera.alone(name, Sensor::CAMERA, truth, range_max_m)
                });
            }
            let skipped: String = self.problems.iter().map(|p| format!("\n  {p}")).collect();
            let radars = self.radar_topics();
            let found = match (&options.radar_topic, &radars[..]) {
                (Some(topic), _) => format!("no radar frame on topic {topic}"),
                (None, [_, _, ..]) => format!("{} topics may be the radar's: {}", radars.len(), radars.join(", ")),
                (None, [one]) => format!("no radar frame that can be read on topic {one}"),
                (None, []) => {
                    format!("no radar frame: no topic {POINTS_TOPIC}, nor any of type {POINT_CLOUD} or {RADAR_SCAN}")
                }
            };
            let ros_1 = self.topics.iter().any(|t| t.encoding == "ros1");
            let remedy = if self.problems.count(ros::PACKED) > 0 {
                ""
            } else if ros_1 {
                "Messages of ROS 1 are not read: convert the bag (`pip install rosbags`, then `rosbags-convert --src OLD.bag --dst FOLDER --dst-storage mcap`)."
            } else {
                "Name one with --radar-topic."
            };
            bail!("{name}: {found}; topics found: {}. {remedy}{skipped}", self.topics());
        }
        let radar_frame = options.radar_frame.clone().or(self.radar_frame.take()).unwrap_or_default();
        let road_frame = options.road_frame.as_deref().unwrap_or(ROAD_FRAME);
        let pose = match options.mount {
            Some([x, y, z, yaw, pitch, roll]) => Ok(SensorPose::new([x, y, z], yaw, pitch, roll)),
            None => self.transforms.pose(road_frame, &radar_frame).ok_or_else(|| {
                anyhow!("{name}: no mount: {}", self.transforms.why_not(&self.moving, road_frame, &radar_frame))
            }),
        };
        // both that are missing are asked for at once
        let (pose, sensor) = match (pose, self.sensor(&name, options)) {
            (Err(mount), Err(view)) => bail!("{mount:#} And {view:#}"),
            (pose, sensor) => (pose?, sensor?),
        };
        if pose.position[2] <= 0.0 {
            bail!(
                "{name}: mount height {} m is not above the road; give the mount with --mount x,y,z,yaw,pitch,roll",
                pose.position[2]
            );
        }
        let ground = self.ground(&name)?;
        let truth = truth_of(self.labelled, self.labels, &mut self.problems);
        let camera = self.camera.finish(&self.transforms, road_frame, &mut self.problems);
        let camera = picture::of_the_road(camera, level, &mut self.problems);
        Ok(Recording {
            name,
            sensor,
            pose,
            frames: self.frames,
            scans: None,
            ground,
            truth,
            occlusion: BTreeMap::new(),
            camera,
            problems: self.problems,
        })
    }

    fn ground(&self, recording: &str) -> Result<Ground> {
        let Some(text) = &self.ground else { return Ok(Ground::default()) };
        let points = serde_json::from_str(text).map_err(anyhow::Error::from);
        points
            .and_then(Ground::new)
            .with_context(|| format!("{recording}: metadata `{GROUND_METADATA}`: `points_m` is `{text}`"))
    }

    fn sensor(&self, recording: &str, options: &ReadOptions) -> Result<Sensor> {
        // the record that names this radar's topic; else the one that names none
        let topic = self.topics_of_frames.first().map(String::as_str);
        let of_this = self.metadata.iter().rev().find(|m| m.get("topic").is_some_and(|t| Some(t.as_str()) == topic));
        let metadata = of_this.or(self.metadata.iter().rev().find(|m| !m.contains_key("topic")));
        if options.one_of_several && of_this.is_none() && options.field_of_view.is_none() {
            bail!(
                "{recording}: no metadata `{SENSOR_METADATA}` with `topic` = {}; give the field of view with --fov",
                topic.unwrap_or("?")
            );
        }
        let text = |key: &str| metadata.and_then(|m| m.get(key)).map(String::as_str);
        let flag = |key: &str| text(key).map(|v| v.eq_ignore_ascii_case("true"));
        let field_of_view = match options.field_of_view {
            Some(f) => f,
            None => {
                let number = |key: &str| -> Result<f64> {
                    let value = text(key).with_context(|| {
                        format!("{recording}: field of view unknown: metadata `{SENSOR_METADATA}` has no `{key}`. Give it with --fov az_min,az_max,el_min,el_max,r_min,r_max (degrees, metres).")
                    })?;
                    value.parse().with_context(|| format!("{recording}: metadata `{SENSOR_METADATA}`: `{key}` is `{value}`, not a number; --fov replaces it"))
                };
                FieldOfView {
                    azimuth_rad: [number("azimuth_min_rad")?, number("azimuth_max_rad")?],
                    elevation_rad: [number("elevation_min_rad")?, number("elevation_max_rad")?],
                    range_m: [number("range_min_m")?, number("range_max_m")?],
                }
            }
        };
        let limits = [
            ("azimuth", field_of_view.azimuth_rad),
            ("elevation", field_of_view.elevation_rad),
            ("range", field_of_view.range_m),
        ];
        for (what, [lo, hi]) in limits {
            if !(lo.is_finite() && hi.is_finite() && lo < hi) {
                bail!("{recording}: field of view: {what} from {lo} to {hi} is no interval; --fov replaces it");
            }
        }
        let measured = || self.frames.iter().flat_map(|f| &f.detections).any(|d| d.elevation_rad.is_some());
        Ok(Sensor {
            name: text("name").unwrap_or(recording).to_owned(),
            field_of_view,
            has_elevation: flag("has_elevation").unwrap_or_else(measured),
            frames_independent: flag("frames_independent").unwrap_or(false),
            platform_moving: text("platform") == Some("moving"),
            synthetic: flag("synthetic").unwrap_or(false),
            licence: text("licence").map(str::to_owned),
        })
    }
}

//! Recordings: radar frames, mount, field of view and ground truth, whatever file they come from.

pub mod against_labels;
pub mod ars408;
pub mod ars408_feed;
pub mod beside;
pub mod boxes;
pub mod camera;
pub mod can_log;
pub mod capture;
pub mod clock;
pub mod container;
#[cfg(test)]
mod dialects;
pub mod file;
pub mod foreign;
pub mod frames;
pub mod ignored;
pub mod judged;
pub mod kind;
pub mod labelled;
pub mod labels;
pub mod mcap;
pub mod native;
pub mod pairs;
pub mod picture;
pub mod plausible;
pub mod points;
pub mod problems;
pub mod ros;
pub mod scale;
pub mod scans;
pub mod sensor;
pub mod serial_log;
#[cfg(test)]
mod strange;
pub mod text;
pub mod ti;
pub mod transforms;
pub mod truth;
pub mod unfilled;
pub mod unheld;
pub mod usable;
pub mod used;
pub mod write;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Result, bail};

use crate::geometry::ground::Ground;
use crate::geometry::pose::{SensorPose, Spherical};
use crate::recording::truth::Truth;
use camera::RecordedCamera;
use file::{Content, Source};
use ignored::Kind;
use problems::Problems;
use unheld::Scans;

/// One low-level radar measurement, as recorded.
///
/// Azimuth + left, elevation + up (radians), radial velocity + receding (m/s), RCS in dBsm, SNR in dB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RadarDetection {
    pub range_m: f32,
    pub azimuth_rad: f32,
    pub elevation_rad: Option<f32>,
    pub radial_velocity_mps: f32,
    pub rcs_dbsm: Option<f32>,
    pub snr_db: Option<f32>,
}

impl RadarDetection {
    /// Where the detection lies in the road frame; without elevation, at `height_m`.
    pub fn road_position(&self, pose: &SensorPose, height_m: f64) -> [f64; 3] {
        let (range_m, azimuth_rad) = (f64::from(self.range_m), f64::from(self.azimuth_rad));
        pose.to_road(match self.elevation_rad {
            Some(e) => Spherical { range_m, azimuth_rad, elevation_rad: f64::from(e) },
            None => pose.at_height(range_m, azimuth_rad, height_m),
        })
    }
}

/// One radar scan.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Measurement time.
    pub time_ns: i64,
    pub detections: Vec<RadarDetection>,
    /// Points dropped when it was read: not finite, or at no distance.
    pub refused: u64,
    /// What was left out by the radar's own marks: no estimator uses it, and it is looked at where it lies.
    pub unwanted: Vec<RadarDetection>,
    /// The radar says that something is wrong with it.
    pub fault: bool,
}

impl Frame {
    /// What was detected, and behind it what the radar's own marks left out, which is true of it.
    pub fn all(&self) -> impl Iterator<Item = (&RadarDetection, bool)> {
        self.detections.iter().map(|d| (d, false)).chain(self.unwanted.iter().map(|d| (d, true)))
    }
}

/// Static field of view, in the sensor frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldOfView {
    pub azimuth_rad: [f64; 2],
    pub elevation_rad: [f64; 2],
    pub range_m: [f64; 2],
}

impl FieldOfView {
    pub fn contains(&self, s: Spherical) -> bool {
        let within = |v: f64, [lo, hi]: [f64; 2]| (lo..=hi).contains(&v);
        within(s.azimuth_rad, self.azimuth_rad)
            && within(s.elevation_rad, self.elevation_rad)
            && within(s.range_m, self.range_m)
    }
}

/// What the recording says of its sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    pub name: String,
    pub field_of_view: FieldOfView,
    pub has_elevation: bool,
    /// Single frames without continuity: the estimator is reset before each.
    pub frames_independent: bool,
    pub platform_moving: bool,
    /// Of a simulated world.
    pub synthetic: bool,
    pub licence: Option<String>,
}

impl Sensor {
    /// What is known of a camera without a radar, beside its view.
    pub const CAMERA: Self = Self {
        name: String::new(),
        field_of_view: FieldOfView { azimuth_rad: [0.0; 2], elevation_rad: [0.0; 2], range_m: [0.0; 2] },
        has_elevation: true,
        frames_independent: false,
        platform_moving: false,
        synthetic: false,
        licence: None,
    };
}

/// A recording. Its frames are held in memory, or read again and again from their log.
#[derive(Debug, Clone)]
pub struct Recording {
    /// File stem.
    pub name: String,
    pub sensor: Sensor,
    pub pose: SensorPose,
    /// Those that are held: all of them, or none.
    pub frames: Vec<Frame>,
    /// Where they are read from if they are not held.
    pub scans: Option<Arc<Scans>>,
    /// Heights of the road, where it is not flat.
    pub ground: Ground,
    /// Objects over time, if labelled.
    pub truth: Option<Truth>,
    /// Human occlusion grade (0 = free, 2 = mostly hidden) by object id.
    pub occlusion: BTreeMap<String, u8>,
    /// A camera beside the radar, with the boxes of its detector.
    pub camera: Option<RecordedCamera>,
    /// What was wrong with the input, counted.
    pub problems: Problems,
}

impl Recording {
    /// The camera whose own recording this is.
    pub fn of_camera(&self) -> Option<&RecordedCamera> {
        self.camera.as_ref().filter(|camera| camera.alone)
    }
}

/// Which labels a recording is judged by.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum LabelsFrom {
    /// Those in `NAME.labels.csv` beside it, or else its own.
    #[default]
    Usual,
    /// Those in `NAME.labels.csv` beside it.
    Beside,
    /// Its own.
    Recording,
    /// Those in another file.
    File(PathBuf),
}

/// What replaces or restricts what the file itself says.
#[derive(Debug, Clone, Default)]
pub struct ReadOptions {
    pub radar_topic: Option<String>,
    pub truth_topic: Option<String>,
    pub labels: LabelsFrom,
    /// The radar says + of what approaches.
    pub approaching_is_positive: bool,
    /// What makes m/s of the radar's velocities.
    pub velocity_scale: Option<f64>,
    /// Frames of `/tf_static` that stand for `road` and for the one in the radar's headers.
    pub road_frame: Option<String>,
    pub radar_frame: Option<String>,
    /// x, y, z in metres, yaw, pitch, roll in radians.
    pub mount: Option<[f64; 6]>,
    pub field_of_view: Option<FieldOfView>,
    /// Seconds since the first radar frame.
    pub from_s: Option<f64>,
    pub to_s: Option<f64>,
    /// Which bus of a log with several.
    pub interface: Option<String>,
    /// Which sensor of a bus with several.
    pub sensor_id: Option<u8>,
    /// Which kind of radar a CAN log is of.
    pub profile: Option<&'static viewshed::inputs::ars408::profile::Ars408Profile>,
    /// Which entries of an ARS408 are wanted.
    pub wanted: Option<viewshed::inputs::ars408::quality::Ars408Wanted>,
    /// Kind of header of a TI capture.
    pub ti_header: Option<viewshed::inputs::ti::TiFamily>,
    /// What a TI capture does not say of its firmware.
    pub ti_dialect: Option<viewshed::inputs::ti::TiDialect>,
    /// Time between frames of a TI capture.
    pub frame_period_s: Option<f64>,
    /// The file has other radars, too: what it says of one without naming it is not this one's.
    pub one_of_several: bool,
}

impl ReadOptions {
    /// Refuses one file of labels for several recordings.
    ///
    /// # Errors
    /// Which file that is.
    pub fn check_for(&self, recordings: usize) -> Result<()> {
        if let (LabelsFrom::File(file), 2..) = (&self.labels, recordings) {
            bail!("--labels {}: it is of one recording, and there are {recordings}; name one", file.display());
        }
        Ok(())
    }
}

/// Every file that [`read`] may read for a recording.
pub fn files(path: &Path) -> impl Iterator<Item = PathBuf> {
    [path.to_owned()].into_iter().chain(beside::files(path)).chain(boxes::camera_file(path))
}

/// Reads a recording as [`read`] does, and where an MCAP file has several radars and none is chosen, that of each: its
/// own, with a name made of the file's and the topic's.
///
/// # Errors
/// Those of [`read`]; several radars, some of them without a mount or a field of view: all are listed.
pub fn read_each(path: &Path, options: &ReadOptions) -> Result<Vec<(Recording, ReadOptions)>> {
    open_each(path, options, None)
}

/// The same; an unlabelled CAN log is read so many scans at once, if that is said, and not held.
///
/// # Errors
/// Those of [`read_each`].
pub fn open_each(path: &Path, options: &ReadOptions, part: Option<usize>) -> Result<Vec<(Recording, ReadOptions)>> {
    let asked = options.radar_topic.is_some() || path.as_os_str() == file::STANDARD_INPUT || boxes::is_boxes(path);
    let is_mcap = !asked && Source::of(path)?.begin(::mcap::MAGIC.len() as u64)? == ::mcap::MAGIC;
    let Content { bytes, damage } =
        if is_mcap { file::read(path)? } else { Content { bytes: Vec::new(), damage: None } };
    let topics = if bytes.starts_with(::mcap::MAGIC) { mcap::radar_topics(&bytes) } else { Vec::new() };
    if topics.len() < 2 {
        // whoever reads the file again finds the same topic
        let radar_topic = options.radar_topic.clone().or(topics.first().cloned());
        return Ok(vec![(open(path, options, part)?, ReadOptions { radar_topic, ..options.clone() })]);
    }
    let name = file::stem(path);
    if options.mount.is_some() {
        bail!(
            "{name}: {} radars: {}; --mount is of one: choose it with --radar-topic",
            topics.len(),
            topics.join(", ")
        );
    }
    let (mut found, mut said, mut all) = (Vec::new(), String::new(), true);
    for topic in &topics {
        let of_one = ReadOptions { radar_topic: Some(topic.clone()), one_of_several: true, ..options.clone() };
        let outcome = mcap::parse(&bytes, name.clone(), &of_one).and_then(|mut r| {
            ignored::note(&mut r, options, Kind::Other);
            note_damage(&mut r, damage.as_deref());
            beside::complete(r, path, &of_one)
        });
        match outcome {
            Ok(recording) => {
                said += &format!("\n  {topic}: can be read");
                let name = format!("{name}-{}", topic.trim_matches('/').replace('/', "-"));
                found.push((Recording { name, ..recording }, of_one));
            }
            Err(error) => {
                said += &format!("\n  {topic}: {error:#}");
                all = false;
            }
        }
    }
    if !all {
        bail!(
            "{name}: {} radars, and not each has mount and field of view; choose one with --radar-topic:{said}",
            topics.len()
        );
    }
    Ok(found)
}

/// Reads a recording of any kind: MCAP, a CAN log, a capture of a TI mmWave radar or of the native format, boxes of a
/// camera as CSV; each also gzipped, and `-` from standard input.
///
/// # Errors
/// A file that is none of them, and whatever makes replaying it impossible.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Recording> {
    open(path, options, None)
}

/// The same; an unlabelled CAN log is read so many scans at once, if that is said, and not held.
///
/// # Errors
/// Those of [`read`].
pub fn open(path: &Path, options: &ReadOptions, part: Option<usize>) -> Result<Recording> {
    let (source, name) = (Source::of(path)?, file::stem(path));
    if source.begin(1)?.is_empty() {
        bail!("{} is empty", file::shown(path));
    }
    let known = boxes::is_boxes(path) || source.begin(::mcap::MAGIC.len() as u64)? == ::mcap::MAGIC;
    if !known && let Some(log) = can_log::log::find(&source)? {
        let part = part.filter(|_| !beside::has_labels(path, options));
        let (recording, damage) = ars408::read(&name, &log, options, part)?;
        return complete(recording, Kind::CanLog, damage.as_deref(), path, options);
    }
    let Content { bytes, damage } = source.read()?;
    let (recording, kind) = if boxes::is_boxes(path) {
        (boxes::read(path, &bytes, options)?, Kind::Other)
    } else if bytes.starts_with(::mcap::MAGIC) {
        (mcap::parse(&bytes, name, options)?, Kind::Other)
    } else if let Some(foreign) = foreign::named(&bytes) {
        bail!("{} cannot be read: {foreign}", file::shown(path));
    } else if ti::is_capture(&bytes) {
        (ti::read(name, &bytes, options)?, Kind::TiCapture)
    } else if native::is_capture(&bytes) {
        let (messages, broken) = native::unstuff(&bytes);
        (native::read(name, &messages, broken, options)?, Kind::NativeCapture)
    } else {
        bail!(
            "not an MCAP file, nor another that is read: a log of {}, a capture of a TI mmWave radar's data port or of the native format, a camera's boxes in NAME.boxes.csv; each may be gzipped",
            can_log::FORMATS
        );
    };
    complete(recording, kind, damage.as_deref(), path, options)
}

/// Adds what is said beside a recording, and of how it was asked for.
fn complete(
    mut recording: Recording,
    kind: Kind,
    damage: Option<&str>,
    path: &Path,
    options: &ReadOptions,
) -> Result<Recording> {
    ignored::note(&mut recording, options, kind);
    note_damage(&mut recording, damage);
    beside::complete(recording, path, options)
}

/// Adds what is wrong with how the file was packed.
fn note_damage(recording: &mut Recording, damage: Option<&str>) {
    let Some(damage) = damage else { return };
    let last = recording.extent().last_ns;
    recording.problems.add("file", format!("{damage}; {}", file::DAMAGE_REMEDY), last);
}

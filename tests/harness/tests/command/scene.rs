//! A small scene as a recording: a truck hides a car, another car drives free.
//!
//! From a gantry at 6 m the truck (rear top edge 4 m high, 40 m ahead at first) hides the car 14 m
//! behind its front bumper's far side for as long as they drive; the car on the left lane is in sight.

use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use viewshed_harness::geometry::pose::{SensorPose, direction};
use viewshed_harness::geometry::solid::Solid;
use viewshed_harness::recording::truth::Label;
use viewshed_harness::recording::write::RecordingWriter;
use viewshed_harness::recording::{FieldOfView, Frame, RadarDetection, Sensor};

/// Speed of everything, m/s along the road.
const SPEED: f64 = 12.0;
pub const FRAMES: usize = 45;
const START_NS: i64 = 1_700_000_000_000_000_000;
pub const PERIOD_NS: i64 = 66_000_000;

#[derive(Clone)]
pub struct Scene {
    pub sensor: Sensor,
    pub pose: SensorPose,
    pub steps: Vec<(Frame, Vec<Label>)>,
    pub labelled: bool,
}

impl Default for Scene {
    fn default() -> Self {
        let pose = SensorPose::new([0.0, 0.0, 6.0], 0.0, 0.05, 0.0);
        Self {
            sensor: Sensor {
                name: "scene".into(),
                field_of_view: FieldOfView {
                    azimuth_rad: [-1.0, 1.0],
                    elevation_rad: [-0.3, 0.3],
                    range_m: [3.0, 150.0],
                },
                has_elevation: true,
                frames_independent: false,
                platform_moving: false,
                synthetic: true,
                licence: None,
            },
            pose,
            steps: (0..FRAMES).map(|k| step(&pose, k)).collect(),
            labelled: true,
        }
    }
}

fn step(pose: &SensorPose, k: usize) -> (Frame, Vec<Label>) {
    let time_ns = START_NS + k as i64 * PERIOD_NS;
    let moved = SPEED * (k as i64 * PERIOD_NS) as f64 * 1e-9;
    let label = |id: &str, class: &str, x: f64, y: f64, size: [f64; 3]| Label {
        time_ns,
        id: id.into(),
        class: class.into(),
        solid: Solid { center: [x + moved, y, size[2] / 2.0], yaw_rad: 0.0, size },
    };
    let labels = vec![
        label("truck", "truck", 46.0, 0.0, [12.0, 2.5, 4.0]),
        label("hidden", "car", 60.0, 0.0, [4.5, 1.8, 1.5]),
        label("free", "car", 50.0, 7.0, [4.5, 1.8, 1.5]),
    ];
    // rear faces reflect; the hidden car does not
    let detections = [&labels[0], &labels[2]]
        .iter()
        .flat_map(|l| {
            [-0.5, 0.5].map(|side| [l.solid.center[0] - l.solid.size[0] / 2.0, l.solid.center[1] + side, 0.8])
        })
        .map(|p| detection(pose, p))
        .collect();
    (Frame { time_ns, detections, refused: 0, unwanted: Vec::new(), fault: false }, labels)
}

/// What the radar measures at a road point that drives with everything else.
pub fn detection(pose: &SensorPose, p: [f64; 3]) -> RadarDetection {
    let s = pose.to_spherical(p);
    let line = pose.rotate_to_road(direction(s.azimuth_rad, s.elevation_rad));
    RadarDetection {
        range_m: s.range_m as f32,
        azimuth_rad: s.azimuth_rad as f32,
        elevation_rad: Some(s.elevation_rad as f32),
        radial_velocity_mps: (SPEED * line[0]) as f32,
        rcs_dbsm: Some(10.0),
        snr_db: Some(20.0),
    }
}

impl Scene {
    pub fn bytes(&self) -> Vec<u8> {
        let start_ns = self.steps.first().map_or(0, |(f, _)| f.time_ns);
        let mut writer = RecordingWriter::new(Cursor::new(Vec::new()), &self.sensor, &self.pose, start_ns).unwrap();
        for (frame, labels) in &self.steps {
            writer.frame(frame).unwrap();
            if self.labelled {
                writer.objects(frame.time_ns, labels).unwrap();
            }
        }
        writer.finish().unwrap().into_inner()
    }

    /// Writes the recording as NAME.mcap into the folder.
    pub fn save(&self, folder: &Path, name: &str) -> PathBuf {
        let path = folder.join(format!("{name}.mcap"));
        std::fs::write(&path, self.bytes()).unwrap();
        path
    }
}

/// Runs `viewshed` inside a folder.
pub fn viewshed(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
    command.current_dir(folder).args(arguments.split_whitespace()).output().unwrap()
}

/// A fresh folder for one test.
pub fn folder(test: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// Runs `viewshed replay` inside a folder.
pub fn replay(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_viewshed")).current_dir(folder).arg("replay").args(arguments).output().unwrap()
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

pub fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

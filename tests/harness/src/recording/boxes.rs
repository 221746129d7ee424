//! Boxes of a camera's detector as CSV, `NAME.boxes.csv`, with the camera in `NAME.camera.toml` beside it.
//!
//! ```text
//! time_s,class,left_px,top_px,right_px,bottom_px
//! 12.066,car,801.5,402,858,447.25
//! 12.133,,,,,
//! ```
//!
//! Rows of one time are a picture; pictures stand in the order of time, and one without boxes has a row without class
//! and edges. Pixels of the rectified picture, from its upper left corner. The camera's file:
//!
//! ```toml
//! mount = { x_m = 0.0, y_m = 0.0, height_m = 6.0, yaw_deg = 0.0, pitch_deg = 6.0, roll_deg = 0.0 }
//! intrinsics = { size_px = [1920, 1080], focal_px = [1663.0, 1663.0], center_px = [960.0, 540.0] }
//! ```

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde::Deserialize;
use viewshed::camera::Camera3dConfig;
use viewshed::camera::calibration::Calibration;

use super::camera::{Box2d, CameraFrame, Intrinsics, RecordedCamera};
use super::problems::Problems;
use super::{ReadOptions, Recording, Sensor, file, labels, picture};
use crate::geometry::pose::SensorPose;

const SUFFIX: &str = ".boxes.csv";
const PROBLEMS: &str = "boxes";

/// Name before the suffix.
fn stem(path: &Path) -> Option<String> {
    file::unpacked_name(path).strip_suffix(SUFFIX).map(str::to_owned)
}

/// Whether a file is one of boxes, by its name.
pub fn is_boxes(path: &Path) -> bool {
    stem(path).is_some()
}

/// The camera's file beside boxes.
pub fn camera_file(path: &Path) -> Option<PathBuf> {
    stem(path).map(|name| path.with_file_name(format!("{name}.camera.toml")))
}

#[derive(Debug, Deserialize)]
struct Row {
    time_s: f64,
    class: String,
    left_px: Option<f64>,
    top_px: Option<f64>,
    right_px: Option<f64>,
    bottom_px: Option<f64>,
    #[serde(default)]
    score: Option<f64>,
}

/// Reads boxes and their camera.
///
/// # Errors
/// No camera beside them; file and line of a row that is malformed; no picture at all.
pub fn read(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Recording> {
    let name = stem(path).unwrap_or_default();
    let beside = camera_file(path).unwrap_or_default();
    let mut camera = read_camera(&beside).with_context(|| format!("{}: its camera", path.display()))?;
    ensure!(
        options.field_of_view.is_none(),
        "--fov does not go with boxes: a camera's view follows from {}",
        beside.display()
    );
    if let Some([x, y, z, yaw, pitch, roll]) = options.mount {
        camera.pose = SensorPose::new([x, y, z], yaw, pitch, roll);
    }
    let (frames, problems) = pictures(bytes).with_context(|| path.display().to_string())?;
    camera.frames = frames;
    if let Some(what) = picture::contradiction(&camera) {
        bail!("{}: {what}", path.display());
    }
    let range_max_m = f64::from(Camera3dConfig::default().range_max_m);
    Ok(Recording { problems, ..camera.alone(name, Sensor::CAMERA, None, range_max_m) })
}

/// Reads a camera's file: a camera without frames.
///
/// # Errors
/// The file cannot be read; line and key of what is wrong in it.
pub fn read_camera(path: &Path) -> Result<RecordedCamera> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read the calibration {}", path.display()))?;
    let Calibration { intrinsics: i, mount: m } = toml::from_str(&text).with_context(|| path.display().to_string())?;
    let [yaw, pitch, roll] = [m.yaw_deg, m.pitch_deg, m.roll_deg].map(|degrees| f64::from(degrees).to_radians());
    Ok(RecordedCamera {
        pose: SensorPose::new([m.x_m, m.y_m, m.height_m].map(f64::from), yaw, pitch, roll),
        intrinsics: Intrinsics {
            size_px: i.size_px.map(u32::from),
            focal_px: i.focal_px.map(f64::from),
            center_px: i.center_px.map(f64::from),
        },
        frames: Vec::new(),
        alone: true,
    })
}

/// The rows of pictures, with the heading; edges to a quarter of a pixel, as in a message.
pub fn rows(frames: &[CameraFrame]) -> String {
    let mut text = String::from("time_s,class,left_px,top_px,right_px,bottom_px,score\n");
    for frame in frames {
        let time_s = format!(
            "{}.{:06}",
            frame.time_ns.div_euclid(1_000_000_000),
            frame.time_ns.rem_euclid(1_000_000_000) / 1000
        );
        if frame.boxes.is_empty() {
            text += &format!("{time_s},,,,,,\n");
        }
        for Box2d { class, score, edges } in &frame.boxes {
            let [l, t, r, b] = edges.map(|v| (v * 4.0).round() / 4.0);
            text += &format!("{time_s},{class},{l},{t},{r},{b},{score:.3}\n");
        }
    }
    text
}

fn pictures(bytes: &[u8]) -> Result<(Vec<CameraFrame>, Problems)> {
    let mut bytes = bytes.to_vec();
    labels::pass_over_separator(&mut bytes);
    let mut csv = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(&bytes[..]);
    let (mut frames, mut problems) = (Vec::<CameraFrame>::new(), Problems::default());
    for row in csv.deserialize::<Row>() {
        let row = row?;
        ensure!(row.time_s.is_finite() && row.time_s.abs() < 9e9, "a time that is no number of seconds");
        let time_ns = (row.time_s * 1e9).round() as i64;
        let last = frames.last().map(|f| f.time_ns);
        if last.is_some_and(|last| time_ns < last) {
            problems.add(PROBLEMS, "time goes back, row dropped", time_ns);
            continue;
        }
        if last != Some(time_ns) {
            frames.push(CameraFrame { time_ns, boxes: Vec::new(), refused: 0 });
        }
        let Some(frame) = frames.last_mut() else { continue };
        match [row.left_px, row.top_px, row.right_px, row.bottom_px] {
            [None, None, None, None] if row.class.is_empty() => {}
            [Some(l), Some(t), Some(r), Some(b)] if [l, t, r, b].iter().all(|v| v.is_finite()) => {
                frame.boxes.push(Box2d { class: row.class, score: row.score.unwrap_or(1.0), edges: [l, t, r, b] });
            }
            _ => {
                frame.refused += 1;
                problems.add(PROBLEMS, "box without an edge, or with one that is not finite, dropped", time_ns);
            }
        }
    }
    if frames.is_empty() {
        bail!("no picture in it");
    }
    Ok((frames, problems))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADING: &str = "time_s,class,left_px,top_px,right_px,bottom_px\n";

    fn read(rows: &str) -> Result<(Vec<CameraFrame>, Problems)> {
        pictures(format!("{HEADING}{rows}").as_bytes())
    }

    #[test]
    fn rows_of_one_time_are_a_picture_and_an_empty_row_one_without_boxes() {
        let (frames, problems) = read("1.5,car,1,2,3,4\n1.5, truck ,5,6,7,8.25\n# a remark\n1.6,,,,,\n").unwrap();
        assert_eq!(
            frames.iter().map(|f| (f.time_ns, f.boxes.len())).collect::<Vec<_>>(),
            [(1_500_000_000, 2), (1_600_000_000, 0)]
        );
        assert_eq!((frames[0].boxes[1].class.as_str(), frames[0].boxes[1].edges), ("truck", [5.0, 6.0, 7.0, 8.25]));
        assert!(problems.is_empty());
    }

    #[test]
    fn packed_boxes_are_known_by_their_name_too() {
        for name in ["day/a.boxes.csv", "day/a.boxes.csv.gz"] {
            let path = Path::new(name);
            assert!(is_boxes(path), "{name}");
            assert_eq!(camera_file(path), Some("day/a.camera.toml".into()));
            assert_eq!(super::super::beside::files(path)[0], Path::new("day/a.labels.csv"));
        }
        assert!(!is_boxes(Path::new("a.csv.gz")) && !is_boxes(Path::new("a.boxes.gz")));
    }

    #[test]
    fn what_is_written_is_read_again() {
        let b = |class: &str, edges| Box2d { class: class.into(), score: 0.5, edges };
        let frame = |time_ns, boxes| CameraFrame { time_ns, boxes, refused: 0 };
        let truck = b("truck", [-1.0, 2.25, 30.5, 40.0]);
        let frames = vec![
            frame(0, vec![b("car", [1.0, 2.0, 3.0, 4.0]), truck]),
            frame(100_000_000, vec![]),
            frame(1_200_000_000, vec![]),
        ];
        let (back, problems) = pictures(rows(&frames).as_bytes()).unwrap();
        assert_eq!(back, frames);
        assert!(problems.is_empty());
    }

    #[test]
    fn what_is_no_box_is_counted_and_what_is_no_row_is_named_by_its_line() {
        let (frames, problems) =
            read("2,car,1,2,3,4\n1,car,1,2,3,4\n2,car,nan,2,3,4\n2,car,1,,3,4\n2,car,9,2,3,4\n").unwrap();
        assert_eq!((frames.len(), frames[0].boxes.len(), frames[0].refused), (1, 2, 2), "an inverted box is one");
        assert_eq!((problems.count("goes back"), problems.count("not finite")), (1, 2));
        let error = |rows: &str| format!("{:#}", read(rows).unwrap_err());
        assert!(error("2,car,1,2,3,4\n2,car,x,2,3,4\n").contains("line: 3"), "{}", error("2,car,x,2,3,4\n"));
        assert!(error("inf,car,1,2,3,4\n").contains("no number of seconds"));
        assert!(error("").contains("no picture"));
        assert!(pictures(b"time,class\n1,car\n").unwrap_err().to_string().contains("missing field `time_s`"));
    }
}

//! Labels beside a recording: `NAME.labels.csv` and `NAME.occlusion.csv`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::geometry::pose::SensorPose;
use crate::geometry::solid::Solid;
use crate::recording::truth::Label;

/// Length, width, height in metres assumed for a class where the labels give none.
pub fn class_size(class: &str) -> Option<[f64; 3]> {
    Some(match class {
        "car" => [4.6, 1.8, 1.5],
        "van" => [6.0, 2.05, 2.6],
        "truck" => [16.5, 2.55, 4.0],
        "bus" => [13.0, 2.55, 3.6],
        "motorcycle" => [2.2, 0.8, 1.5],
        "bicycle" => [1.8, 0.6, 1.7],
        "pedestrian" => [0.6, 0.6, 1.75],
        _ => return None,
    })
}

/// A heading is at most this, and a little more for rounding.
const TURN_RAD: f64 = 6.3;

/// What is beyond is no time in seconds.
const LATEST_S: f64 = 1e10;

/// A row as it stands in the file.
#[derive(Debug, Deserialize)]
pub struct LabelRow {
    pub time_s: f64,
    pub object_id: String,
    pub class: String,
    pub x_m: f64,
    pub y_m: f64,
    pub heading_rad: Option<f64>,
    pub length_m: Option<f64>,
    pub width_m: Option<f64>,
    pub height_m: Option<f64>,
    /// Point of a drawn line, kept beside the box it means; no part of the box.
    pub near_x_m: Option<f64>,
    pub near_y_m: Option<f64>,
}

/// Every row of a file, with its line. Lines that begin with # are none.
///
/// # Errors
/// Names file and line of the first row that is malformed.
pub fn read_rows<Row: DeserializeOwned>(path: &Path) -> Result<Vec<(u64, Row)>> {
    let place = || path.display().to_string();
    let mut csv =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_path(path).with_context(place)?;
    let headers = csv.headers().with_context(place)?.clone();
    if let Some(wrong) = other_separator(&headers, path) {
        bail!("{}: {wrong}", place());
    }
    let mut rows = Vec::new();
    for record in csv.records() {
        // the error of a record that is none has its line in it
        let record = record.with_context(place)?;
        let line = record.position().map_or(0, csv::Position::line);
        rows.push((line, record.deserialize(Some(&headers)).with_context(|| at_line(path, line))?));
    }
    Ok(rows)
}

/// What a spreadsheet of another language writes between columns, if that stands in a file's one column; and in numbers.
fn other_separator(headers: &csv::StringRecord, path: &Path) -> Option<String> {
    let (1, Some(all)) = (headers.len(), headers.get(0)) else { return None };
    let (separator, name) = [(';', "semicolons"), ('\t', "tabs"), ('|', "bars")]
        .into_iter()
        .find(|(separator, _)| all.contains(*separator))?;
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let is_decimal = |value: &str| {
        let halves = value.trim().split_once(',');
        let digits = |half: &str| !half.is_empty() && half.chars().all(|c| c.is_ascii_digit());
        halves.is_some_and(|(whole, rest)| digits(whole.trim_start_matches('-')) && digits(rest))
    };
    let has_decimal_commas = text.lines().any(|line| line.split(separator).any(is_decimal));
    let and = if has_decimal_commas { ", and its numbers have decimal commas, where points are read" } else { "" };
    Some(format!("its columns are separated by {name}, not by commas{and}; export it with commas and points"))
}

/// A line of a file, for errors.
pub fn at_line(path: &Path, line: u64) -> String {
    format!("{}, line {line}", path.display())
}

/// Reads labels in the road frame. Times are seconds on the recording's clock or, where none of
/// them falls between `start_ns` and `end_ns`, seconds since its start. Beside them, how many objects have
/// the size of their class.
///
/// # Errors
/// Names file and line of the first row that is malformed or whose class has no known size; labels of another time.
pub fn read_labels(path: &Path, start_ns: i64, end_ns: i64) -> Result<(Vec<Label>, usize)> {
    let (mut labels, mut sized_by_class) = (Vec::new(), BTreeSet::new());
    for (line, row) in read_rows::<LabelRow>(path)? {
        if [row.length_m, row.width_m, row.height_m].contains(&None) {
            sized_by_class.insert(row.object_id.clone());
        }
        labels.push(label(row).with_context(|| at_line(path, line))?);
    }
    check_times(path, &labels, start_ns, end_ns)?;
    if !labels.iter().any(|l| (start_ns..=end_ns).contains(&l.time_ns)) {
        for l in &mut labels {
            l.time_ns = l.time_ns.saturating_add(start_ns);
        }
    }
    Ok((labels, sized_by_class.len()))
}

/// Refuses labels of which none is of the recording's time, and times that are milliseconds.
fn check_times(path: &Path, labels: &[Label], start_ns: i64, end_ns: i64) -> Result<()> {
    let times = || labels.iter().map(|l| l.time_ns);
    let (Some(first), Some(last)) = (times().min(), times().max()) else { return Ok(()) };
    let duration_ns = end_ns.saturating_sub(start_ns);
    let s = |ns: i64| ns as f64 * 1e-9;
    let spans = || {
        let clock = if start_ns > 0 {
            format!(" (on its own clock {:.1} to {:.1} s)", s(start_ns), s(end_ns))
        } else {
            String::new()
        };
        format!("labels span {:.1} to {:.1} s, the recording 0 to {:.1} s{clock}", s(first), s(last), s(duration_ns))
    };
    let within = |from: i64, to: i64| first <= to && last >= from;
    // far beyond the end as they stand, and just fitting as thousandths
    let of_milliseconds =
        last > duration_ns.saturating_mul(10) && first >= 0 && last / 1000 <= duration_ns + duration_ns / 20;
    if of_milliseconds && !within(start_ns, end_ns) {
        bail!("{}: {}: time_s is in seconds; are these milliseconds?", path.display(), spans());
    }
    if !within(start_ns, end_ns) && !within(0, duration_ns) {
        bail!("{}: {}: no label is of its time", path.display(), spans());
    }
    Ok(())
}

/// Refuses labels that are nowhere near the sensor.
///
/// # Errors
/// Says where they are, and where the sensor is.
pub fn check_places(path: &Path, labels: &[Label], pose: &SensorPose, range_m: f64) -> Result<()> {
    let [x, y, _] = pose.position;
    let near = |l: &Label| (l.solid.center[0] - x).hypot(l.solid.center[1] - y) <= range_m;
    if labels.is_empty() || labels.iter().any(near) {
        return Ok(());
    }
    let span = |axis: usize| {
        let all = labels.iter().map(|l| l.solid.center[axis]);
        format!("{:.1} to {:.1} m", all.clone().fold(f64::MAX, f64::min), all.fold(f64::MIN, f64::max))
    };
    bail!(
        "{}: no label lies within {range_m:.0} m of the sensor: labels span x {}, y {} in the road frame, the sensor is at x {x:.1}, y {y:.1} m",
        path.display(),
        span(0),
        span(1)
    );
}

/// A row as a label standing on the road; a missing size is that of the class.
///
/// # Errors
/// A class whose size nobody knows, a value that is not finite, a size that is not positive, a heading of more than a turn, a time that is none in
/// seconds.
pub fn label(row: LabelRow) -> Result<Label> {
    let default = class_size(&row.class);
    let pick = |given: Option<f64>, k: usize| given.or(default.map(|d| d[k]));
    let (Some(l), Some(w), Some(h)) = (pick(row.length_m, 0), pick(row.width_m, 1), pick(row.height_m, 2)) else {
        bail!("class `{}` has no default size; give length_m, width_m and height_m", row.class);
    };
    let yaw_rad = row.heading_rad.unwrap_or(0.0);
    if row.time_s.abs() > LATEST_S {
        bail!("time_s {} is after the year 2286: it is in seconds; are these milliseconds?", row.time_s);
    }
    if yaw_rad.abs() > TURN_RAD {
        bail!("heading_rad {yaw_rad} is more than a turn: it is in radians, anticlockwise from +x; are these degrees?");
    }
    if [row.time_s, row.x_m, row.y_m, yaw_rad].iter().any(|v| !v.is_finite())
        || [l, w, h].iter().any(|v| !(*v > 0.0 && v.is_finite()))
    {
        bail!("a value is not finite, or a size not positive");
    }
    Ok(Label {
        time_ns: (row.time_s * 1e9).round() as i64,
        id: row.object_id,
        class: row.class,
        solid: Solid { center: [row.x_m, row.y_m, h / 2.0], yaw_rad, size: [l, w, h] },
    })
}

#[derive(Debug, Deserialize)]
struct OcclusionRow {
    object_id: String,
    occlusion_0_to_2: u8,
}

/// Reads human occlusion grades by object id.
///
/// # Errors
/// Names file and line of the first row that is malformed, or whose grade is none.
pub fn read_occlusion(path: &Path) -> Result<BTreeMap<String, u8>> {
    let mut grades = BTreeMap::new();
    for (line, row) in read_rows::<OcclusionRow>(path)? {
        if row.occlusion_0_to_2 > 2 {
            bail!("{}: occlusion {} is not 0, 1 or 2", at_line(path, line), row.occlusion_0_to_2);
        }
        grades.insert(row.object_id, row.occlusion_0_to_2);
    }
    Ok(grades)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_other_languages_are_named() {
        let folder = std::env::temp_dir().join(format!("viewshed-separators-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("a.labels.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_rows::<LabelRow>(&path).map(|rows| rows.len()).map_err(|error| format!("{error:#}"))
        };
        let head = "time_s,object_id,class,x_m,y_m";
        assert_eq!(read(&format!("{head}\n0.5,1,car,20.5,-1.75\n")), Ok(1));
        for (separator, name) in [(";", "semicolons"), ("\t", "tabs")] {
            let head = head.replace(',', separator);
            let points = ["0.5", "1", "car", "20.5", "-1.75"].join(separator);
            let said = read(&format!("# of a place\n{head}\n{points}\n")).unwrap_err();
            assert!(said.contains(&format!("a.labels.csv: its columns are separated by {name}")), "{said}");
            assert!(!said.contains("decimal commas"), "{said}");
            let commas = points.replace('.', ",");
            assert!(read(&format!("{head}\n{commas}\n")).unwrap_err().contains("its numbers have decimal commas"));
        }
        assert!(read("object_id\n1\n").unwrap_err().contains("missing field `time_s`"));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}

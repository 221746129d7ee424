//! Labels beside a recording: `NAME.labels.csv` and `NAME.occlusion.csv`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::geometry::heading::{BASE_M, headings};
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
    let mut bytes = std::fs::read(path).with_context(place)?;
    if bytes.trim_ascii().is_empty() {
        bail!("{}: it is empty: not even a heading", place());
    }
    pass_over_separator(&mut bytes);
    let mut csv = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(&bytes[..]);
    let headers = csv.headers().with_context(place)?.clone();
    if let Some(wrong) = other_separator(&headers, path) {
        bail!("{}: {wrong}", place());
    }
    let mut rows = Vec::new();
    for record in csv.records() {
        // the error of a record that is none has its line in it
        let record = record.with_context(place)?;
        let line = record.position().map_or(0, csv::Position::line);
        let row = record.deserialize(Some(&headers)).map_err(|error| named(error, &headers, &record));
        rows.push((line, row.with_context(|| at_line(path, line))?));
    }
    Ok(rows)
}

/// Makes a comment of the line that tells spreadsheets their separator, so that lines keep their numbers.
pub fn pass_over_separator(bytes: &mut [u8]) {
    let start = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
    if bytes[start..].starts_with(b"sep=") {
        // a comment begins at the very first byte
        bytes[..=start].fill(b'#');
    }
}

/// The error of a value, with the name of its column and what stands there.
fn named(error: csv::Error, headers: &csv::StringRecord, record: &csv::StringRecord) -> anyhow::Error {
    let csv::ErrorKind::Deserialize { err, .. } = error.kind() else { return error.into() };
    let column = err.field().and_then(|field| usize::try_from(field).ok());
    let (Some(name), Some(value)) = (column.and_then(|c| headers.get(c)), column.and_then(|c| record.get(c))) else {
        return error.into();
    };
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let is_date = value.len() > 9 && value.get(..4).is_some_and(digits) && value.get(4..5) == Some("-");
    let seconds = if is_date {
        ": it is a date, and seconds are read, of the recording's own clock or since its first frame"
    } else {
        ""
    };
    anyhow::anyhow!("{name} is `{value}`{seconds}: {}", err.kind())
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

/// What the times of labels count from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LabelClock {
    /// The recording's own clock.
    Own,
    /// Its first frame.
    FirstFrame,
    /// Either may be meant; taken as its own clock.
    Either,
}

impl LabelClock {
    /// What makes times of the recording's own clock of those of the labels, nanoseconds.
    pub fn add_ns(self, start_ns: i64) -> i64 {
        if self == Self::FirstFrame { start_ns } else { 0 }
    }
}

/// Which clock the times of these rows are of, for a recording from `start_ns` to `end_ns`: the one by which more of them
/// lie in it. Times since its first frame were made of this very recording, so most of them do; those of its own clock may
/// be of a whole day. Rows with a drawn point are of `viewshed label`, which writes the recording's own clock.
pub fn clock(rows: &[(u64, LabelRow)], start_ns: i64, end_ns: i64) -> LabelClock {
    let duration_ns = end_ns.saturating_sub(start_ns);
    let times = || rows.iter().map(|(_, row)| nanoseconds(row.time_s));
    let within = |from: i64, to: i64| times().filter(|time| (from..=to).contains(time)).count();
    let (own, since) = (within(start_ns, end_ns), within(0, duration_ns));
    let drawn = rows.iter().any(|(_, row)| row.near_x_m.is_some());
    let most = since * 2 >= rows.len();
    match (own, since) {
        (0, 0) if times().any(|time| time < start_ns) && times().any(|time| time > end_ns) => LabelClock::Own,
        (0, _) => LabelClock::FirstFrame,
        _ if drawn || !most => LabelClock::Own,
        _ if since > own => LabelClock::FirstFrame,
        _ if since == own && start_ns != 0 => LabelClock::Either,
        _ => LabelClock::Own,
    }
}

fn nanoseconds(time_s: f64) -> i64 {
    (time_s * 1e9).round() as i64
}

/// Gives rows without a heading that of their object's path; how many objects have such rows.
pub fn turn_along_paths(rows: &mut [(u64, LabelRow)]) -> usize {
    let mut by_id: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (k, (_, row)) in rows.iter().enumerate() {
        by_id.entry(row.object_id.as_str()).or_default().push(k);
    }
    let without = |of_one: &Vec<usize>| of_one.iter().any(|&k| rows[k].1.heading_rad.is_none());
    let mut turned: Vec<Vec<usize>> = by_id.into_values().filter(without).collect();
    for of_one in &mut turned {
        of_one.sort_by(|&a, &b| rows[a].1.time_s.total_cmp(&rows[b].1.time_s));
        let path: Vec<[f64; 2]> = of_one.iter().map(|&k| [rows[k].1.x_m, rows[k].1.y_m]).collect();
        for (&k, heading) in of_one.iter().zip(headings(&path, BASE_M)) {
            rows[k].1.heading_rad.get_or_insert(heading);
        }
    }
    turned.len()
}

/// Labels of a file, and what of them the file does not say.
#[derive(Debug)]
pub struct LabelsRead {
    /// In the road frame, standing on level ground, on the recording's own clock.
    pub labels: Vec<Label>,
    /// Objects that have the size of their class.
    pub sized_by_class: usize,
    /// Objects that look along their path, at one time at least.
    pub turned_by_path: usize,
    pub clock: LabelClock,
}

/// Reads labels beside a recording from `start_ns` to `end_ns`.
///
/// # Errors
/// Names file and line of the first row that is malformed or whose class has no known size; labels of another time.
pub fn read_labels(path: &Path, start_ns: i64, end_ns: i64) -> Result<LabelsRead> {
    let mut rows = read_rows::<LabelRow>(path)?;
    if rows.is_empty() {
        bail!("{}: it has a heading and no label, so nothing can be judged", path.display());
    }
    refuse_twice(path, &rows)?;
    let turned_by_path = turn_along_paths(&mut rows);
    let clock = clock(&rows, start_ns, end_ns);
    let (mut labels, mut sized_by_class) = (Vec::new(), BTreeSet::new());
    for (line, row) in rows {
        if [row.length_m, row.width_m, row.height_m].contains(&None) {
            sized_by_class.insert(row.object_id.clone());
        }
        labels.push(label(row).with_context(|| at_line(path, line))?);
    }
    check_times(path, &labels, start_ns, end_ns)?;
    for l in &mut labels {
        l.time_ns = l.time_ns.saturating_add(clock.add_ns(start_ns));
    }
    Ok(LabelsRead { labels, sized_by_class: sized_by_class.len(), turned_by_path, clock })
}

/// Refuses objects that are at two places at one time.
fn refuse_twice(path: &Path, rows: &[(u64, LabelRow)]) -> Result<()> {
    let mut known: BTreeMap<(i64, &str), (u64, [f64; 2])> = BTreeMap::new();
    let mut twice = rows.iter().filter_map(|(line, row)| {
        let place = [row.x_m, row.y_m];
        let (first, other) = *known.entry((nanoseconds(row.time_s), row.object_id.as_str())).or_insert((*line, place));
        (first != *line && place != other).then_some((first, *line, row))
    });
    let Some((first, line, row)) = twice.next() else { return Ok(()) };
    bail!(
        "{}: object_id `{}` is at two places at one time, {} s (first in line {first}), and {} more such rows: several objects of the same id; give each its own",
        at_line(path, line),
        row.object_id,
        row.time_s,
        twice.count()
    );
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
        time_ns: nanoseconds(row.time_s),
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

    #[test]
    fn tables_that_say_nothing_or_twice_are_refused_with_what_is_wrong() {
        let path = std::env::temp_dir().join(format!("viewshed-tables-{}.labels.csv", std::process::id()));
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_labels(&path, 0, 2_000_000_000).map(|read| read.labels.len()).map_err(|error| format!("{error:#}"))
        };
        let head = "time_s,object_id,class,x_m,y_m\n";
        assert!(read("").unwrap_err().contains("it is empty"));
        assert!(read(head).unwrap_err().contains("no label"));
        let rows = "0.5,1,car,20.5,-1.75\n0.5,2,car,30,1\n";
        for sep in ["sep=,\n", "\u{FEFF}sep=,\r\n", "\u{FEFF}", ""] {
            assert_eq!(read(&format!("{sep}{head}{rows}")), Ok(2), "{sep:?}");
        }
        let twice = read(&format!("sep=,\n{head}{rows}0.5,1,car,60,3\n")).unwrap_err();
        assert!(
            twice.contains("line 5: object_id `1` is at two places at one time, 0.5 s (first in line 3)"),
            "{twice}"
        );
        assert_eq!(read(&format!("{head}{rows}0.5,1,car,20.5,-1.75\n")), Ok(3), "the same row again");
        let iso = read(&format!("{head}{rows}2026-05-04T06:00:00Z,3,car,1,1\n")).unwrap_err();
        assert!(iso.contains("line 4") && iso.contains("time_s is `2026-05-04T06:00:00Z`: it is a date"), "{iso}");
        let word = read(&format!("{head}0.5,1,car,left,1\n")).unwrap_err();
        assert!(word.contains("x_m is `left`") && !word.contains("date"), "{word}");
        std::fs::remove_file(&path).unwrap();
    }

    /// A fresh file with these rows after the usual heading.
    fn file(test: &str, rows: impl IntoIterator<Item = String>) -> std::path::PathBuf {
        let path = std::env::temp_dir().join(format!("viewshed-{test}-{}.labels.csv", std::process::id()));
        let rows: String = rows.into_iter().map(|row| row + "\n").collect();
        std::fs::write(&path, format!("time_s,object_id,class,x_m,y_m,heading_rad,near_x_m,near_y_m\n{rows}")).unwrap();
        path
    }

    #[test]
    fn times_are_of_the_clock_by_which_more_labels_lie_in_the_recording() {
        use LabelClock::{Either, FirstFrame, Own};
        let first = |from_ds: u32, to_ds: u32, start_ns: i64, end_ns: i64, near: &str| {
            let row = |k: u32| format!("{:.1},a,car,{k},0,,{near}", f64::from(k) / 10.0);
            let path = file("clock", (from_ds..=to_ds).map(row));
            let read = read_labels(&path, start_ns, end_ns).unwrap();
            std::fs::remove_file(path).unwrap();
            (read.clock, read.labels[0].time_ns / 1_000_000)
        };
        let (start, end) = (1_000_000_000, 4_900_000_000);
        assert_eq!(first(0, 39, start, end, ","), (FirstFrame, 1000));
        assert_eq!(first(10, 49, start, end, ","), (Own, 1000));
        // as many by either, unless the clock begins at 0
        assert_eq!(first(15, 35, start, end, ","), (Either, 1500));
        assert_eq!(first(15, 35, 0, end - start, ","), (Own, 1500));
        // what `viewshed label` wrote, with a line from before the first frame on
        assert_eq!(first(5, 35, start, end, "1,2"), (Own, 500));
        assert_eq!(first(5, 35, start, end, ","), (FirstFrame, 1500));
        // labels of a longer drive, from which the recording was cut: none of them counts from its first frame
        assert_eq!(first(0, 2000, 100_050_000_000, 160_050_000_000, ","), (Own, 0));
        assert_eq!(first(0, 39, start + 1_700_000_000_000_000_000, end + 1_700_000_000_000_000_000, ",").0, FirstFrame);
        let path = file("clock", ["50,a,car,0,0,,,".into(), "150,a,car,100,0,,,".into()]);
        assert_eq!(read_labels(&path, 100_000_000_000, 103_000_000_000).unwrap().clock, Own, "it lies between them");
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_heading_that_is_not_given_is_that_of_the_path() {
        let rows = |heading: &str| {
            let row = |k: u32| format!("{:.1},a,truck,50,{}{heading}", f64::from(k) / 10.0, 1.5 * f64::from(k));
            (0..20).map(row).chain(["0,b,car,20,5,0.3,,".into()]).collect::<Vec<_>>()
        };
        let read = |heading: &str| {
            let path = file("heading", rows(heading));
            let read = read_labels(&path, 0, 2_000_000_000).unwrap();
            std::fs::remove_file(path).unwrap();
            read
        };
        let (given, left_out) = (read(",1.5708,,"), read(",,,"));
        assert_eq!((given.turned_by_path, left_out.turned_by_path), (0, 1));
        for (a, b) in given.labels.iter().zip(&left_out.labels) {
            assert!((a.solid.yaw_rad - b.solid.yaw_rad).abs() < 1e-4, "{a:?} {b:?}");
        }
    }
}

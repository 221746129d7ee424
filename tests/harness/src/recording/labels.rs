//! Labels beside a recording: `NAME.labels.csv` and `NAME.occlusion.csv`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::Deserialize;

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

/// Every row of a file, with its line.
///
/// # Errors
/// Names file and line of the first row that is malformed.
pub fn read_rows(path: &Path) -> Result<Vec<(u64, LabelRow)>> {
    let place = || path.display().to_string();
    let mut csv =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_path(path).with_context(place)?;
    let headers = csv.headers().with_context(place)?.clone();
    let mut rows = Vec::new();
    for record in csv.records() {
        // the error of a record that is none has its line in it
        let record = record.with_context(place)?;
        let line = record.position().map_or(0, csv::Position::line);
        rows.push((line, record.deserialize(Some(&headers)).with_context(|| at_line(path, line))?));
    }
    Ok(rows)
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
/// Names file and line of the first row that is malformed or whose class has no known size.
pub fn read_labels(path: &Path, start_ns: i64, end_ns: i64) -> Result<(Vec<Label>, usize)> {
    let (mut labels, mut sized_by_class) = (Vec::new(), BTreeSet::new());
    for (line, row) in read_rows(path)? {
        if [row.length_m, row.width_m, row.height_m].contains(&None) {
            sized_by_class.insert(row.object_id.clone());
        }
        labels.push(label(row).with_context(|| at_line(path, line))?);
    }
    if !labels.iter().any(|l| (start_ns..=end_ns).contains(&l.time_ns)) {
        for l in &mut labels {
            l.time_ns = l.time_ns.saturating_add(start_ns);
        }
    }
    Ok((labels, sized_by_class.len()))
}

/// A row as a label standing on the road; a missing size is that of the class.
///
/// # Errors
/// A class whose size nobody knows, a value that is not finite, a size that is not positive.
pub fn label(row: LabelRow) -> Result<Label> {
    let default = class_size(&row.class);
    let pick = |given: Option<f64>, k: usize| given.or(default.map(|d| d[k]));
    let (Some(l), Some(w), Some(h)) = (pick(row.length_m, 0), pick(row.width_m, 1), pick(row.height_m, 2)) else {
        bail!("class `{}` has no default size; give length_m, width_m and height_m", row.class);
    };
    let yaw_rad = row.heading_rad.unwrap_or(0.0);
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
pub fn read_occlusion(path: &Path) -> Result<BTreeMap<String, u8>> {
    let place = || path.display().to_string();
    let mut csv = csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).with_context(place)?;
    let mut grades = BTreeMap::new();
    for (i, row) in csv.deserialize::<OcclusionRow>().enumerate() {
        let row = row.with_context(|| format!("{}, line {}", place(), i + 2))?;
        if row.occlusion_0_to_2 > 2 {
            bail!("{}, line {}: occlusion {} is not 0, 1 or 2", place(), i + 2, row.occlusion_0_to_2);
        }
        grades.insert(row.object_id, row.occlusion_0_to_2);
    }
    Ok(grades)
}

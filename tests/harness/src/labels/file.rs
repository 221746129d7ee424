//! `NAME.labels.csv`: the boxes of label tracks, and the points they were drawn with, in one file.
//!
//! # Model
//! A row every 0.1 s and at every point of a track: `time_s,object_id,class,x_m,y_m,heading_rad,length_m,width_m,
//! height_m,near_x_m,near_y_m`. Up to `height_m` these are the columns every reader of labels knows: time on the
//! recording's clock, box centre and heading in the road frame; sizes stay empty where they are those of the class.
//! The last two columns are filled in the rows that are points of the polyline, so that a file can be edited again;
//! a reader that takes columns by name does not see them. One file, because two could disagree after a crash.
//!
//! Files of other origin have no such columns: their near faces are computed from the boxes, with as few points as
//! keep within 0.2 m.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use super::Site;
use super::near_face::{self, BoxStep, boxes};
use super::tracks::{LabelPoint, LabelTrack, check_all};
use crate::recording::beside;
use crate::recording::labels::{LabelRow, at_line, clock, label, read_rows, turn_along_paths};
use crate::results::files::Target;

const HEADER: &str = "time_s,object_id,class,x_m,y_m,heading_rad,length_m,width_m,height_m,near_x_m,near_y_m\n";
/// How far points made from boxes may be off, metres.
const TOLERANCE_M: f64 = 0.2;

/// The labels file of a recording, there or not.
pub fn beside(recording: &Path) -> PathBuf {
    let [labels, _] = beside::files(recording);
    labels
}

/// The file's content. Times are kept to a microsecond, places to a millimetre.
///
/// # Errors
/// The first track that cannot be kept, by id.
pub fn text(tracks: &[LabelTrack], site: &Site) -> Result<String> {
    check_all(tracks)?;
    let mut text = HEADER.to_owned();
    for track in tracks {
        let duration_s = site.end_ns.saturating_sub(site.start_ns) as f64 * 1e-9;
        ensure!(
            track.span_s().is_some_and(|[a, b]| b >= 0.0 && a <= duration_s),
            "track {} lies outside the recording, which lasts {duration_s:.1} s",
            track.id
        );
        let size = track.size_m.map_or(",,".to_owned(), |[l, w, h]| format!("{l:.3},{w:.3},{h:.3}"));
        let named = format!("{},{}", quoted(&track.id), quoted(&track.class));
        let points: BTreeMap<i64, LabelPoint> = track.points.iter().map(|p| (micros(p.time_s), *p)).collect();
        ensure!(points.len() == track.points.len(), "track {}: two points are within a microsecond", track.id);
        for step in boxes(track, site.sensor) {
            let [x, y] = step.center;
            let near = points.get(&micros(step.time_s));
            let near = near.map_or(",".to_owned(), |p| format!("{:.3},{:.3}", p.x_m, p.y_m));
            let time = on_clock(site.start_ns, step.time_s);
            // to a String, which cannot fail
            let _ = writeln!(text, "{time},{named},{x:.3},{y:.3},{:.4},{size},{near}", step.heading_rad);
        }
    }
    Ok(text)
}

/// Writes the file, whole or not at all.
///
/// # Errors
/// The first track that cannot be kept, by id; a file that cannot be written, which then is what it was.
pub fn write(target: &Target, tracks: &[LabelTrack], site: &Site) -> Result<()> {
    target.write(text(tracks, site)?)
}

/// Reads the tracks of a file, in its order.
///
/// # Errors
/// A file that cannot be read, and the line of the first row that is malformed; the id of what is no track.
pub fn read(path: &Path, site: &Site) -> Result<Vec<LabelTrack>> {
    let mut rows = read_rows::<LabelRow>(path)?;
    for (line, row) in &rows {
        // what the evaluation would refuse
        label(LabelRow { object_id: String::new(), class: row.class.clone(), ..*row })
            .with_context(|| at_line(path, *line))?;
    }
    turn_along_paths(&mut rows);
    let add_ns = clock(&rows, site.start_ns, site.end_ns).add_ns(site.start_ns);
    for (_, row) in &mut rows {
        let since_ns = nanos(row.time_s).saturating_add(add_ns).saturating_sub(site.start_ns);
        row.time_s = micros(since_ns as f64 * 1e-9) as f64 / 1e6;
    }
    let mut order = Vec::new();
    let mut by_id: BTreeMap<&str, Vec<&(u64, LabelRow)>> = BTreeMap::new();
    for row in &rows {
        let id = row.1.object_id.as_str();
        by_id.entry(id).or_insert_with(|| {
            order.push(id);
            Vec::new()
        });
        by_id.entry(id).and_modify(|rows| rows.push(row));
    }
    let tracks: Result<Vec<LabelTrack>> =
        order.iter().filter_map(|id| by_id.get(id)).map(|rows| track(path, rows, site)).collect();
    let tracks = tracks?;
    check_all(&tracks).with_context(|| path.display().to_string())?;
    Ok(tracks)
}

/// The rows of one id as a track.
fn track(path: &Path, rows: &[&(u64, LabelRow)], site: &Site) -> Result<LabelTrack> {
    let mut rows = rows.to_vec();
    rows.sort_by(|a, b| a.1.time_s.total_cmp(&b.1.time_s));
    let Some((_, first)) = rows.first() else { bail!("no rows") };
    let mut times = BTreeSet::new();
    for (line, row) in &rows {
        if row.class != first.class {
            bail!(
                "{}: object {} is a {} here and a {} elsewhere; give one of the two another id",
                at_line(path, *line),
                row.object_id,
                row.class,
                first.class
            );
        }
        ensure!(
            times.insert(micros(row.time_s)),
            "{}: object {} has two rows for one time; give one of the two another id",
            at_line(path, *line),
            row.object_id
        );
    }
    let size_m = match [first.length_m, first.width_m, first.height_m] {
        [Some(l), Some(w), Some(h)] => Some([l, w, h]),
        _ => None,
    };
    let drawn = rows.iter().filter_map(|(_, row)| {
        let (x_m, y_m) = row.near_x_m.zip(row.near_y_m)?;
        Some(LabelPoint { time_s: row.time_s, x_m, y_m })
    });
    let mut track =
        LabelTrack { id: first.object_id.clone(), class: first.class.clone(), size_m, points: drawn.collect() };
    if track.points.is_empty() {
        track.points = near_face::drawn(&steps(&rows), track.size(), site.sensor, TOLERANCE_M);
    }
    Ok(track)
}

/// Boxes of rows.
fn steps(rows: &[&(u64, LabelRow)]) -> Vec<BoxStep> {
    let step = |row: &LabelRow| BoxStep {
        time_s: row.time_s,
        center: [row.x_m, row.y_m],
        heading_rad: row.heading_rad.unwrap_or_default(),
    };
    rows.iter().map(|(_, row)| step(row)).collect()
}

/// A field of a CSV file.
fn quoted(field: &str) -> String {
    if field.contains([',', '"']) { format!("\"{}\"", field.replace('"', "\"\"")) } else { field.to_owned() }
}

fn micros(time_s: f64) -> i64 {
    (time_s * 1e6).round() as i64
}

fn nanos(time_s: f64) -> i64 {
    (time_s * 1e9).round() as i64
}

/// Seconds on the recording's clock, to the nanosecond: an f64 of today's date has steps of 240 ns.
fn on_clock(start_ns: i64, since_s: f64) -> String {
    let ns = start_ns.saturating_add(micros(since_s).saturating_mul(1000));
    let (sign, ns) = (if ns < 0 { "-" } else { "" }, ns.unsigned_abs());
    format!("{sign}{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::labels::read_labels;
    use crate::recording::truth::Truth;
    use crate::results::files::OutputArgs;

    const SITE: Site =
        Site { sensor: [0.0, 0.0], start_ns: 1_777_874_400_123_456_789, end_ns: 1_777_874_460_123_456_789 };

    /// A fresh folder for one test.
    fn folder(test: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("viewshed-labels-{test}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        path
    }

    fn tracks() -> Vec<LabelTrack> {
        let track = |id: &str, class: &str, size_m, points: &[[f64; 3]]| LabelTrack {
            id: id.into(),
            class: class.into(),
            size_m,
            points: points.iter().map(|p| (*p).into()).collect(),
        };
        vec![
            track("12", "truck", None, &[[0.0, 60.0, -5.25], [1.234567, 90.5, -5.25], [3.0, 120.125, -5.0]]),
            track("a \"b\", c", "car", Some([4.2, 1.75, 1.4]), &[[5.5, 100.0, 5.0], [59.999999, 20.0, 5.0]]),
        ]
    }

    #[test]
    fn what_was_saved_is_read_again_with_the_same_points() {
        let folder = folder("again");
        let path = beside(&folder.join("a.mcap"));
        let target = OutputArgs { force: true }.beside([]).file("labels", Some(&path)).unwrap().unwrap();
        write(&target, &tracks(), &SITE).unwrap();
        assert_eq!(read(&path, &SITE).unwrap(), tracks());
        // and once more
        write(&target, &read(&path, &SITE).unwrap(), &SITE).unwrap();
        assert_eq!(read(&path, &SITE).unwrap(), tracks());
        write(&target, &[], &SITE).unwrap();
        assert_eq!(read(&path, &SITE).unwrap(), []);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn the_evaluation_reads_the_boxes_behind_the_drawn_lines() {
        let folder = folder("boxes");
        let path = folder.join("a.labels.csv");
        std::fs::write(&path, text(&tracks(), &SITE).unwrap()).unwrap();
        let truth = Truth::new(read_labels(&path, SITE.start_ns, SITE.end_ns).unwrap().labels);
        let truck = truth.at(SITE.start_ns + 500_000_000)[0];
        assert_eq!(truth.tracks[truck.track].class, "truck");
        assert_eq!(truck.solid.size, [16.5, 2.55, 4.0]);
        // 12.35 m on at 24.7 m/s, and half a truck
        assert!((truck.solid.center[0] - (60.0 + 12.35 + 8.25)).abs() < 0.05, "{truck:?}");
        assert!(truck.solid.yaw_rad.abs() < 0.02 && (truck.speed().unwrap() - 24.7).abs() < 0.1, "{truck:?}");
        let car = truth.at(SITE.start_ns + 30_000_000_000)[0];
        assert_eq!(car.solid.size, [4.2, 1.75, 1.4]);
        // it comes, so its front is near and its centre farther
        assert!((car.solid.center[0] - (100.0 - 24.5 * 80.0 / 54.499999 + 2.1)).abs() < 0.05, "{car:?}");
        assert!((car.solid.yaw_rad.abs() - std::f64::consts::PI).abs() < 0.01);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn boxes_of_another_origin_become_lines_whose_boxes_they_are() {
        let folder = folder("foreign");
        let path = folder.join("a.labels.csv");
        let mut rows = "time_s,object_id,class,x_m,y_m\n# by hand\n".to_owned();
        for k in 0..=100 {
            let t = f64::from(k) * 0.1;
            rows += &format!("{t},7,truck,{},3.5\n", 100.0 - 6.0 * t);
        }
        std::fs::write(&path, rows).unwrap();
        let read = read(&path, &SITE).unwrap();
        assert_eq!((read.len(), read[0].id.as_str(), read[0].size_m), (1, "7", None));
        assert!(read[0].points.len() <= 4, "{:?}", read[0].points);
        assert!((read[0].near_at(5.0).unwrap()[0] - (70.0 - 8.25)).abs() < 0.2);
        for b in boxes(&read[0], SITE.sensor) {
            assert!((b.center[0] - (100.0 - 6.0 * b.time_s)).abs() < 0.25, "{b:?}");
            assert!((b.center[1] - 3.5).abs() < 0.25, "{b:?}");
        }
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_broken_file_is_refused_with_the_line_and_stays_as_it_is() {
        let folder = folder("broken");
        let path = folder.join("a.labels.csv");
        let good = "time_s,object_id,class,x_m,y_m\n0,1,car,10,0\n# a comment\n1,1,car,20,0\n";
        for (row, line, what) in [
            ("2,1,car,thirty,0", 5, "float"),
            ("2,1,car,30", 5, "fields"),
            ("2,1,ship,30,0", 5, "ship"),
            ("2,1,car,NaN,0", 5, "finite"),
            ("2,1,truck,30,0", 5, "elsewhere"),
            ("1,1,car,30,0", 5, "two rows"),
        ] {
            let broken = format!("{good}{row}\n");
            std::fs::write(&path, &broken).unwrap();
            let error = format!("{:#}", read(&path, &SITE).unwrap_err());
            assert!(error.contains(&format!("line {line}")) || error.contains(&format!("line: {line}")), "{error}");
            assert!(error.contains(what) && error.contains("a.labels.csv"), "{error}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), broken);
        }
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn what_is_no_track_is_never_written() {
        let [good, other] = <[LabelTrack; 2]>::try_from(tracks()).unwrap();
        let late = LabelTrack { points: vec![[61.0, 0.0, 0.0].into(), [62.0, 0.0, 0.0].into()], ..other.clone() };
        let error = |tracks: &[LabelTrack]| format!("{:#}", text(tracks, &SITE).unwrap_err());
        assert!(error(&[late]).contains("outside the recording, which lasts 60.0 s"));
        assert!(error(&[good.clone(), good]).contains("two tracks have the id 12"));
    }
}

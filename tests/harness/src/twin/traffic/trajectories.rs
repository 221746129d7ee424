//! Trajectories as CSV, in the form of labels: real traffic, from drones or tracked by other sensors.
//!
//! x and y are the middle of the footprint, the heading is in radians counter-clockwise from +x. Missing
//! sizes are those of the class; a missing heading is 0.

use std::path::Path;

use anyhow::{Context, Result};

use super::frame::RoadFrame;
use super::opened::Text;
use super::types::{Class, Kind};
use super::{Collector, Row};
use crate::recording::labels::{self, LabelRow};

pub const COLUMNS: &str = "time_s,object_id,class,x_m,y_m,heading_rad,length_m,width_m,height_m";

/// Whether a first line is a heading of this form.
pub fn is_heading(line: &str) -> bool {
    let names: Vec<&str> = line.split(',').map(str::trim).collect();
    ["time_s", "object_id", "class", "x_m", "y_m"].iter().all(|needed| names.contains(needed))
}

/// Reads all rows of a file into `collected`.
///
/// # Errors
/// Names file, line and object of the first row that cannot be used.
pub fn read(text: &mut Text, path: &Path, frame: &RoadFrame, collected: &mut Collector) -> Result<()> {
    let above = text.line().number() - 1;
    let mut csv = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text);
    for (k, row) in csv.deserialize::<LabelRow>().enumerate() {
        let line = above + 2 + k as u64;
        let place = || format!("{}, line {line}", path.display());
        let row = row.with_context(place)?;
        let id = row.object_id.clone();
        let place = || format!("{}, object `{id}`", place());
        let label = labels::label(row).with_context(place)?;
        let class = Class::named(&label.class)
            .with_context(|| format!("class `{}` is none that drives on a road here", label.class))
            .with_context(place)?;
        let [x, y, _] = label.solid.center;
        let row = Row {
            time_s: label.time_ns as f64 * 1e-9,
            id: label.id,
            kind: Kind { class, size: label.solid.size },
            is_person: false,
            written: [x, y],
            center: frame.place([x, y]),
            heading_rad: frame.heading(label.solid.yaw_rad),
        };
        collected.add(row).with_context(place)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::BufRead;

    use super::super::{Region, Traffic, opened};
    use super::*;

    const REGION: Region = Region { from_s: 0.0, to_s: 10.0, center: [0.0, 0.0], radius_m: 100.0 };

    fn parse(rows: &str) -> Result<Traffic> {
        let text = format!("{COLUMNS}\n{rows}");
        let reader = opened::Counted::new(Box::new(std::io::Cursor::new(text)) as Box<dyn BufRead>);
        let (mut rest, _) = opened::first_line(reader)?;
        let mut collected = Collector::new(REGION);
        read(&mut rest, Path::new("t.csv"), &RoadFrame::default(), &mut collected)?;
        collected.finish(Path::new("t.csv"))
    }

    #[test]
    fn rows_are_centres_and_headings_of_the_road() {
        let traffic =
            parse("0,a,truck,10,2,3.25,12,2.5,3.5\n1,a,truck,0,2,3.25,12,2.5,3.5\n0,b,car,1,1,,,,\n1,b,car,2,1,,,,\n")
                .unwrap();
        let pose = traffic.vehicles[0].at(0.5).unwrap();
        assert!((pose.solid.center[0] - 5.0).abs() < 1e-9);
        assert_eq!((pose.solid.yaw_rad, pose.solid.size), (3.25, [12.0, 2.5, 3.5]));
        assert_eq!(traffic.vehicles[1].kind.size, Class::Car.size());
    }

    #[test]
    fn bad_rows_are_named_by_file_line_and_object() {
        let error = |row: &str| format!("{:#}", parse(&format!("0,a,car,1,1,0,,,\n{row}\n")).unwrap_err());
        for (row, what) in [
            ("1,b,car,nan,1,0,,,", "not finite"),
            ("1,b,ship,1,1,0,,,", "class `ship`"),
            ("1,b,ship,1,1,0,1,1,1", "class `ship`"),
            ("0,a,car,1,1,0,,,", "order of time"),
            ("1,b,car,1", "line 3"),
        ] {
            let text = error(row);
            assert!(text.contains("t.csv, line 3") && text.contains(what), "{row}: {text}");
        }
    }
}

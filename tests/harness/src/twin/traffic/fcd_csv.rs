//! SUMO's floating car data as CSV: what `sumo --fcd-output x.csv` and `xml2csv.py` write.
//!
//! Columns by name, with or without the element's name before them (`vehicle_x` or `x`), separated by a
//! semicolon, a comma or a tab. Lines of time steps without a vehicle are skipped.

use std::path::Path;

use anyhow::{Context, Result};
use csv::StringRecord;

use super::fcd_xml::{finite, from_bumper, seconds};
use super::frame::RoadFrame;
use super::opened::Text;
use super::types::VehicleTypes;
use super::{Collector, Row};

/// Columns that are needed, in the order of [`Columns`].
const NEEDED: [&str; 6] = ["time", "id", "x", "y", "angle", "type"];

/// Whether a first line is a heading of this form.
pub fn is_heading(line: &str) -> bool {
    columns(line).is_some()
}

fn separator(line: &str) -> char {
    [';', '\t', ','].into_iter().find(|s| line.contains(*s)).unwrap_or(',')
}

/// Place of each needed column.
fn columns(line: &str) -> Option<[usize; 6]> {
    let names: Vec<&str> = line.split(separator(line)).map(|n| n.trim().trim_matches('"')).collect();
    let find = |key: &str| {
        let element = if key == "time" { "timestep_" } else { "vehicle_" };
        names.iter().position(|n| *n == key || n.strip_prefix(element) == Some(key))
    };
    let found: Vec<usize> = NEEDED.iter().filter_map(|key| find(key)).collect();
    found.try_into().ok()
}

/// Reads all rows of a file into `collected`.
///
/// # Errors
/// Names file, line and vehicle of the first row that cannot be used.
pub fn read(
    text: &mut Text,
    path: &Path,
    types: &VehicleTypes,
    frame: &RoadFrame,
    collected: &mut Collector,
) -> Result<()> {
    let above = text.line().number() - 1;
    let mut heading = String::new();
    std::io::BufRead::read_line(text, &mut heading)?;
    let columns = columns(heading.trim()).context("the heading has been looked at before")?;
    let mut csv = csv::ReaderBuilder::new()
        .delimiter(separator(&heading) as u8)
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text);
    let mut record = StringRecord::new();
    loop {
        let more = csv.read_record(&mut record).with_context(|| path.display().to_string())?;
        if !more {
            return Ok(());
        }
        let line = above + 1 + record.position().map_or(0, csv::Position::line);
        let place = || format!("{}, line {line}", path.display());
        if let Some(row) = row(&record, columns, types, frame).with_context(place)? {
            let id = row.id.clone();
            collected.add(row).with_context(|| format!("{}, vehicle `{id}`", place()))?;
        }
    }
}

fn row(record: &StringRecord, columns: [usize; 6], types: &VehicleTypes, frame: &RoadFrame) -> Result<Option<Row>> {
    let [time, id, x, y, angle, kind] = columns.map(|c| record.get(c).unwrap_or_default());
    if id.is_empty() {
        return Ok(None);
    }
    let read = || -> Result<Row> {
        let bumper = [finite("x", x)?, finite("y", y)?];
        Ok(from_bumper(id.to_owned(), seconds(time)?, types.kind(kind)?, bumper, finite("angle", angle)?, frame))
    };
    read().map(Some).with_context(|| format!("vehicle `{id}`"))
}

#[cfg(test)]
mod tests {
    use std::io::BufRead;

    use super::super::{Region, Traffic, opened};
    use super::*;

    const REGION: Region = Region { from_s: 0.0, to_s: 10.0, center: [0.0, 0.0], radius_m: 100.0 };

    fn parse(text: &str) -> Result<Traffic> {
        let reader = opened::Counted::new(Box::new(std::io::Cursor::new(text.to_owned())) as Box<dyn BufRead>);
        let (mut rest, _) = opened::first_line(reader)?;
        let mut collected = Collector::new(REGION);
        read(&mut rest, Path::new("t.csv"), &VehicleTypes::default(), &RoadFrame::default(), &mut collected)?;
        collected.finish(Path::new("t.csv"))
    }

    #[test]
    fn both_forms_of_heading_give_the_same_traffic() {
        let rows = "0.00;a;10;2;90.00;car\n1.00;;;;;\n0.50;a;20;2;90.00;car\n";
        let native = format!("timestep_time;vehicle_id;vehicle_x;vehicle_y;vehicle_angle;vehicle_type\n{rows}");
        let plain = format!("# from elsewhere\ntime,id,x,y,angle,type\n{}", rows.replace(';', ","));
        for text in [native, plain] {
            let traffic = parse(&text).unwrap();
            let pose = traffic.vehicles[0].at(0.25).unwrap();
            assert!((pose.solid.center[0] - 12.7).abs() < 1e-9 && (pose.velocity[0] - 20.0).abs() < 1e-9);
        }
    }

    #[test]
    fn bad_rows_are_named_by_file_line_and_vehicle() {
        let heading = "# note\ntime;id;x;y;angle;type\n0;a;1;1;90;car\n";
        let error = |row: &str| format!("{:#}", parse(&format!("{heading}{row}\n")).unwrap_err());
        assert!(
            error("1;b;NaN;1;90;car").contains("t.csv, line 4: vehicle `b`: x `NaN`"),
            "{}",
            error("1;b;NaN;1;90;car")
        );
        assert!(error("1;b;1;1;90;rocket").contains("unknown vehicle type `rocket`"));
        assert!(error("0:01;b;1;1;90;car").contains("no number of seconds"));
        assert!(error("0;a;1;1;90;car").contains("vehicle `a`"), "twice at one time");
        assert!(error("1;b;1").contains("line 4"), "{}", error("1;b;1"));
    }
}

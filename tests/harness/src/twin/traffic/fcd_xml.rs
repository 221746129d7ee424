//! SUMO's floating car data as XML: `<timestep time>` with `<vehicle id x y angle type>` in it.
//!
//! # References
//! SUMO documentation, "FCD Output": x and y are the middle of the front bumper, the angle is in degrees
//! clockwise from north.

use std::path::Path;

use anyhow::{Context, Result, bail};
use quick_xml::events::{BytesStart, Event};

use super::frame::RoadFrame;
use super::opened::{Text, attribute};
use super::types::VehicleTypes;
use super::{Collector, Row};

/// Reads all rows of a file into `collected`.
///
/// # Errors
/// Names file, line and vehicle of the first row that cannot be used, and a file that is cut off.
pub fn read(text: Text, path: &Path, types: &VehicleTypes, frame: &RoadFrame, collected: &mut Collector) -> Result<()> {
    let line = text.line();
    let mut xml = quick_xml::Reader::from_reader(text);
    let mut buffer = Vec::new();
    let mut time_s = None;
    let mut depth = 0_i64;
    loop {
        buffer.clear();
        let place = || format!("{}, line {}", path.display(), line.number());
        let event = xml.read_event_into(&mut buffer).with_context(place)?;
        depth += match event {
            Event::Start(_) => 1,
            Event::End(_) => -1,
            _ => 0,
        };
        match event {
            Event::Start(e) | Event::Empty(e) => match e.name().as_ref() {
                "timestep" => time_s = Some(time(&e).with_context(place)?),
                who @ ("vehicle" | "person") => {
                    let time_s =
                        time_s.with_context(|| format!("<{who}> outside of a <timestep>")).with_context(place)?;
                    let row = row(&e, time_s, types, frame).with_context(place)?;
                    let id = row.id.clone();
                    collected.add(row).with_context(|| format!("{}, {who} `{id}`", place()))?;
                }
                _ => {}
            },
            Event::Eof if depth > 0 => bail!("{}: cut off, the file ends within an element", place()),
            Event::Eof if time_s.is_none() => bail!("{}: no <timestep>, so it is no FCD", path.display()),
            Event::Eof => return Ok(()),
            _ => {}
        }
    }
}

fn time(element: &BytesStart) -> Result<f64> {
    let text = attribute(element, "time")?.context("<timestep> without a time")?;
    seconds(&text)
}

/// Seconds of an FCD, from text.
pub fn seconds(text: &str) -> Result<f64> {
    let value = text.parse::<f64>().ok().filter(|v| v.is_finite());
    value.with_context(|| {
        format!("time `{text}` is no number of seconds (SUMO writes them without --human-readable-time)")
    })
}

fn row(element: &BytesStart, time_s: f64, types: &VehicleTypes, frame: &RoadFrame) -> Result<Row> {
    let id = attribute(element, "id")?.context("a vehicle without an id")?;
    let number = |key: &str| -> Result<f64> {
        finite(key, &attribute(element, key)?.with_context(|| format!("no attribute `{key}`"))?)
    };
    let person = element.name().as_ref() == "person";
    let read = || -> Result<Row> {
        let kind = match attribute(element, "type")? {
            Some(name) if person && name.starts_with("DEFAULT_") => types.kind("pedestrian"),
            Some(name) => types.kind(&name),
            None if person => types.kind("pedestrian"),
            None => bail!("no attribute `type`"),
        }?;
        let bumper = [number("x")?, number("y")?];
        let row = from_bumper(id.clone(), time_s, kind, bumper, number("angle")?, frame);
        Ok(Row { is_person: person, ..row })
    };
    read().with_context(|| format!("{} `{id}`", if person { "person" } else { "vehicle" }))
}

/// A finite number, from text.
pub fn finite(key: &str, text: &str) -> Result<f64> {
    let value = text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    value.with_context(|| format!("{key} `{text}` is no finite number"))
}

/// A row from what SUMO gives: the front bumper and a compass angle.
pub fn from_bumper(
    id: String,
    time_s: f64,
    kind: super::Kind,
    bumper: [f64; 2],
    compass_deg: f64,
    frame: &RoadFrame,
) -> Row {
    let heading_rad = frame.heading((90.0 - compass_deg).to_radians());
    let (s, c) = heading_rad.sin_cos();
    let [x, y] = frame.place(bumper);
    let half = kind.size[0] / 2.0;
    let center = [x - half * c, y - half * s];
    Row { time_s, id, kind, is_person: false, written: bumper, center, heading_rad }
}

#[cfg(test)]
mod tests {
    use std::io::BufRead;

    use super::super::{Region, Traffic, opened};
    use super::*;

    const REGION: Region = Region { from_s: 0.0, to_s: 10.0, center: [0.0, 0.0], radius_m: 100.0 };

    fn parse(text: &str) -> Result<Traffic> {
        let text = text.to_owned().into_bytes();
        let reader = opened::Counted::new(Box::new(std::io::Cursor::new(text)) as Box<dyn BufRead>);
        let mut collected = Collector::new(REGION);
        read(reader, Path::new("t.xml"), &VehicleTypes::default(), &RoadFrame::default(), &mut collected)?;
        collected.finish(Path::new("t.xml"))
    }

    fn with(vehicle: &str) -> String {
        format!(
            "<fcd-export>\n<timestep time=\"0.00\">\n<vehicle {vehicle}/>\n</timestep>\n<timestep time=\"0.50\">\n<vehicle {vehicle}/>\n</timestep>\n</fcd-export>\n"
        )
    }

    #[test]
    fn the_bumper_is_in_front_and_north_is_up() {
        // a truck of 16.5 m driving north: its middle is 8.25 m south of the bumper
        let traffic = parse(&with(r#"id="t" x="3" y="20" angle="0" type="truck""#)).unwrap();
        let pose = traffic.vehicles[0].at(0.25).unwrap();
        let [x, y, z] = pose.solid.center;
        assert!((x - 3.0).abs() < 1e-9 && (y - 11.75).abs() < 1e-9 && z == 2.0, "{x} {y} {z}");
        assert!((pose.solid.yaw_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        let east = parse(&with(r#"id="t" x="20" y="3" angle="90" type="car""#)).unwrap();
        assert!((east.vehicles[0].at(0.0).unwrap().solid.center[0] - 17.7).abs() < 1e-9);
    }

    #[test]
    fn persons_without_a_type_walk() {
        let text = with(r#"id="p" x="3" y="20" angle="0""#).replace("<vehicle", "<person");
        assert_eq!(parse(&text).unwrap().vehicles[0].kind.class.name(), "pedestrian");
    }

    #[test]
    fn bad_rows_are_named_by_file_line_and_vehicle() {
        let error = |vehicle: &str| format!("{:#}", parse(&with(vehicle)).unwrap_err());
        let place = |text: &str, what: &str| {
            assert!(text.contains("t.xml, line 3") && text.contains("`v`") && text.contains(what), "{text}");
        };
        place(&error(r#"id="v" x="nan" y="1" angle="0" type="car""#), "x `nan` is no finite number");
        place(&error(r#"id="v" x="1" y="inf" angle="0" type="car""#), "y `inf`");
        place(&error(r#"id="v" x="1" y="1" angle="0" type="rocket""#), "unknown vehicle type `rocket`");
        place(&error(r#"id="v" x="1" y="1" type="car""#), "no attribute `angle`");
        assert!(error(r#"x="1" y="1" angle="0" type="car""#).contains("without an id"));
    }

    #[test]
    fn a_file_cut_off_or_of_another_kind_is_told() {
        let whole = with(r#"id="v" x="1" y="1" angle="0" type="car""#);
        for cut in [whole.len() - 15, whole.len() - 40, whole.len() - 60] {
            assert!(parse(&whole[..cut]).is_err(), "{}", &whole[..cut]);
        }
        let other = parse("<routes><route id=\"a\"/></routes>").unwrap_err().to_string();
        assert!(other.contains("no <timestep>"), "{other}");
        let clock = parse("<fcd-export><timestep time=\"00:01:00\"/></fcd-export>").unwrap_err();
        assert!(format!("{clock:#}").contains("human-readable-time"), "{clock:#}");
    }
}

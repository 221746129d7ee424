//! From the coordinates of a traffic file to the road frame.

use std::path::Path;

use anyhow::{Context, Result, bail};
use quick_xml::events::Event;

use super::opened;

/// Origin and direction of the road frame, as the traffic file would say it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RoadFrame {
    /// Origin of the road frame in the coordinates before a net's offset, metres.
    pub origin: [f64; 2],
    /// Direction of the road's x axis from the file's x axis (east), counter-clockwise, radians.
    pub heading_rad: f64,
    /// What SUMO's net has been shifted by.
    pub net_offset: [f64; 2],
}

impl RoadFrame {
    pub fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (s, c) = self.heading_rad.sin_cos();
        let (dx, dy) = (x - self.net_offset[0] - self.origin[0], y - self.net_offset[1] - self.origin[1]);
        [c * dx + s * dy, -s * dx + c * dy]
    }

    /// A direction counter-clockwise from the file's x axis, as one from the road's.
    pub fn heading(&self, file_rad: f64) -> f64 {
        file_rad - self.heading_rad
    }
}

/// The offset a SUMO net was shifted by: `<location netOffset="x,y">`.
///
/// # Errors
/// A file that cannot be read or is no net.
pub fn net_offset(path: &Path) -> Result<[f64; 2]> {
    let place = || format!("SUMO net {}", path.display());
    let text = opened::open(path).with_context(place)?;
    let mut xml = quick_xml::Reader::from_reader(text);
    let mut buffer = Vec::new();
    loop {
        buffer.clear();
        match xml.read_event_into(&mut buffer).with_context(place)? {
            Event::Start(e) | Event::Empty(e) if e.name().as_ref() == "location" => {
                let text = opened::attribute(&e, "netOffset").with_context(place)?.unwrap_or_default();
                let numbers: Vec<f64> = text.split(',').filter_map(|v| v.trim().parse().ok()).collect();
                let [x, y] = numbers[..] else {
                    bail!("{}: <location netOffset=\"{text}\"> is no pair of numbers", place());
                };
                return Ok([x, y]);
            }
            Event::Eof => bail!("{}: it has no <location> element, so it is no SUMO net", place()),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_net_shifted_and_turned_is_undone() {
        // the road runs north; the net was moved by (1000, 500)
        let frame =
            RoadFrame { origin: [100.0, 50.0], heading_rad: std::f64::consts::FRAC_PI_2, net_offset: [1000.0, 500.0] };
        let [x, y] = frame.place([1100.0, 570.0]);
        assert!((x - 20.0).abs() < 1e-12 && y.abs() < 1e-12, "north of the origin is ahead");
        let [_, left] = frame.place([1090.0, 550.0]);
        assert!((left - 10.0).abs() < 1e-12, "west of it is left");
        assert_eq!(frame.heading(std::f64::consts::FRAC_PI_2), 0.0);
    }
}

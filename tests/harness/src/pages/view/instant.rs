//! What there is to see at one instant: the maps, what they are made of, and what is known of their senders.
//!
//! # Model
//! A map's cells are two bytes each, azimuth by azimuth from right to left, near cells first: the grade, and the state
//! (0 unknown, 1 invisible, 2 visible; 4 more where occupied). They travel as base64 in JSON.

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde::{Deserialize, Serialize};
use viewshed::map::{CellState, Visibility};
use viewshed::probability::Probability;

use crate::bus::listening::Heard;
use crate::geometry::azimuths::{EVEN, bearing_rad};
use crate::geometry::pose::SensorPose;
use crate::geometry::solid::Solid;

/// Set in the state of what is occupied.
const OCCUPIED: u8 = 4;

/// One map.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Shown {
    /// Whose it is.
    pub name: String,
    pub cells: Cells,
    /// Base64 of two bytes a cell; `None` where nothing is known.
    pub bytes: Option<String>,
    /// Of a received map: milliseconds since each azimuth's last news; `None` where it is unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ages_ms: Option<Vec<Option<u32>>>,
    /// Of a sender with a table of probabilities: base64 of a byte a cell, the least probability that a vehicle there is
    /// detected, 1/255; 0 where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probabilities: Option<String>,
}

/// Where the cells of a map lie.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Cells {
    pub azimuths: usize,
    pub ranges: usize,
    /// From right to left, radians from the sensor's heading.
    pub azimuth_rad: [f64; 2],
    /// The first azimuth that is narrower than the others, the first behind them, how many times.
    pub narrow: [u8; 3],
    pub cell_m: f64,
    /// Road frame: x, y, height in metres, heading in radians.
    pub mount: [f64; 4],
}

/// An upright box on the road.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Box3 {
    pub center: [f64; 3],
    pub yaw_rad: f64,
    pub size: [f64; 3],
    /// A label's id and class.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// TV, FV, TI or FI, where it counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outcome: Option<String>,
}

/// How much of everything there is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Sample {
    pub time_s: f64,
    /// Shares of the cells of the first map.
    pub visible: f64,
    pub invisible: f64,
    pub unknown: f64,
    pub detections: usize,
    pub tv: u32,
    pub fv: u32,
    pub ti: u32,
    pub fi: u32,
}

/// Everything of one instant.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Instant {
    pub number: usize,
    pub sample: Sample,
    pub maps: Vec<Shown>,
    /// x and y on the road in metres, radial velocity in m/s.
    pub detections: Vec<[f32; 3]>,
    /// Labelled vehicles.
    pub boxes: Vec<Box3>,
    /// What the estimator believes in.
    pub obstacles: Vec<Box3>,
    /// Senders of a broadcast.
    pub senders: Vec<Heard>,
    pub counters: Vec<(String, u64)>,
}

/// What a question about a cell needs of an instant.
#[derive(Debug, Deserialize)]
pub struct Remembered {
    pub sample: RememberedTime,
    pub maps: Vec<Shown>,
    pub boxes: Vec<Box3>,
    pub obstacles: Vec<Box3>,
}

#[derive(Debug, Deserialize)]
pub struct RememberedTime {
    pub time_s: f64,
}

impl Box3 {
    pub fn of(solid: &Solid) -> Self {
        Self { center: solid.center, yaw_rad: solid.yaw_rad, size: solid.size, name: None, outcome: None }
    }

    pub fn solid(&self) -> Solid {
        Solid { center: self.center, yaw_rad: self.yaw_rad, size: self.size }
    }
}

impl Cells {
    /// Middle of a cell on the road.
    pub fn middle(&self, azimuth: usize, range: usize) -> [f64; 2] {
        let angle = bearing_rad(self.azimuth_rad, self.narrow, self.azimuths.max(1), azimuth as f64 + 0.5);
        let distance = (range as f64 + 0.5) * self.cell_m;
        let [x, y, _, heading] = self.mount;
        [x + distance * (heading + angle).cos(), y + distance * (heading + angle).sin()]
    }
}

/// A sensor's place as pages take it.
pub fn mount(pose: &SensorPose) -> [f64; 4] {
    let [x, y, height] = pose.position;
    [x, y, height, pose.yaw_rad()]
}

impl Shown {
    /// A map of states, and the shares of its cells.
    pub fn new(name: &str, cells: Cells, state: impl Fn(usize, usize) -> CellState) -> (Self, Sample) {
        let mut bytes = Vec::with_capacity(2 * cells.azimuths * cells.ranges);
        let mut sample = Sample::default();
        let one = 1.0 / (cells.azimuths * cells.ranges).max(1) as f64;
        for (azimuth, range) in (0..cells.azimuths).flat_map(|a| (0..cells.ranges).map(move |r| (a, r))) {
            let cell = state(azimuth, range);
            let (code, share) = match cell.visibility {
                Visibility::Unknown => (0, &mut sample.unknown),
                Visibility::Invisible => (1, &mut sample.invisible),
                Visibility::Visible => (2, &mut sample.visible),
            };
            *share += one;
            bytes.extend([cell.grade, code + if cell.occupied && code > 0 { OCCUPIED } else { 0 }]);
        }
        let bytes = Some(BASE64.encode(bytes));
        (Self { name: name.to_owned(), cells, bytes, ages_ms: None, probabilities: None }, sample)
    }

    /// Of a sensor that never said where its cells lie.
    pub fn nothing(name: &str, mount: [f64; 4]) -> Self {
        let cells = Cells { azimuths: 0, ranges: 0, azimuth_rad: [0.0; 2], narrow: EVEN, cell_m: 1.0, mount };
        Self { name: name.to_owned(), cells, bytes: None, ages_ms: None, probabilities: None }
    }

    /// With the least probabilities that vehicles are detected.
    pub fn with_probabilities(self, of: impl Fn(usize, usize) -> Option<Probability>) -> Self {
        let places = (0..self.cells.azimuths).flat_map(|a| (0..self.cells.ranges).map(move |r| (a, r)));
        let bytes: Vec<u8> = places.map(|(azimuth, range)| of(azimuth, range).map_or(0, Probability::raw)).collect();
        Self { probabilities: Some(BASE64.encode(bytes)), ..self }
    }

    /// The least probability that a vehicle in a cell is detected, where it is said.
    pub fn probability(&self, azimuth: usize, range: usize) -> Option<f64> {
        if azimuth >= self.cells.azimuths || range >= self.cells.ranges {
            return None;
        }
        let bytes = BASE64.decode(self.probabilities.as_ref()?).ok()?;
        let raw = bytes.get(azimuth * self.cells.ranges + range).filter(|raw| **raw > 0)?;
        Some(f64::from(*raw) / 255.0)
    }

    /// A cell's grade and state; `None` outside, and where nothing is known of the map.
    pub fn cell(&self, azimuth: usize, range: usize) -> Option<(u8, u8)> {
        if azimuth >= self.cells.azimuths || range >= self.cells.ranges {
            return None;
        }
        let bytes = BASE64.decode(self.bytes.as_ref()?).ok()?;
        let at = 2 * (azimuth * self.cells.ranges + range);
        Some((*bytes.get(at)?, *bytes.get(at + 1)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELLS: Cells = Cells {
        azimuths: 2,
        ranges: 3,
        azimuth_rad: [-0.2, 0.2],
        narrow: EVEN,
        cell_m: 10.0,
        mount: [5.0, 0.0, 6.0, 0.0],
    };

    #[test]
    fn a_cell_comes_back_as_it_was_and_shares_add_up() {
        let state = |azimuth, range| CellState {
            visibility: [Visibility::Unknown, Visibility::Invisible, Visibility::Visible][range],
            grade: 10 * azimuth as u8 + range as u8,
            occupancy: 0,
            occupied: azimuth == 1,
        };
        let (shown, sample) = Shown::new("m", CELLS, state);
        let found: Vec<_> = (0..3).map(|range| shown.cell(1, range).unwrap()).collect();
        assert_eq!(found, [(10, 0), (11, 5), (12, 6)], "what is unknown is not occupied");
        assert_eq!((shown.cell(0, 2), shown.cell(2, 0), shown.cell(0, 3)), (Some((2, 2)), None, None));
        assert!((sample.visible - 1.0 / 3.0).abs() < 1e-9 && (sample.unknown - 1.0 / 3.0).abs() < 1e-9);
    }

    #[test]
    fn the_first_azimuth_is_the_rightmost() {
        let [x, y] = CELLS.middle(0, 2);
        assert!((x - 5.0 - 25.0 * 0.1_f64.cos()).abs() < 1e-9 && (y + 25.0 * 0.1_f64.sin()).abs() < 1e-9);
    }
}

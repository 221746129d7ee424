//! What a unit keeps of its place: blocks for the tests of every board, and what a PC makes of the same.

use viewshed::estimator::Estimator;
use viewshed::frame::health::FrameStatus;
use viewshed::map::polar::PolarMap;
use viewshed::probability::{Edges, ProbabilityTable, Quantiser, Threshold, fitted_with};
use viewshed::unit::profile::reference::{Map, State};
use viewshed::unit::settings::{Settings, table_block};
use viewshed::wire::header::Header;
use viewshed_harness::boards::scans::Scan;
use viewshed_harness::configure::kept::{of_heights, of_lanes};

/// Both carriageways of the shipped motorway, roughly.
pub const LANES: [&[[f32; 2]]; 2] = [&[[-20.0, -1.75], [60.55, -1.75], [180.0, -2.0]], &[[180.0, 9.25], [-20.0, 9.25]]];
/// A road that climbs by 3 % ahead of the sensor.
pub const HEIGHTS: [[f32; 2]; 3] = [[-40.0, 101.2], [0.0, 101.2], [200.0, 107.2]];
pub const THRESHOLD: Threshold = Threshold::From(200);
pub const GRID: [u8; 2] = [State::RANGES as u8, State::AZIMUTHS as u8];

/// The settings with lanes and heights, as a PC has them.
pub fn with_place(settings: &Settings) -> Settings {
    Settings { lanes: &LANES, ground: &HEIGHTS, ..*settings }
}

/// A made-up table of a unit with this fingerprint that rises with the grade and falls with range.
pub fn table(fingerprint: u32) -> ProbabilityTable {
    let edges = Edges {
        grades: [2, 26, 51, 76, 102, 128, 153, 179, 204, 230, 255],
        ranges_cm: [2000, 4000, 6000, 8000, 10_000, 13_000, 16_000],
        azimuths: [-6000, -3000, -1500, 0, 1500, 3000, 6000],
    };
    let values =
        std::array::from_fn(|a| std::array::from_fn(|r| std::array::from_fn(|g| (100 + 14 * g - 3 * r - a) as u8)));
    ProbabilityTable::new(edges, values, fitted_with(fingerprint)).unwrap()
}

/// Blocks of heights, lanes, and the table of a unit with these settings.
pub fn blocks(settings: &Settings) -> [Vec<u8>; 3] {
    let table = table(with_place(settings).fingerprint());
    [of_heights(&HEIGHTS).unwrap(), of_lanes(&LANES).unwrap(), table_block(GRID, &table, Some(THRESHOLD)).to_vec()]
}

/// What a PC makes of the scans by settings with their place: header, map, and its bits by the table.
pub fn on_a_pc(settings: &Settings, scans: &[Scan]) -> (Header, Box<Map>, Quantiser) {
    let mut parameters = None;
    let header = settings.build::<State>(&mut parameters).unwrap();
    let parameters = parameters.unwrap();
    let (mut state, mut map) = (Box::new(State::new()), Box::new(PolarMap::NOWHERE));
    State::prepare(&parameters, &mut map);
    state.forget(&mut map);
    for scan in scans {
        let status = FrameStatus::from(false);
        Estimator::process(&mut *state, &parameters, scan.time, &scan.detections, status, &mut *map, &mut || {});
    }
    let quantiser = Quantiser::new(table(settings.fingerprint()), Some(THRESHOLD), parameters.visible_from());
    (header, map, quantiser)
}

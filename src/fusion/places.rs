//! Which cell of a polar map lies at each cell of the road.

use crate::map::polar::{PolarGeometry, PolarMap};
use crate::sensor::road::RoadPoint;

/// Number of a polar map's cell, azimuth by azimuth; [`NOWHERE`] beyond it.
pub type Place = u16;

const NOWHERE: Place = Place::MAX;

/// From a sensor, along either axis.
const FARTHEST_CM: u32 = 40_000;

/// Those of a sensor.
#[derive(Debug, Clone)]
pub struct Places<const NX: usize, const NY: usize> {
    /// What they were worked out for: geometry, ranges, azimuths, and the map's threshold.
    of: Option<(PolarGeometry, usize, usize, u8)>,
    rows: [[Place; NY]; NX],
    /// First cell of each row that the map reaches, and the one behind the last.
    spans: [(u16, u16); NX],
}

impl<const NX: usize, const NY: usize> Places<NX, NY> {
    /// Of no sensor.
    pub const NONE: Self = {
        assert!(NY <= u16::MAX as usize);
        Self { of: None, rows: [[NOWHERE; NY]; NX], spans: [(0, 0); NX] }
    };

    /// Whether they are those of a map.
    pub fn fit<const R: usize, const A: usize>(&self, map: &PolarMap<R, A>) -> bool {
        self.of == Some((*map.geometry(), R, A, map.visible_from()))
    }

    /// Whether they are those of any map.
    pub fn are_worked_out(&self) -> bool {
        self.of.is_some()
    }

    /// Works them out.
    #[inline(never)]
    pub fn work_out<const R: usize, const A: usize>(&mut self, map: &PolarMap<R, A>, origin: RoadPoint, cell_cm: i32) {
        const { assert!(A <= 255 && R * A < NOWHERE as usize) }
        let sensor = map.geometry().levelling.origin();
        let near = |a: i32, b: i32| a.abs_diff(b) <= FARTHEST_CM;
        self.of = Some((*map.geometry(), R, A, map.visible_from()));
        for (i, (row, span)) in (0..).zip(self.rows.iter_mut().zip(&mut self.spans)) {
            *span = (0, 0);
            for (j, place) in (0..).zip(row) {
                let point = super::centre(origin, cell_cm, i, i32::from(j));
                let (x, y) = map.geometry().levelling.place(point);
                // farther ones are placed nearer than they are
                let reached = near(point.x_cm, sensor.x_cm) && near(point.y_cm, sensor.y_cm);
                let cell = map
                    .locate(x, y)
                    .filter(|_| reached)
                    .and_then(|(azimuth, range)| Place::try_from(azimuth * R + range).ok());
                *place = cell.unwrap_or(NOWHERE);
                if cell.is_some() {
                    let first = if span.1 == 0 { j } else { span.0 };
                    *span = (first, j.saturating_add(1));
                }
            }
        }
    }

    /// Row by row.
    pub fn rows(&self) -> &[[Place; NY]; NX] {
        &self.rows
    }

    /// What the map reaches of each row.
    pub fn spans(&self) -> &[(u16, u16); NX] {
        &self.spans
    }
}

//! Which cell of a polar map lies at each cell of the road.

use crate::map::CellState;
use crate::map::polar::{PolarGeometry, PolarMap};
use crate::sensor::road::RoadPoint;

/// A cell of a polar map; [`NOWHERE`](Self::NOWHERE) beyond it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    azimuth: u8,
    range: u8,
}

impl Place {
    const NOWHERE: Self = Self { azimuth: u8::MAX, range: u8::MAX };

    /// What a map says there; a map has at most 255 azimuths.
    pub fn of<const R: usize, const A: usize>(self, map: &PolarMap<R, A>) -> CellState {
        const { assert!(A <= u8::MAX as usize && R <= 1 + u8::MAX as usize) }
        if self == Self::NOWHERE {
            return CellState::UNKNOWN;
        }
        map.cell(usize::from(self.azimuth), usize::from(self.range))
    }
}

/// Those of a sensor.
#[derive(Debug, Clone)]
pub struct Places<const NX: usize, const NY: usize> {
    /// What they were worked out for: geometry, ranges, azimuths.
    of: Option<(PolarGeometry, usize, usize)>,
    rows: [[Place; NY]; NX],
    /// First cell of each row that the map reaches, and the one behind the last.
    spans: [(u16, u16); NX],
}

impl<const NX: usize, const NY: usize> Places<NX, NY> {
    /// Of no sensor.
    pub const NONE: Self = {
        assert!(NY <= u16::MAX as usize);
        Self { of: None, rows: [[Place::NOWHERE; NY]; NX], spans: [(0, 0); NX] }
    };

    /// Whether they are those of a map.
    pub fn fit<const R: usize, const A: usize>(&self, map: &PolarMap<R, A>) -> bool {
        self.of == Some((*map.geometry(), R, A))
    }

    /// Works them out.
    #[inline(never)]
    pub fn work_out<const R: usize, const A: usize>(&mut self, map: &PolarMap<R, A>, origin: RoadPoint, cell_cm: i32) {
        self.of = Some((*map.geometry(), R, A));
        for (i, (row, span)) in (0..).zip(self.rows.iter_mut().zip(&mut self.spans)) {
            *span = (0, 0);
            for (j, place) in (0..).zip(row) {
                let point = super::centre(origin, cell_cm, i, i32::from(j));
                let (x, y) = map.geometry().levelling.place(point);
                let cell = map.locate(x, y).and_then(|(a, r)| Some((u8::try_from(a).ok()?, u8::try_from(r).ok()?)));
                *place = cell.map_or(Place::NOWHERE, |(azimuth, range)| Place { azimuth, range });
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

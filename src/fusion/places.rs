//! Which cells of a polar map lie at each cell of the road.

use crate::map::polar::{PolarGeometry, PolarMap};
use crate::map::query::Footprint;
use crate::sensor::road::RoadPoint;

/// Cells of a polar map that a cell of the road touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TouchedCells {
    /// The first one's number, azimuth by azimuth.
    first: u16,
    /// How many azimuths, none where the map does not reach.
    azimuths: u8,
    /// How many ranges of each, and whether that is all: a bit says that a part of the cell lies beyond the map.
    ranges: u8,
}

const NOWHERE: TouchedCells = TouchedCells { first: 0, azimuths: 0, ranges: BEYOND };

/// A part lies beyond the map.
const BEYOND: u8 = 0x80;

impl TouchedCells {
    /// Whether all of the cell lies on the map.
    pub fn is_complete(self) -> bool {
        self.ranges & BEYOND == 0
    }

    /// The numbers of the cells, of a map of `R` ranges.
    pub fn cells<const R: usize>(self) -> impl Iterator<Item = core::ops::Range<usize>> {
        let (first, ranges) = (usize::from(self.first), usize::from(self.ranges & !BEYOND));
        (0..usize::from(self.azimuths)).map(move |azimuth| {
            let first = first + azimuth * R;
            first..first + ranges
        })
    }
}

/// From a sensor, along either axis.
const FARTHEST_CM: u32 = 40_000;

/// Those of a sensor.
#[derive(Debug, Clone)]
pub struct Places<const NX: usize, const NY: usize> {
    /// What they were worked out for: geometry, ranges, azimuths, and the map's threshold.
    of: Option<(PolarGeometry, usize, usize, u8)>,
    rows: [[TouchedCells; NY]; NX],
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
        const { assert!(A <= 255 && R * A <= u16::MAX as usize) }
        let sensor = map.geometry().levelling.origin();
        let near = |a: i32, b: i32| a.abs_diff(b) <= FARTHEST_CM;
        self.of = Some((*map.geometry(), R, A, map.visible_from()));
        for (i, (row, span)) in (0..).zip(self.rows.iter_mut().zip(&mut self.spans)) {
            *span = (0, 0);
            for (j, place) in (0..).zip(row) {
                let point = super::centre(origin, cell_cm, i, i32::from(j));
                // farther ones are placed nearer than they are
                let reached = near(point.x_cm, sensor.x_cm) && near(point.y_cm, sensor.y_cm);
                let cell = reached.then(|| touched(map, &Footprint::square(point, cell_cm))).flatten();
                *place = cell.unwrap_or(NOWHERE);
                if cell.is_some() {
                    let first = if span.1 == 0 { j } else { span.0 };
                    *span = (first, j.saturating_add(1));
                }
            }
        }
    }

    /// Row by row.
    pub fn rows(&self) -> &[[TouchedCells; NY]; NX] {
        &self.rows
    }

    /// What the map reaches of each row.
    pub fn spans(&self) -> &[(u16, u16); NX] {
        &self.spans
    }
}

/// The first and the last azimuth and range that an area touches, and whether that is all of it; none if it touches
/// nothing, or more than can be told.
fn touched<const R: usize, const A: usize>(map: &PolarMap<R, A>, area: &Footprint) -> Option<TouchedCells> {
    let mut ends = None::<[usize; 4]>;
    let complete = map.geometry().touched(area, R, A, |azimuth, near, far| {
        let [right, _, nearest, farthest] = ends.unwrap_or([azimuth, azimuth, near, far]);
        ends = Some([right, azimuth, nearest.min(near), farthest.max(far)]);
    });
    let [right, left, nearest, farthest] = ends?;
    let number = |first: usize, last: usize| u8::try_from(last.checked_sub(first)? + 1).ok();
    let ranges = number(nearest, farthest).filter(|ranges| ranges & BEYOND == 0)?;
    Some(TouchedCells {
        first: u16::try_from(right * R + nearest).ok()?,
        azimuths: number(right, left)?,
        ranges: ranges | if complete { 0 } else { BEYOND },
    })
}

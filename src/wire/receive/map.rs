//! A received map, as consumers ask it.

use super::measure::ReceiverLimits;
use super::sensor::SensorReceiver;
use crate::fixed::time::Time;
use crate::map::polar::PolarGeometry;
use crate::map::query::Footprint;
use crate::map::{CellState, Visibility, VisibilityMap, worst_in};
use crate::probability::{self, Probability};
use crate::sensor::road::RoadPoint;
use crate::wire::code::ray::Ray;
use crate::wire::header::Header;
use crate::wire::message::Plane;
use crate::wire::scan_number::ScanNumber;

/// The map of one sensor at a moment. Everything is unknown that is not known to be current.
///
/// Grades come in four steps where the grade plane is sent and no probabilities go with it, else they are 0 and 255. Occupancy needs
/// its plane; without it nothing is said to be free.
#[derive(Debug, Clone, Copy)]
pub struct ReceivedMap<'a, const A: usize, const W: usize, const P: usize> {
    /// Sensor, header and geometry, where there is something to show.
    shown: Option<(&'a SensorReceiver<A, W, P>, &'a Header, PolarGeometry)>,
    now: Time,
    limits: ReceiverLimits,
}

/// Occupancy where it is not sent.
const NOT_SENT: u8 = 128;

impl<'a, const A: usize, const W: usize, const P: usize> ReceivedMap<'a, A, W, P> {
    pub(super) fn new(sensor: Option<&'a SensorReceiver<A, W, P>>, now: Time, limits: ReceiverLimits) -> Self {
        let trusted = sensor.filter(|sensor| sensor.trusted(now, &limits));
        let shown = trusted.and_then(|sensor| sensor.header().map(|header| (sensor, header, header.geometry())));
        Self { shown, now, limits }
    }

    /// What the map is of; `None` where everything is unknown.
    pub fn header(&self) -> Option<&'a Header> {
        self.shown.as_ref().map(|(_, header, _)| *header)
    }

    /// An azimuth of a plane; unknown where it is not sent or not current.
    pub fn ray(&self, plane: Plane, azimuth: usize) -> Ray<W> {
        let ray = self.shown.as_ref().and_then(|(sensor, ..)| sensor.current(plane, azimuth, self.now, &self.limits));
        ray.map_or(Ray::UNKNOWN, |(ray, _)| ray)
    }

    /// The scan an azimuth's visibility is of; `None` where it is unknown.
    pub fn scan(&self, azimuth: usize) -> Option<ScanNumber> {
        let (sensor, ..) = self.shown.as_ref()?;
        sensor.current(Plane::Visibility, azimuth, self.now, &self.limits).map(|(_, scan)| scan)
    }

    /// The probability that the sensor would detect a vehicle in a cell, rounded down to what the cell's bits say: never
    /// above what the sender's table said of its map, measured at most `A + D` ago, and no frame of a newer scan that was
    /// accepted says otherwise. `None` where the cell is unknown, and where the sender says nothing of probabilities.
    pub fn probability(&self, azimuth: usize, range: usize) -> Option<Probability> {
        let levels = self.header()?.probability?;
        let visibility = self.ray(Plane::Visibility, azimuth);
        if !visibility.known.contains(range) {
            return None;
        }
        // bits outside the known cells are not set
        Some(levels.of(visibility.get(range), self.ray(Plane::Grade, azimuth).get(range)))
    }

    /// The same of a point of the road.
    pub fn probability_at(&self, point: RoadPoint) -> Option<Probability> {
        let (azimuth, range) = self.locate(point)?;
        self.probability(azimuth, range)
    }

    /// Of vehicles that are somewhere in an area, the share that is expected to be missed: mean(1 - p) over its cells,
    /// rounded up. Unknown cells count as missed, and so does everything where the sender says nothing of
    /// probabilities. `None` for an area larger than queries look at.
    ///
    /// It is an upper bound of what the sender's table says, because p comes rounded down. It is not the FVR: it is of
    /// all vehicles, the FVR of those that were missed.
    pub fn expected_missed(&self, area: &Footprint) -> Option<Probability> {
        probability::expected_missed(area, |point| self.probability_at(point))
    }

    /// The cell a point lies in, azimuth and range.
    fn locate(&self, point: RoadPoint) -> Option<(usize, usize)> {
        let (_, header, geometry) = self.shown.as_ref()?;
        let (x, y) = geometry.levelling.place(point);
        geometry.locate(x, y, usize::from(header.ranges), usize::from(header.azimuths))
    }

    /// Whether a plane is sent.
    pub fn has(&self, plane: Plane) -> bool {
        plane.index() < P && self.header().is_some_and(|header| header.planes >> plane.index() & 1 == 1)
    }

    /// What is known of a cell.
    pub fn cell(&self, azimuth: usize, range: usize) -> CellState {
        let visibility = self.ray(Plane::Visibility, azimuth);
        if !visibility.known.contains(range) {
            return CellState::UNKNOWN;
        }
        let visible = visibility.get(range);
        let bit = |plane| {
            let ray = Some(self.ray(plane, azimuth)).filter(|_| self.has(plane));
            ray.filter(|ray| ray.known.contains(range)).map(|ray| ray.get(range))
        };
        let graded = self.header().is_some_and(|header| header.probability.is_none());
        let grade = match (visible, bit(Plane::Grade).filter(|_| graded)) {
            (true, None | Some(true)) => u8::MAX,
            (true, Some(false)) => 170,
            (false, Some(true)) => 85,
            (false, None | Some(false)) => 0,
        };
        let occupied = bit(Plane::Occupancy);
        CellState {
            visibility: if visible { Visibility::Visible } else { Visibility::Invisible },
            grade,
            occupancy: occupied.map_or(NOT_SENT, |occupied| if occupied { u8::MAX } else { 0 }),
            occupied: occupied.unwrap_or(true),
        }
    }
}

impl<const A: usize, const W: usize, const P: usize> VisibilityMap for ReceivedMap<'_, A, W, P> {
    fn at(&self, point: RoadPoint) -> CellState {
        self.locate(point).map_or(CellState::UNKNOWN, |(azimuth, range)| self.cell(azimuth, range))
    }

    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        let complete = self.shown.as_ref().is_some_and(|(_, header, geometry)| {
            let (ranges, azimuths) = (usize::from(header.ranges), usize::from(header.azimuths));
            geometry.touched(area, ranges, azimuths, |azimuth, near, far| {
                (near..=far).for_each(|range| visit(self.cell(azimuth, range)));
            })
        });
        if !complete {
            visit(CellState::UNKNOWN);
        }
    }
}

/// The maps of all sensors at a moment: visible is what any of them sees.
#[derive(Debug, Clone, Copy)]
pub struct Together<'a, const N: usize, const A: usize, const W: usize, const P: usize> {
    maps: [ReceivedMap<'a, A, W, P>; N],
}

impl<'a, const N: usize, const A: usize, const W: usize, const P: usize> Together<'a, N, A, W, P> {
    pub(super) fn new(maps: [ReceivedMap<'a, A, W, P>; N]) -> Self {
        Self { maps }
    }
}

/// Parts of an area that one sensor has to see as a whole, centimetres.
const PART_CM: i32 = 100;

impl<const N: usize, const A: usize, const W: usize, const P: usize> VisibilityMap for Together<'_, N, A, W, P> {
    /// The clearest state of all sensors; occupied if any that sees the place says so.
    fn at(&self, point: RoadPoint) -> CellState {
        self.maps.iter().map(|map| map.at(point)).fold(CellState::UNKNOWN, better)
    }

    /// Cells of several maps share no edges: of each metre of the area what the best of them says of all of it.
    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        area.parts(PART_CM, |part| {
            visit(self.maps.iter().map(|map| worst_in(map, part)).fold(CellState::UNKNOWN, better));
        });
    }
}

/// What two sensors say of a place.
fn better(a: CellState, b: CellState) -> CellState {
    let (better, worse) = if (b.visibility, b.grade) > (a.visibility, a.grade) { (b, a) } else { (a, b) };
    if better.visible() && worse.visible() {
        let occupied = better.occupied || worse.occupied;
        return CellState { occupancy: better.occupancy.max(worse.occupancy), occupied, ..better };
    }
    better
}

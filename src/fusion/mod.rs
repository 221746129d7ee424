//! Maps of several sensors as one map of the road: who sees each place, what is hidden from all of them, and where they contradict
//! each other.
//!
//! # Model
//! The road is a grid of square cells. Of each sensor it holds what its newest map says of each cell's centre: the nearest cell of that
//! map, never a better one. A place is
//!
//! | it is | if, among the sensors whose newest map is fresh, |
//! |---|---|
//! | visible | any sees it |
//! | hidden from all | none sees it, and any knows that it does not |
//! | unknown | none knows anything of it: to be treated as hidden |
//! | occupied | any that sees it says so, whatever the others say; where nobody sees it, any that knows of it |
//! | in conflict | one sees it free, and nothing occupied beside it, where another sees it occupied |
//!
//! A map that is too old counts as unknown, and so does one that claims to be of the future. A newer map replaces all that its sensor
//! said before. Maps of one sensor and one time are parts of the same scan, or repetitions: they are joined, and where both know a cell
//! the worse of them counts. So neither the order in which maps come, nor repeating them, nor cutting them into parts makes a difference.
//!
//! [`fill`] puts it into the cells of a [`polar`] map around a place of one's choice, which a
//! [`Broadcaster`](crate::wire::broadcast::Broadcaster) sends.
//!
//! # Limits
//! At most 8 sensors; `NX * NY * (3 * S + 2)` bytes. Clocks are the caller's: times of all sensors, and `now`, are of one clock.
//! A sensor that sends its last picture again and again with new times cannot be told from a road on which nothing moves: its
//! [`Monitor`] can, where others see what it should.
//!
//! # Cost
//! Some 15 instructions for each cell that a polar map reaches; other maps are asked for each cell.

mod monitor;
mod places;
mod polar;
mod view;

use crate::fixed::time::Time;
use crate::map::polar::PolarMap;
use crate::map::{CellState, Visibility, VisibilityMap};
use crate::sensor::config::{ConfigError, within};
use crate::sensor::road::RoadPoint;

pub use monitor::{Monitor, MonitorConfig, Observed, Watched};
use places::Places;
pub use polar::{fill, polar};
pub use view::{Conflict, Fused, FusedCell, Sensors};

/// Most sensors.
pub const MOST_SENSORS: usize = 8;

/// When maps count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct FusionConfig {
    /// Age from which a map is unknown, ms.
    pub max_age_ms: u16,
    /// How far clocks may differ, ms: a map from later than this is not taken.
    pub max_lead_ms: u16,
}

impl Default for FusionConfig {
    fn default() -> Self {
        Self { max_age_ms: 300, max_lead_ms: 50 }
    }
}

/// Why a map was not taken; what was held stays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NotTaken {
    /// There is no such sensor.
    NoSuchSensor,
    /// The sensor's newest map is newer.
    Older,
    /// It is of the future: its clock differs.
    Early,
    /// It is too old to count: late, or its clock differs.
    Late,
    /// Its cells lie elsewhere than those the sensor was placed with: another mount, grid or epoch.
    OtherGeometry,
}

/// What became of a sensor's maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Taken {
    /// Newer than those before.
    pub new: u32,
    /// Of the same time as the one before: parts, or repeated.
    pub joined: u32,
    /// Older than what was held.
    pub older: u32,
    /// Of the future.
    pub early: u32,
    /// Too old to count.
    pub late: u32,
    /// Of another geometry.
    pub other_geometry: u32,
}

/// What is held of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Held {
    measured: Option<Time>,
    taken: Taken,
}

/// What the sensors say of one place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Cell<const S: usize> {
    /// Grades, 0 where unknown.
    grades: [u8; S],
    /// Who sees it, a bit a sensor.
    visible: u8,
    /// Who says that it is occupied, whether or not they see it.
    occupied: u8,
}

impl<const S: usize> Cell<S> {
    const UNKNOWN: Self = Self { grades: [0; S], visible: 0, occupied: 0 };

    /// What a sensor says now.
    fn replace(&mut self, sensor: usize, state: CellState) {
        let bit = 1_u8 << (sensor & 7);
        let put = |bits: u8, on: bool| if on { bits | bit } else { bits & !bit };
        if let Some(grade) = self.grades.get_mut(sensor) {
            let known = state.visibility != Visibility::Unknown;
            *grade = if known { state.grade.max(1) } else { 0 };
            self.visible = put(self.visible, state.visible());
            self.occupied = put(self.occupied, known && state.occupied);
        }
    }

    /// What it says as well, of the same time: the worse counts where both are known.
    fn join(&mut self, sensor: usize, state: CellState) {
        let bit = 1_u8 << (sensor & 7);
        match self.grades.get_mut(sensor) {
            Some(0) => self.replace(sensor, state),
            Some(grade) if state.visibility != Visibility::Unknown => {
                *grade = (*grade).min(state.grade.max(1));
                if !state.visible() {
                    self.visible &= !bit;
                }
                if state.occupied {
                    self.occupied |= bit;
                }
            }
            _ => {}
        }
    }
}

/// Maps of `S` sensors on `NX` cells along the road by `NY` across.
#[derive(Debug, Clone)]
pub struct Fusion<const S: usize, const NX: usize, const NY: usize> {
    config: FusionConfig,
    /// Corner of the first cell.
    origin: RoadPoint,
    cell_cm: i32,
    held: [Held; S],
    places: [Places<NX, NY>; S],
    cells: [[Cell<S>; NY]; NX],
}

impl<const S: usize, const NX: usize, const NY: usize> Fusion<S, NX, NY> {
    /// Nothing known; for static memory. To be [set](Self::set) before it is used.
    pub const NOWHERE: Self = {
        assert!(S <= MOST_SENSORS);
        Self {
            config: FusionConfig { max_age_ms: 0, max_lead_ms: 0 },
            origin: RoadPoint::new(0, 0),
            cell_cm: 100,
            held: [Held {
                measured: None,
                taken: Taken { new: 0, joined: 0, older: 0, early: 0, late: 0, other_geometry: 0 },
            }; S],
            places: [const { Places::NONE }; S],
            cells: [[Cell::UNKNOWN; NY]; NX],
        }
    };

    /// Forgets everything; the first cell's corner with the smallest coordinates lies at `origin`.
    ///
    /// # Errors
    /// Cells smaller than 0.25 m or larger than 10 m, an age of no time or of more than 10 s.
    pub fn set(&mut self, origin: RoadPoint, cell_cm: i32, config: FusionConfig) -> Result<(), ConfigError> {
        within("fusion.cell_cm", cell_cm as f32, 25.0, 1000.0)?;
        within("fusion.max_age_ms", f32::from(config.max_age_ms), 1.0, 10_000.0)?;
        within("fusion.max_lead_ms", f32::from(config.max_lead_ms), 0.0, 10_000.0)?;
        (self.config, self.origin, self.cell_cm) = (config, origin, cell_cm);
        for sensor in 0..S {
            self.forget(sensor);
        }
        self.held = [Held::default(); S];
        Ok(())
    }

    /// Everything a sensor said is unknown: its epoch changed, or it is not trusted any more.
    pub fn forget(&mut self, sensor: usize) {
        if let Some(held) = self.held.get_mut(sensor) {
            held.measured = None;
        }
        if let Some(places) = self.places.get_mut(sensor) {
            *places = Places::NONE;
        }
        for cell in self.cells.iter_mut().flatten() {
            cell.replace(sensor, CellState::UNKNOWN);
        }
    }

    /// Takes a polar map. Where its cells lie is worked out with the first one, and again after [`forget`](Self::forget).
    ///
    /// # Errors
    /// Why it was not taken.
    pub fn offer_polar<const R: usize, const A: usize>(
        &mut self,
        sensor: usize,
        measured: Time,
        now: Time,
        map: &PolarMap<R, A>,
    ) -> Result<(), NotTaken> {
        let (origin, cell_cm) = (self.origin, self.cell_cm);
        let places = self.places.get_mut(sensor).ok_or(NotTaken::NoSuchSensor)?;
        let held = self.held.get_mut(sensor).ok_or(NotTaken::NoSuchSensor)?;
        if !places.fit(map) && held.measured.is_some() {
            held.taken.other_geometry = held.taken.other_geometry.saturating_add(1);
            return Err(NotTaken::OtherGeometry);
        }
        let join = held.admit(measured, now, self.config)?;
        if !places.fit(map) {
            places.work_out(map, origin, cell_cm);
        }
        for ((row, places), (first, end)) in self.cells.iter_mut().zip(places.rows()).zip(places.spans()) {
            let reached = usize::from(*first)..usize::from(*end);
            let (Some(cells), Some(places)) = (row.get_mut(reached.clone()), places.get(reached)) else { continue };
            for (cell, place) in cells.iter_mut().zip(places) {
                let state = place.of(map);
                if join { cell.join(sensor, state) } else { cell.replace(sensor, state) }
            }
        }
        Ok(())
    }

    /// Takes any map.
    ///
    /// # Errors
    /// Why it was not taken.
    pub fn offer(
        &mut self,
        sensor: usize,
        measured: Time,
        now: Time,
        map: &(impl VisibilityMap + ?Sized),
    ) -> Result<(), NotTaken> {
        let join = self.held.get_mut(sensor).ok_or(NotTaken::NoSuchSensor)?.admit(measured, now, self.config)?;
        let (origin, cell_cm) = (self.origin, self.cell_cm);
        for (i, row) in (0..).zip(&mut self.cells) {
            for (j, cell) in (0..).zip(row) {
                let state = map.at(centre(origin, cell_cm, i, j));
                if join { cell.join(sensor, state) } else { cell.replace(sensor, state) }
            }
        }
        Ok(())
    }

    /// What became of a sensor's maps; none of one that is not there.
    pub fn taken(&self, sensor: usize) -> Option<&Taken> {
        self.held.get(sensor).map(|held| &held.taken)
    }

    /// The fused map as it is at a time.
    pub fn at(&self, now: Time) -> Fused<'_, S, NX, NY> {
        Fused::new(self, now)
    }
}

/// Middle of a cell.
fn centre(origin: RoadPoint, cell_cm: i32, i: i32, j: i32) -> RoadPoint {
    let at = |from: i32, k: i32| from.saturating_add(k.saturating_mul(cell_cm)).saturating_add(cell_cm / 2);
    RoadPoint::new(at(origin.x_cm, i), at(origin.y_cm, j))
}

impl Held {
    /// Whether a map of this time is taken, and joined to the one before.
    fn admit(&mut self, measured: Time, now: Time, config: FusionConfig) -> Result<bool, NotTaken> {
        let count = |counter: &mut u32| *counter = counter.saturating_add(1);
        let (lead, age) = (measured.since(now).unwrap_or(0), now.since(measured).unwrap_or(0));
        if lead > 1000 * u64::from(config.max_lead_ms) {
            count(&mut self.taken.early);
            return Err(NotTaken::Early);
        }
        if age > 1000 * u64::from(config.max_age_ms) {
            count(&mut self.taken.late);
            return Err(NotTaken::Late);
        }
        match self.measured {
            Some(newest) if measured < newest => {
                count(&mut self.taken.older);
                return Err(NotTaken::Older);
            }
            Some(newest) if measured == newest => {
                count(&mut self.taken.joined);
                return Ok(true);
            }
            _ => {}
        }
        count(&mut self.taken.new);
        self.measured = Some(measured);
        Ok(false)
    }

    /// Whether its newest map counts.
    fn fresh(&self, now: Time, config: FusionConfig) -> bool {
        let [age, lead] = [config.max_age_ms, config.max_lead_ms].map(|ms| 1000 * u64::from(ms));
        self.measured.is_some_and(|at| now.since(at).unwrap_or(0) <= age && at.since(now).unwrap_or(0) <= lead)
    }
}

//! Maps of several sensors as one map of the road: who sees each place, what is hidden from all of them, and where they
//! contradict each other.
//!
//! # Model
//! The road is a grid of square cells. Of each sensor it holds what its newest map says of each cell's centre: the
//! nearest cell of that map, never a better one. A place is
//!
//! | it is | if, among the sensors whose newest map is fresh, |
//! |---|---|
//! | visible | any sees it |
//! | hidden from all | none sees it, and any knows that it does not |
//! | unknown | none knows anything of it: to be treated as hidden |
//! | occupied | any that sees it says so, whatever the others say; where nobody sees it, any that knows of it |
//! | in conflict | one sees it free, and nothing occupied beside it, where another sees it occupied |
//!
//! A map that is late or claims to be of the future is refused; what is held of a sensor counts until it is too old. A
//! newer map replaces all that its sensor said before. Maps of one sensor and one time are parts of the same scan, or
//! repetitions: they are joined, and where both know a cell the worse of them counts. So as long as a sensor keeps its
//! mount and its kind of map, neither the order in which maps come, nor repeating them, nor cutting them into parts
//! makes a difference. Mount and kind are those of its first map until it is [forgotten](Fusion::forget), which is also
//! due when it starts over: a map does not say so.
//!
//! [`fill`] puts it into the cells of a polar map around a place of one's choice, which a
//! [`Broadcaster`](crate::wire::broadcast::Broadcaster) sends.
//!
//! # Limits
//! At most 8 sensors; `NX * NY * (3 * S + 1) + 4 * NX * S` bytes. What lies between the middles of cells is not looked
//! at: cells are 2 m at most. Polar maps count up to 400 m from their sensor. Clocks are the caller's: times of all
//! sensors, and `now`, are of one clock. A sensor that sends its last picture again and again with new times cannot be
//! told from a road on which nothing moves: its [`Monitor`] can, where others see what it should.
//!
//! # Cost
//! Some 22 instructions for each cell that a polar map reaches; other maps are asked for each cell.

mod alignment;
mod fixtures;
mod followed;
mod monitor;
mod places;
mod polar;
mod supervised;
mod view;
mod window;

use crate::fixed::time::Time;
use crate::map::polar::PolarMap;
use crate::map::{Visibility, VisibilityMap};
use crate::sensor::config::{ConfigError, within};
use crate::sensor::road::RoadPoint;

#[cfg(feature = "monitoring")]
pub use alignment::{Alignment, AlignmentConfig};
#[cfg(feature = "monitoring")]
pub use fixtures::{Fixtures, FixturesConfig};
pub use monitor::{Monitor, MonitorConfig, Observed, Watched};
use places::{Place, Places};
pub use polar::{fill, polar};
#[cfg(feature = "monitoring")]
pub use supervised::{Supervised, Supervision};
pub use view::{Conflict, Fused, FusedCell, Sensors};

/// Most sensors.
pub const MOST_SENSORS: usize = 8;

/// When maps count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct FusionConfig {
    /// Age up to which a map counts, ms.
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
    /// Its cells lie elsewhere than those of the sensor's first map, or it is of another kind: another mount, grid or
    /// threshold.
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Held {
    measured: Option<Time>,
    taken: Taken,
    /// Least grade that is visible.
    visible_from: u8,
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
    /// What each sensor says, 0 where unknown.
    grades: [[[u8; NY]; NX]; S],
    /// Who says that a cell is occupied, whether or not they see it: a bit a sensor.
    occupied: [[u8; NY]; NX],
}

impl<const S: usize, const NX: usize, const NY: usize> Fusion<S, NX, NY> {
    /// Nothing known; for static memory. To be [set](Self::set) before it is used.
    pub const NOWHERE: Self = {
        assert!(S <= MOST_SENSORS);
        Self {
            config: FusionConfig { max_age_ms: 0, max_lead_ms: 0 },
            origin: RoadPoint::new(0, 0),
            cell_cm: 100,
            held: [Held::NOTHING; S],
            places: [const { Places::NONE }; S],
            grades: [[[0; NY]; NX]; S],
            occupied: [[0; NY]; NX],
        }
    };

    /// Forgets everything; the first cell's corner with the smallest coordinates lies at `origin`.
    ///
    /// # Errors
    /// Cells smaller than 0.25 m or larger than 2 m, an age of no time or of more than 10 s.
    pub fn set(&mut self, origin: RoadPoint, cell_cm: i32, config: FusionConfig) -> Result<(), ConfigError> {
        within("fusion.cell_cm", cell_cm as f32, 25.0, 200.0)?;
        within("fusion.max_age_ms", f32::from(config.max_age_ms), 1.0, 10_000.0)?;
        within("fusion.max_lead_ms", f32::from(config.max_lead_ms), 0.0, 10_000.0)?;
        (self.config, self.origin, self.cell_cm) = (config, origin, cell_cm);
        for sensor in 0..S {
            self.forget(sensor);
        }
        self.held = [Held::NOTHING; S];
        Ok(())
    }

    /// Everything a sensor said is unknown: its epoch changed, or it is not trusted any more.
    pub fn forget(&mut self, sensor: usize) {
        let Some(((held, places), grades)) =
            self.held.get_mut(sensor).zip(self.places.get_mut(sensor)).zip(self.grades.get_mut(sensor))
        else {
            return;
        };
        (held.measured, held.visible_from) = (None, USUAL_THRESHOLD);
        *places = Places::NONE;
        *grades = [[0; NY]; NX];
        self.occupied.iter_mut().flatten().for_each(|bits| *bits &= !bit(sensor));
    }

    /// Takes a polar map. Where its cells lie is worked out with the first one, and again after
    /// [`forget`](Self::forget).
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
        let (places, held) =
            self.places.get_mut(sensor).zip(self.held.get_mut(sensor)).ok_or(NotTaken::NoSuchSensor)?;
        let grades = self.grades.get_mut(sensor).ok_or(NotTaken::NoSuchSensor)?;
        if !places.fit(map) && held.measured.is_some() {
            return Err(held.refuse(NotTaken::OtherGeometry));
        }
        let join = held.admit(measured, now, self.config)?;
        if !places.fit(map) {
            places.work_out(map, self.origin, self.cell_cm);
            held.visible_from = map.visible_from();
        }
        let (bit, occupied_from) = (bit(sensor), map.occupied_from());
        let (from, occupancy) = map.cells();
        // as long as the other, which spares a check a cell
        let occupancy = occupancy.get(..from.len()).unwrap_or_default();
        let rows = places.rows().iter().zip(places.spans()).zip(grades.iter_mut().zip(&mut self.occupied));
        for ((places, (first, end)), (grades, occupied)) in rows {
            let reached = usize::from(*first)..usize::from(*end);
            let (Some(places), Some(grades), Some(occupied)) =
                (places.get(reached.clone()), grades.get_mut(reached.clone()), occupied.get_mut(reached))
            else {
                continue;
            };
            let cells = places.iter().zip(grades.iter_mut().zip(occupied));
            // a place beyond the map is in neither
            let said = |place: &Place| {
                let place = usize::from(*place);
                let said = from.get(place).copied().unwrap_or(0);
                let occupancy = occupancy.get(place).copied().unwrap_or(0);
                (said, (said != 0) & (occupancy >= occupied_from))
            };
            if join {
                cells.for_each(|(place, (grade, occupied))| {
                    let (said, is_occupied) = said(place);
                    worse(grade, occupied, bit, said, is_occupied);
                });
            } else {
                cells.for_each(|(place, (grade, occupied))| {
                    let (said, is_occupied) = said(place);
                    *grade = said;
                    *occupied = (*occupied & !bit) | (bit * u8::from(is_occupied));
                });
            }
        }
        Ok(())
    }

    /// Takes any map, of a sensor none of whose polar maps was taken.
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
        let (held, grades) =
            self.held.get_mut(sensor).zip(self.grades.get_mut(sensor)).ok_or(NotTaken::NoSuchSensor)?;
        // a polar map of it would not reach all that this one does, and leave the rest behind
        if self.places.get(sensor).is_some_and(Places::are_worked_out) {
            return Err(held.refuse(NotTaken::OtherGeometry));
        }
        let join = held.admit(measured, now, self.config)?;
        let (bit, from) = (bit(sensor), held.visible_from);
        let (origin, cell_cm) = (self.origin, self.cell_cm);
        for (i, (grades, occupied)) in (0..).zip(grades.iter_mut().zip(&mut self.occupied)) {
            for (j, (grade, occupied)) in (0..).zip(grades.iter_mut().zip(occupied)) {
                let state = map.at(centre(origin, cell_cm, i, j));
                // the grade is held to what the map says, whatever its own threshold
                let (said, is_occupied) = match state.visibility {
                    Visibility::Unknown => (0, false),
                    Visibility::Invisible => (state.grade.clamp(1, from - 1), state.occupied),
                    Visibility::Visible => (state.grade.max(from), state.occupied),
                };
                if !join {
                    (*grade, *occupied) = (0, *occupied & !bit);
                }
                worse(grade, occupied, bit, said, is_occupied);
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

/// Threshold of a sensor whose maps are not polar.
const USUAL_THRESHOLD: u8 = 128;

/// A sensor's bit; sensors are fewer than 8.
fn bit(sensor: usize) -> u8 {
    1 << (sensor & 7)
}

/// Joins what a map of the same time says as well: the worse counts where both are known.
fn worse(grade: &mut u8, occupied: &mut u8, bit: u8, said: u8, is_occupied: bool) {
    if said != 0 {
        *grade = if *grade == 0 { said } else { said.min(*grade) };
        *occupied |= if is_occupied { bit } else { 0 };
    }
}

/// Middle of a cell.
fn centre(origin: RoadPoint, cell_cm: i32, i: i32, j: i32) -> RoadPoint {
    let at = |from: i32, k: i32| from.saturating_add(k.saturating_mul(cell_cm)).saturating_add(cell_cm / 2);
    RoadPoint::new(at(origin.x_cm, i), at(origin.y_cm, j))
}

impl Held {
    const NOTHING: Self = Self {
        measured: None,
        taken: Taken { new: 0, joined: 0, older: 0, early: 0, late: 0, other_geometry: 0 },
        visible_from: USUAL_THRESHOLD,
    };

    /// Whether a map of this time is taken, and joined to the one before.
    fn admit(&mut self, measured: Time, now: Time, config: FusionConfig) -> Result<bool, NotTaken> {
        let (lead, age) = (measured.since(now).unwrap_or(0), now.since(measured).unwrap_or(0));
        if lead > 1000 * u64::from(config.max_lead_ms) {
            return Err(self.refuse(NotTaken::Early));
        }
        if age > 1000 * u64::from(config.max_age_ms) {
            return Err(self.refuse(NotTaken::Late));
        }
        match self.measured {
            Some(newest) if measured < newest => Err(self.refuse(NotTaken::Older)),
            Some(newest) if measured == newest => {
                self.taken.joined = self.taken.joined.saturating_add(1);
                Ok(true)
            }
            _ => {
                self.taken.new = self.taken.new.saturating_add(1);
                self.measured = Some(measured);
                Ok(false)
            }
        }
    }

    /// Counts a map that is not taken, under its reason.
    fn refuse(&mut self, why: NotTaken) -> NotTaken {
        let Taken { older, early, late, other_geometry, .. } = &mut self.taken;
        let counter = match why {
            NotTaken::NoSuchSensor => return why,
            NotTaken::Older => older,
            NotTaken::Early => early,
            NotTaken::Late => late,
            NotTaken::OtherGeometry => other_geometry,
        };
        *counter = counter.saturating_add(1);
        why
    }

    /// Whether its newest map counts.
    fn fresh(&self, now: Time, config: FusionConfig) -> bool {
        let [age, lead] = [config.max_age_ms, config.max_lead_ms].map(|ms| 1000 * u64::from(ms));
        self.measured.is_some_and(|at| now.since(at).unwrap_or(0) <= age && at.since(now).unwrap_or(0) <= lead)
    }
}

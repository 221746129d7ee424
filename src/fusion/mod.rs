//! Maps of several sensors as one map of the road: who sees each place, what is hidden from all of them, and where they
//! contradict each other.
//!
//! # Model
//! The road is a grid of square cells. Of each sensor it holds the worst of what its newest map says anywhere in each
//! cell: it sees a cell if it sees all of it. A cell is
//!
//! | it is | if, among the sensors whose newest map is fresh, |
//! |---|---|
//! | visible | any sees it |
//! | hidden from all | none sees it, and any knows that it does not |
//! | unknown | none knows anything of it: to be treated as hidden |
//! | occupied | any that sees some of it says so of that, whatever the others say; where nobody sees it, any that knows of it |
//! | in conflict | one sees it free, and nothing occupied beside it, where another sees some of it occupied |
//!
//! A map that is late or claims to be of the future is refused; what is held of a sensor counts until it is too old. A
//! newer map replaces all that its sensor said before. Maps of one sensor and one time are parts of the same scan, or
//! repetitions: they are joined, and the worst of what they know of a cell counts. So as long as a sensor keeps its
//! mount and its kind of map, neither the order in which maps come nor repeating them makes a difference, and cutting
//! them into parts only makes cells unknown that no part holds as a whole. Mount and kind are those of its first map until it is [forgotten](Fusion::forget), which is also
//! due when it starts over: a map does not say so.
//!
//! [`fill`] puts it into the cells of a polar map around a place of one's choice, which a
//! [`Broadcaster`](crate::wire::broadcast::Broadcaster) sends.
//!
//! # Limits
//! At most 8 sensors; `NX * NY * (5 * S + 3) + 4 * NX * S` bytes. Cells are 2 m at most. Polar maps count up to 400 m from their sensor. Clocks are the caller's: times of all
//! sensors, and `now`, are of one clock. A sensor that sends its last picture again and again with new times cannot be
//! told from a road on which nothing moves: its [`Monitor`] can, where others see what it should.
//!
//! # Cost
//! Each cell looks at the polar cells it touches: some four at 100 m, a dozen at 20 m. Other maps are asked for each cell.

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
use crate::map::query::Footprint;
use crate::map::{Visibility, VisibilityMap};
use crate::sensor::config::{ConfigError, within};
use crate::sensor::road::RoadPoint;

pub use alignment::{Alignment, AlignmentConfig};
pub use fixtures::{Fixtures, FixturesConfig, FixturesLimits};
pub use monitor::{Monitor, MonitorConfig, Observed, Watched};
use places::Places;
pub use polar::{fill, polar};
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
    /// The worst that each sensor knows of a cell, 0 where it knows nothing.
    grades: [[[u8; NY]; NX]; S],
    /// What else they say: a bit a sensor.
    marks: [[Marks; NY]; NX],
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
            marks: [[Marks::NONE; NY]; NX],
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
        self.marks.iter_mut().flatten().for_each(|marks| marks.clear(bit(sensor)));
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
        let (bit, visible_from, occupied_from) = (bit(sensor), map.visible_from(), map.occupied_from());
        let (from, occupancy) = map.cells();
        let rows = places.rows().iter().zip(places.spans()).zip(grades.iter_mut().zip(&mut self.marks));
        for ((places, (first, end)), (grades, marks)) in rows {
            let reached = usize::from(*first)..usize::from(*end);
            let (Some(places), Some(grades), Some(marks)) =
                (places.get(reached.clone()), grades.get_mut(reached.clone()), marks.get_mut(reached))
            else {
                continue;
            };
            for (place, (grade, marks)) in places.iter().zip(grades.iter_mut().zip(marks)) {
                let mut said = Said { complete: place.is_complete(), ..Said::NOTHING };
                for cells in place.cells::<R>() {
                    let cells = from.get(cells.clone()).zip(occupancy.get(cells));
                    let (grades, occupancy) = cells.unwrap_or_default();
                    for (grade, occupancy) in grades.iter().zip(occupancy) {
                        said.add(*grade, *grade >= visible_from, *occupancy >= occupied_from);
                    }
                }
                said.put(join, bit, grade, marks);
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
        for (i, (grades, marks)) in (0..).zip(grades.iter_mut().zip(&mut self.marks)) {
            for (j, (grade, marks)) in (0..).zip(grades.iter_mut().zip(marks)) {
                let mut said = Said { complete: true, ..Said::NOTHING };
                map.cells_in(&Footprint::square(centre(origin, cell_cm, i, j), cell_cm), &mut |state| {
                    // the grade is held to what the map says, whatever its own threshold
                    match state.visibility {
                        Visibility::Unknown => said.add(0, false, false),
                        Visibility::Invisible => said.add(state.grade.clamp(1, from - 1), false, state.occupied),
                        Visibility::Visible => said.add(state.grade.max(from), true, state.occupied),
                    }
                });
                said.put(join, bit, grade, marks);
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

/// What sensors say of a cell besides their grades: a bit a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Marks {
    /// Who knows all of it.
    known: u8,
    /// Who says that some of it is occupied, whether or not they see that.
    occupied: u8,
    /// Who sees that some of it is occupied, whether or not they see all of it.
    seen_occupied: u8,
}

impl Marks {
    const NONE: Self = Self { known: 0, occupied: 0, seen_occupied: 0 };

    fn clear(&mut self, bit: u8) {
        self.known &= !bit;
        self.occupied &= !bit;
        self.seen_occupied &= !bit;
    }
}

/// What one map says of a cell.
#[derive(Debug, Clone, Copy)]
struct Said {
    /// The worst grade of what it knows, 0 if that is nothing.
    grade: u8,
    /// Whether it knows all of the cell.
    complete: bool,
    occupied: bool,
    seen_occupied: bool,
}

impl Said {
    const NOTHING: Self = Self { grade: 0, complete: false, occupied: false, seen_occupied: false };

    /// One of the map's own cells.
    fn add(&mut self, grade: u8, visible: bool, occupied: bool) {
        self.add_known(grade);
        self.complete &= grade != 0;
        self.occupied |= occupied & (grade != 0);
        self.seen_occupied |= occupied & visible & (grade != 0);
    }

    /// In the place of what its sensor said before, or joined to a map of the same time: the worst of both counts.
    fn put(mut self, join: bool, bit: u8, grade: &mut u8, marks: &mut Marks) {
        let known = self.complete & (self.grade != 0);
        if join {
            self.add_known(*grade);
        } else {
            marks.clear(bit);
        }
        let mark = |yes: bool| if yes { bit } else { 0 };
        *grade = self.grade;
        marks.known |= mark(known);
        marks.occupied |= mark(self.occupied);
        marks.seen_occupied |= mark(self.seen_occupied);
    }

    /// The worst grade of two, nothing known left out.
    fn add_known(&mut self, grade: u8) {
        // 0, which is nothing known, wraps to the greatest
        self.grade = self.grade.wrapping_sub(1).min(grade.wrapping_sub(1)).wrapping_add(1);
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
